//! Triangles that are made by formulas.

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use rayon::prelude::*;

/// A mesh with smooth normals, metres, +Y up; triangles counter-clockwise from the front.
#[derive(Default)]
pub struct Surface {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    /// Linear colour by which the material's is multiplied; empty: white.
    pub colors: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
}

impl Surface {
    /// A height field over a square around the origin, `edge_m` wide, in `cells` times `cells` squares of two triangles.
    pub fn height_field(cells: u32, edge_m: f64, height_m: impl Fn(DVec2) -> f64 + Sync) -> Self {
        let side = cells + 1;
        let step = edge_m / f64::from(cells);
        let place = |index: u32| {
            let at = DVec2::new(f64::from(index % side), f64::from(index / side)) * step;
            let at = at - 0.5 * edge_m;
            DVec3::new(at.x, height_m(at), at.y)
        };
        let corners = (0..cells * cells).flat_map(|cell| {
            let a = cell / cells * side + cell % cells;
            let (b, c, d) = (a + 1, a + side, a + side + 1);
            [[a, c, b], [b, c, d]]
        });
        Self {
            positions: (0..side * side).into_par_iter().map(place).collect(),
            triangles: corners.collect(),
            ..Self::default()
        }
        .smoothed()
    }

    /// A surface of revolution around +Y through points (radius, height); going up they are seen from outside. Normals are
    /// those of a smooth profile.
    pub fn lathe(profile: &[DVec2], segments: u32) -> Self {
        let mut surface = Self::default();
        // First vertex and number of each ring: on the axis it is one.
        let mut rings: Vec<[u32; 2]> = Vec::with_capacity(profile.len());
        for (index, point) in profile.iter().enumerate() {
            let before = profile[index.saturating_sub(1)];
            let along =
                (profile[(index + 1).min(profile.len() - 1)] - before).normalize_or(DVec2::Y);
            let count = if point.x > 0.0 { segments } else { 1 };
            rings.push([surface.positions.len() as u32, count]);
            for segment in 0..count {
                let angle = std::f64::consts::TAU * f64::from(segment) / f64::from(segments);
                let around = DVec3::new(angle.cos(), 0.0, -angle.sin());
                let outward = if count == 1 { DVec3::ZERO } else { around };
                surface
                    .positions
                    .push(outward * point.x + DVec3::Y * point.y);
                let normal = outward * along.y - DVec3::Y * along.x;
                surface.normals.push(normal.normalize_or(DVec3::Y));
            }
        }
        for ring in rings.windows(2) {
            for segment in 0..segments {
                let corner = |[first, count]: [u32; 2], segment: u32| first + segment % count;
                let [a, b] = [segment, segment + 1].map(|segment| corner(ring[0], segment));
                let [d, c] = [segment, segment + 1].map(|segment| corner(ring[1], segment));
                if a != b {
                    surface.triangles.push([a, b, c]);
                }
                if c != d {
                    surface.triangles.push([a, c, d]);
                }
            }
        }
        surface
    }

    /// A sphere of radius 1 around the origin: an octahedron whose triangles are divided by four, `levels` times.
    pub fn sphere(levels: u32) -> Self {
        let mut positions = vec![
            DVec3::X,
            DVec3::NEG_X,
            DVec3::Y,
            DVec3::NEG_Y,
            DVec3::Z,
            DVec3::NEG_Z,
        ];
        let mut triangles: Vec<[u32; 3]> = vec![
            [0, 2, 4],
            [2, 1, 4],
            [1, 3, 4],
            [3, 0, 4],
            [2, 0, 5],
            [1, 2, 5],
            [3, 1, 5],
            [0, 3, 5],
        ];
        for _ in 0..levels {
            let mut between = BTreeMap::new();
            let mut middle = |a: u32, b: u32| {
                *between.entry((a.min(b), a.max(b))).or_insert_with(|| {
                    let middle = positions[a as usize] + positions[b as usize];
                    positions.push(middle.normalize());
                    positions.len() as u32 - 1
                })
            };
            let divided = triangles.iter().flat_map(|&[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            });
            triangles = divided.collect();
        }
        Self {
            normals: positions.clone(),
            positions,
            triangles,
            ..Self::default()
        }
    }

    /// A rectangle from a corner along two edges, facing their cross product.
    pub fn rectangle(corner: DVec3, along: DVec3, up: DVec3) -> Self {
        Self {
            positions: vec![corner, corner + along, corner + along + up, corner + up],
            normals: vec![along.cross(up).normalize(); 4],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            ..Self::default()
        }
    }

    /// Moves every vertex, and takes the normals from the triangles around each.
    pub fn displaced(mut self, moved: impl Fn(DVec3) -> DVec3) -> Self {
        self.positions = self.positions.into_iter().map(moved).collect();
        self.smoothed()
    }

    /// With normals that are the mean of the triangles around each vertex, by area.
    fn smoothed(mut self) -> Self {
        self.normals = vec![DVec3::ZERO; self.positions.len()];
        for corners in &self.triangles {
            let [a, b, c] = corners.map(|corner| self.positions[corner as usize]);
            for corner in corners {
                self.normals[*corner as usize] += (b - a).cross(c - a);
            }
        }
        for normal in &mut self.normals {
            *normal = normal.normalize_or(DVec3::Y);
        }
        self
    }

    /// Colours every vertex by its position and normal.
    pub fn colored(mut self, color: impl Fn(DVec3, DVec3) -> DVec3 + Sync) -> Self {
        let vertices = self.positions.par_iter().zip(&self.normals);
        self.colors = vertices
            .map(|(position, normal)| color(*position, *normal))
            .collect();
        self
    }

    /// Both in one.
    pub fn joined(mut self, other: Self) -> Self {
        let first = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.normals.extend(other.normals);
        self.colors.extend(other.colors);
        let triangles = other.triangles.into_iter();
        self.triangles
            .extend(triangles.map(|corners| corners.map(|corner| corner + first)));
        self
    }
}
