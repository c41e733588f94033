//! Tangents for meshes that come without, and repairs of normals.
//!
//! The tangent of a vertex is the mean of dP/du over its triangles, each projected into the vertex's tangent plane,
//! brought to unit length and weighted by the corner's angle; the handedness says whether the texture is mirrored. This
//! is the rule of MikkTSpace (Mikkelsen, *Simulation of Wrinkled Surfaces Revisited*, 2008, section 3): vertices of one
//! position, normal and texture coordinate are one, however the file splits them, but for mirrored and unmirrored triangles.

use std::collections::HashMap;

use glam::{DVec2, DVec3};

use super::super::as_dvec3;

/// Any unit vector perpendicular to a unit normal, with handedness 1: the filler where no tangent is asked for.
pub fn any_tangent(normal: [f32; 3]) -> [f32; 4] {
    let tangent = as_dvec3(normal).any_orthonormal_vector();
    tangent.as_vec3().extend(1.0).to_array()
}

/// Unit normal from the area-weighted triangles around each vertex, for vertices whose own normal has no length.
pub fn normals_from_triangles(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|vertex| as_dvec3(positions[vertex as usize]));
        let doubled_area = (b - a).cross(c - a);
        for vertex in triangle {
            sums[*vertex as usize] += doubled_area;
        }
    }
    sums.into_iter()
        .map(|sum| sum.normalize_or(DVec3::Y))
        .collect()
}

/// Which way a triangle's texture lies: whether (u, v) runs against the winding. Zero-area charts count as unmirrored.
pub fn is_mirrored(uv: [[f32; 2]; 3]) -> bool {
    let [a, b, c] = uv.map(|uv| DVec2::new(f64::from(uv[0]), f64::from(uv[1])));
    // v points down the image, so an unmirrored chart runs clockwise in (u, v): negative area.
    (b - a).perp_dot(c - a) > 0.0
}

/// Derives tangents (see the module's text). Every vertex must lie in charts of one orientation only.
pub fn derive(
    positions: &[[f32; 3]],
    normals: &[[f32; 3]],
    uv: &[[f32; 2]],
    triangles: &[[u32; 3]],
) -> Vec<[f32; 4]> {
    let mut handedness = vec![1.0_f32; positions.len()];
    for triangle in triangles {
        let is_mirrored = is_mirrored(triangle.map(|vertex| uv[vertex as usize]));
        for vertex in triangle {
            handedness[*vertex as usize] = if is_mirrored { -1.0 } else { 1.0 };
        }
    }
    let mut first_of = HashMap::new();
    let first: Vec<usize> = (0..positions.len())
        .map(|vertex| {
            let bits = |values: &[f32]| {
                values.iter().fold([0; 3], |bits, x| {
                    let [_, a, b] = bits;
                    [a, b, (x + 0.0).to_bits()]
                })
            };
            let key = (
                bits(&positions[vertex]),
                bits(&normals[vertex]),
                bits(&uv[vertex]),
                handedness[vertex] < 0.0,
            );
            *first_of.entry(key).or_insert(vertex)
        })
        .collect();
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for triangle in triangles {
        let corners = triangle.map(|vertex| as_dvec3(positions[vertex as usize]));
        let charts = triangle.map(|vertex| uv[vertex as usize]);
        let [a, b, c] = charts.map(|uv| DVec2::new(f64::from(uv[0]), f64::from(uv[1])));
        let (edge_1, edge_2) = (corners[1] - corners[0], corners[2] - corners[0]);
        let (chart_1, chart_2) = (b - a, c - a);
        let area = chart_1.perp_dot(chart_2);
        if area == 0.0 {
            continue;
        }
        // dP/du up to a positive factor; only its direction counts.
        let along_u = (edge_1 * chart_2.y - edge_2 * chart_1.y) * area.signum();
        for corner in 0..3 {
            let vertex = triangle[corner] as usize;
            let normal = as_dvec3(normals[vertex]);
            let projected = (along_u - normal * along_u.dot(normal)).normalize_or_zero();
            let (next, previous) = (
                corners[(corner + 1) % 3] - corners[corner],
                corners[(corner + 2) % 3] - corners[corner],
            );
            let angle = next.cross(previous).length().atan2(next.dot(previous));
            sums[first[vertex]] += projected * angle;
        }
    }
    first
        .iter()
        .zip(normals)
        .zip(handedness)
        .map(
            |((first, normal), handedness)| match sums[*first].try_normalize() {
                Some(tangent) => tangent.as_vec3().extend(handedness).to_array(),
                None => any_tangent(*normal),
            },
        )
        .collect()
}
