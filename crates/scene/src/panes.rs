//! Which glass is a thin wall. KHR_materials_transmission without a thickness (KHR_materials_volume) is one by the standard,
//! but many files mean solid glass by it: what closes around a body is taken for that, and what does not, as a window's
//! pane, for a wall.

use std::collections::HashMap;

use glam::DVec3;

use super::{Material, Mesh};

/// A surface is open if more than this share of its area faces one way without as much that faces the other: over a closed one
/// the vectors of area sum to 0 (divergence theorem). A ball without a cap of a fifth of its diameter is left with 0.04.
const OPEN_SHARE: f64 = 0.01;

/// For each material whether most of its area belongs to open surfaces; false for all but glass without a thickness.
/// Connected triangles of such glass make a surface. Work in proportion to all triangles.
pub fn open_materials(materials: &[Material], meshes: &[Mesh]) -> Vec<bool> {
    let mut excess = vec![0.0; materials.len()];
    let has_thin = materials.iter().any(Material::may_be_thin);
    for mesh in meshes.iter().filter(|_| has_thin) {
        let triangles = mesh.triangles.iter().map(|t| (t.material as usize, t));
        let glass: Vec<_> = triangles
            .filter(|(material, _)| materials.get(*material).is_some_and(Material::may_be_thin))
            .map(|(material, triangle)| {
                let [a, b, c] = mesh.corners(triangle);
                (material, triangle.vertices, 0.5 * (b - a).cross(c - a))
            })
            .collect();
        let surfaces = surfaces(mesh, glass.iter().map(|(_, vertices, _)| *vertices));
        let mut sums = vec![(DVec3::ZERO, 0.0); glass.len()];
        for ((_, _, vector), surface) in glass.iter().zip(&surfaces) {
            sums[*surface].0 += *vector;
            sums[*surface].1 += vector.length();
        }
        for ((material, _, vector), surface) in glass.iter().zip(&surfaces) {
            let (sum, area) = sums[*surface];
            let is_open = sum.length() > OPEN_SHARE * area;
            excess[*material] += if is_open {
                vector.length()
            } else {
                -vector.length()
            };
        }
    }
    excess.into_iter().map(|excess| excess > 0.0).collect()
}

/// For each triangle the first one of those that it is connected with. Vertices in one place are one.
fn surfaces(mesh: &Mesh, triangles: impl Iterator<Item = [u32; 3]>) -> Vec<usize> {
    let mut first_at = HashMap::new();
    let mut parents = Vec::new();
    for (index, vertices) in triangles.enumerate() {
        parents.push(index);
        for vertex in vertices {
            // 0 and -0 are one place.
            let place = mesh.positions[vertex as usize].map(|x| (x + 0.0).to_bits());
            let other = *first_at.entry(place).or_insert(index);
            let [one, other] = [index, other].map(|triangle| root(&mut parents, triangle));
            parents[one.max(other)] = one.min(other);
        }
    }
    (0..parents.len())
        .map(|triangle| root(&mut parents, triangle))
        .collect()
}

/// The set of a triangle; the way there is halved (Tarjan and van Leeuwen 1984, "Worst-case analysis of set union algorithms").
fn root(parents: &mut [usize], mut at: usize) -> usize {
    while parents[at] != at {
        parents[at] = parents[parents[at]];
        at = parents[at];
    }
    at
}

#[cfg(test)]
mod tests {
    use super::super::MeshTriangle;
    use super::*;

    /// Quads by their corners, in turn.
    fn mesh(quads: &[[[f32; 3]; 4]], material: u32) -> Mesh {
        let triangle = |vertices| MeshTriangle { vertices, material };
        Mesh {
            positions: quads.as_flattened().to_vec(),
            triangles: (0..quads.len() as u32)
                .map(|quad| 4 * quad)
                .flat_map(|i| [triangle([i, i + 1, i + 2]), triangle([i, i + 2, i + 3])])
                .collect(),
            ..Mesh::default()
        }
    }

    /// The faces of a box, outward.
    fn faces([x, y, z]: [f32; 3]) -> Vec<[[f32; 3]; 4]> {
        let all = [
            [[0., 0., z], [x, 0., z], [x, y, z], [0., y, z]],
            [[0., 0., 0.], [0., y, 0.], [x, y, 0.], [x, 0., 0.]],
            [[x, 0., 0.], [x, y, 0.], [x, y, z], [x, 0., z]],
            [[0., 0., 0.], [0., 0., z], [0., y, z], [0., y, 0.]],
            [[0., y, 0.], [0., y, z], [x, y, z], [x, y, 0.]],
            [[-0., 0., 0.], [x, 0., 0.], [x, 0., z], [0., 0., z]],
        ];
        all.to_vec()
    }

    #[test]
    fn glass_that_closes_around_a_body_is_no_pane() {
        let glass = Material {
            metallic: 0.0,
            transmission: 1.0,
            ..Material::default()
        };
        let solid = Material {
            thickness: 1.0,
            ..glass.clone()
        };
        let is_open = |glass: &Material, meshes: &[Mesh]| {
            open_materials(&[Material::default(), glass.clone()], meshes)[1]
        };
        let body = faces([1.0, 2.0, 0.5]);
        assert!(!is_open(&glass, &[mesh(&body, 1)]));
        for missing in 0..6 {
            let mut open = body.clone();
            open.remove(missing);
            assert!(is_open(&glass, &[mesh(&open, 1)]), "face {missing}");
            assert!(!is_open(&solid, &[mesh(&open, 1)]));
            assert!(!is_open(&Material::default(), &[mesh(&open, 1)]));
        }
        // Panes that face all ways around a house close around nothing: they do not touch.
        let apart = body.iter().enumerate().map(|(at, face)| {
            let away = 3.0 * at as f32;
            face.map(|[x, y, z]| [x + away, y, z])
        });
        let apart: Vec<_> = apart.collect();
        assert!(is_open(&glass, &[mesh(&apart, 1)]));
        // The greater part decides.
        assert!(!is_open(&glass, &[mesh(&body, 1), mesh(&apart[1..2], 1)]));
        assert!(is_open(
            &glass,
            &[mesh(&body, 1), mesh(&apart, 1), mesh(&apart, 1)]
        ));
    }
}
