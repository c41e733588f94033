//! Which glass is a thin wall. KHR_materials_transmission without a thickness (KHR_materials_volume) is one by the standard,
//! but many files mean solid glass by it: what closes around a body is taken for that, and what does not, as a window's
//! pane, for a wall.

use std::collections::HashMap;

use glam::DVec3;

use super::{Material, Mesh, as_dvec3};

/// A surface is open if more than this share of its area faces one way without as much that faces the other: over a closed one
/// the vectors of area sum to 0 (divergence theorem). A ball without a cap of a fifth of its diameter is left with 0.04.
const OPEN_SHARE: f64 = 0.01;

/// Or if it encloses less than this times its area^1.5, as a quad with a back of its own does. A sheet of 1 m^2 and 1 mm has 3.5e-4.
const FLAT_SHARE: f64 = 1e-6;

/// For each material whether most of its area belongs to open surfaces; none for all but glass without a thickness that has an
/// area. Connected triangles of such glass make a surface. Work in proportion to all triangles.
pub fn open_materials(materials: &[Material], meshes: &[Mesh]) -> Vec<Option<bool>> {
    let mut areas = vec![[0.0; 2]; materials.len()];
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
        let mut sums = vec![(DVec3::ZERO, 0.0, 0.0); glass.len()];
        for ((_, vertices, vector), surface) in glass.iter().zip(&surfaces) {
            let place = |vertices: &[u32; 3]| as_dvec3(mesh.positions[vertices[0] as usize]);
            let (sum, area, volume) = &mut sums[*surface];
            *sum += *vector;
            *area += vector.length();
            // About a corner of the surface.
            *volume += (place(vertices) - place(&glass[*surface].1)).dot(*vector) / 3.0;
        }
        for ((material, _, vector), surface) in glass.iter().zip(&surfaces) {
            let (sum, area, volume) = sums[*surface];
            let is_flat = volume.abs() < FLAT_SHARE * area.powf(1.5);
            let is_open = is_flat || sum.length() > OPEN_SHARE * area;
            areas[*material][usize::from(is_open)] += vector.length();
        }
    }
    let is_open = |[closed, open]: [f64; 2]| (closed + open > 0.0).then_some(open > closed);
    areas.into_iter().map(is_open).collect()
}

/// Says of all materials whether they are open, after a change of `meshes` or of what is glass.
pub fn find_open(materials: &mut [Material], meshes: &[Mesh]) {
    let open = open_materials(materials, meshes);
    for (material, is_open) in materials.iter_mut().zip(open) {
        material.is_open = is_open == Some(true);
    }
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
    use super::super::edit::Edit;
    use super::super::{MeshTriangle, Scene};
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
            open_materials(&[Material::default(), glass.clone()], meshes)[1] == Some(true)
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
        assert_eq!(open_materials(std::slice::from_ref(&glass), &[]), [None]);
        // A pane with a back of its own encloses nothing, a sheet of a millimetre does.
        let front = body[0];
        let back = [front[0], front[3], front[2], front[1]];
        assert!(is_open(&glass, &[mesh(&[front, back], 1)]));
        assert!(!is_open(&glass, &[mesh(&faces([1.0, 1.0, 1e-3]), 1)]));
        // The greater part decides.
        assert!(!is_open(&glass, &[mesh(&body, 1), mesh(&apart[1..2], 1)]));
        assert!(is_open(
            &glass,
            &[mesh(&body, 1), mesh(&apart, 1), mesh(&apart, 1)]
        ));
        // A body that gets a material of its own is solid at once, and open again with the others.
        let mut scene = Scene {
            materials: vec![glass],
            meshes: vec![mesh(&apart, 0), mesh(&apart, 0), mesh(&body, 0)],
            ..Scene::default()
        };
        find_open(&mut scene.materials, &scene.meshes);
        let own = Edit::OwnMaterial {
            mesh: 2,
            material: 0,
        };
        let back = own.apply(&mut scene).unwrap();
        let is_open =
            |scene: &Scene| -> Vec<bool> { scene.materials.iter().map(|m| m.is_open).collect() };
        assert_eq!(is_open(&scene), [true, false]);
        back.apply(&mut scene).unwrap();
        assert_eq!(is_open(&scene), [true]);
        // Half of a body's faces that become glass, or are no longer, close or open the other half.
        let half = |faces: &[_], material| mesh(faces, material).triangles;
        let mut both = mesh(&body, 0);
        both.triangles = [half(&body[..3], 0), half(&body[..3], 1)].concat();
        for triangle in &mut both.triangles[6..] {
            triangle.vertices = triangle.vertices.map(|vertex| vertex + 12);
        }
        let glass = scene.materials[0].clone();
        scene.materials = vec![Material::default(), glass.clone()];
        scene.meshes = vec![both];
        find_open(&mut scene.materials, &scene.meshes);
        assert_eq!(is_open(&scene), [false, true]);
        let before = scene.clone();
        let to = Box::new(glass);
        let edit = Edit::Material { material: 0, to };
        let back = edit.apply(&mut scene).unwrap();
        assert_eq!(is_open(&scene), [false, false]);
        back.apply(&mut scene).unwrap();
        assert!(scene == before);
    }
}
