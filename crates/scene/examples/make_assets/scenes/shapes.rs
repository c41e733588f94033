//! Parametric surfaces that the embedded scenes are made of. All lengths in metres.

use std::collections::HashMap;
use std::f64::consts::{PI, TAU};

use glam::{DAffine3, DVec2, DVec3};

use super::glb_writer::Part;

/// A triangle mesh under construction. Front sides are counter-clockwise.
#[derive(Clone, Debug, Default)]
pub struct Shape {
    pub positions: Vec<DVec3>,
    pub normals: Vec<DVec3>,
    pub uvs: Vec<DVec2>,
    pub triangles: Vec<[u32; 3]>,
}

impl Shape {
    /// Two triangles over a corner and two edges; the front looks along `edge_u x edge_v`. uv runs from (0, 1) at the
    /// corner to (1, 0) opposite, so that a picture stands upright with `edge_u` to the right and `edge_v` up.
    pub fn quad(corner: impl Into<DVec3>, edge_u: DVec3, edge_v: DVec3) -> Self {
        let corner = corner.into();
        let normal = edge_u.cross(edge_v).normalize_or(DVec3::Y);
        Self {
            positions: vec![
                corner,
                corner + edge_u,
                corner + edge_u + edge_v,
                corner + edge_v,
            ],
            normals: vec![normal; 4],
            uvs: vec![
                DVec2::new(0.0, 1.0),
                DVec2::new(1.0, 1.0),
                DVec2::new(1.0, 0.0),
                DVec2::new(0.0, 0.0),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    /// A flat quadrangle with its front towards `towards`.
    pub fn quadrangle_facing(corners: [DVec3; 4], towards: DVec3) -> Self {
        let [a, b, c, d] = corners;
        let normal = (b - a).cross(d - a).normalize_or(DVec3::Y);
        let middle = (a + b + c + d) / 4.0;
        let faces = normal.dot(towards - middle) > 0.0;
        Self {
            positions: if faces {
                vec![a, b, c, d]
            } else {
                vec![a, d, c, b]
            },
            normals: vec![if faces { normal } else { -normal }; 4],
            uvs: Vec::new(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    /// An axis-aligned box with edges cut at 45 degrees, `bevel` wide (0 for sharp edges).
    pub fn beveled_box(min: impl Into<DVec3>, max: impl Into<DVec3>, bevel: f64) -> Self {
        let (min, max) = (min.into(), max.into());
        let mut shape = Self::default();
        let (center, half) = ((min + max) / 2.0, (max - min) / 2.0);
        let inner = half - DVec3::splat(bevel);
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        for (axis, u_axis, v_axis) in [(0, 1, 2), (1, 2, 0), (2, 0, 1)] {
            for sign in [-1.0, 1.0] {
                let normal = axes[axis] * sign;
                let (u, v) = (
                    axes[u_axis] * sign * inner[u_axis],
                    axes[v_axis] * inner[v_axis],
                );
                let corner = center + normal * half[axis] - u - v;
                shape.append(Self::quad(corner, 2.0 * u, 2.0 * v));
                if bevel > 0.0 {
                    // The bevels along +u and -u of this face's next axis: each of the twelve edges once.
                    for side in [-1.0, 1.0] {
                        let along = axes[u_axis] * side;
                        let near = center + normal * half[axis] + along * inner[u_axis];
                        let far = center + normal * inner[axis] + along * half[u_axis];
                        let w = axes[v_axis] * inner[v_axis];
                        shape.append(Self::quadrangle_facing(
                            [near - w, near + w, far + w, far - w],
                            near + far - center + (normal + along) * 100.0,
                        ));
                    }
                }
            }
        }
        if bevel > 0.0 {
            for corner in 0..8 {
                let s = DVec3::new(
                    sign_of(corner & 1),
                    sign_of(corner & 2),
                    sign_of(corner & 4),
                );
                let points = [0, 1, 2].map(|axis| {
                    let mut point = inner * s;
                    point[axis] = half[axis] * s[axis];
                    center + point
                });
                let is_outward = (points[1] - points[0]).cross(points[2] - points[0]).dot(s) > 0.0;
                let base = shape.positions.len() as u32;
                shape.positions.extend(points);
                shape.normals.extend([s.normalize(); 3]);
                shape.triangles.push(if is_outward {
                    [base, base + 1, base + 2]
                } else {
                    [base, base + 2, base + 1]
                });
            }
        }
        shape
    }

    /// A grid over `columns x rows` cells of a parametric surface; the front looks along dP/du x dP/dv. Normals are
    /// taken from the surface by central differences.
    pub fn parametric(columns: u32, rows: u32, point: impl Fn(f64, f64) -> DVec3) -> Self {
        const STEP: f64 = 1e-5;
        let mut shape = Self::default();
        for row in 0..=rows {
            for column in 0..=columns {
                let (u, v) = (
                    f64::from(column) / f64::from(columns),
                    f64::from(row) / f64::from(rows),
                );
                let along_u = point(u + STEP, v) - point(u - STEP, v);
                let along_v = point(u, v + STEP) - point(u, v - STEP);
                shape.positions.push(point(u, v));
                shape
                    .normals
                    .push(along_u.cross(along_v).normalize_or(DVec3::Y));
            }
        }
        for row in 0..rows {
            for column in 0..columns {
                let a = row * (columns + 1) + column;
                let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
                shape.triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        shape
    }

    /// A surface of revolution around +Y. `profile` lists (radius, height) from bottom to top; corners sharper than 40
    /// degrees stay sharp. `flute` scales the radius by angle.
    pub fn lathe(profile: &[DVec2], segments: u32, flute: impl Fn(f64) -> f64) -> Self {
        let mut shape = Self::default();
        let direction = |from: DVec2, to: DVec2| (to - from).normalize_or(DVec2::Y);
        for band in 0..profile.len().saturating_sub(1) {
            let (low, high) = (profile[band], profile[band + 1]);
            let along = direction(low, high);
            let blend = |other: DVec2| {
                if along.dot(other) > 0.766 {
                    (along + other).normalize_or(along)
                } else {
                    along
                }
            };
            let along_low = if band > 0 {
                blend(direction(profile[band - 1], low))
            } else {
                along
            };
            let along_high = profile
                .get(band + 2)
                .map_or(along, |next| blend(direction(high, *next)));
            let base = shape.positions.len() as u32;
            for segment in 0..=segments {
                let share = f64::from(segment % segments) / f64::from(segments);
                let angle = TAU * share;
                for (point, along) in [(low, along_low), (high, along_high)] {
                    let place = |angle: f64| {
                        let radius = point.x * flute(angle);
                        DVec3::new(radius * angle.cos(), point.y, -radius * angle.sin())
                    };
                    let around = place(angle + 1e-5) - place(angle - 1e-5);
                    let outward = DVec3::new(angle.cos(), 0.0, -angle.sin());
                    let upward = outward * along.x + DVec3::Y * along.y;
                    let around = around.normalize_or(DVec3::new(-angle.sin(), 0.0, -angle.cos()));
                    shape.positions.push(place(angle));
                    shape
                        .normals
                        .push(around.cross(upward).normalize_or(DVec3::Y));
                }
            }
            for segment in 0..segments {
                let a = base + 2 * segment;
                let (b, c, d) = (a + 2, a + 3, a + 1);
                if low.x > 0.0 {
                    shape.triangles.push([a, b, c]);
                }
                if high.x > 0.0 {
                    shape.triangles.push([a, c, d]);
                }
            }
        }
        shape
    }

    /// An icosahedron subdivided `levels` times (20 x 4^levels triangles) on the sphere, facing outward, smooth.
    pub fn icosphere(radius: f64, levels: u32) -> Self {
        let golden = (1.0 + 5.0_f64.sqrt()) / 2.0;
        let mut points: Vec<DVec3> = Vec::new();
        for (a, b) in [
            (-1.0, golden),
            (1.0, golden),
            (-1.0, -golden),
            (1.0, -golden),
        ] {
            points.extend([
                DVec3::new(a, b, 0.0),
                DVec3::new(0.0, a, b),
                DVec3::new(b, 0.0, a),
            ]);
        }
        points
            .iter_mut()
            .for_each(|point| *point = point.normalize());
        // Neighbours on the icosahedron are the pairs at the least distance.
        let edge = points[1..]
            .iter()
            .map(|point| point.distance(points[0]))
            .fold(f64::INFINITY, f64::min);
        let touches = |a: usize, b: usize| points[a].distance(points[b]) < 1.01 * edge;
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        for a in 0..points.len() {
            for b in a + 1..points.len() {
                for c in b + 1..points.len() {
                    if touches(a, b) && touches(b, c) && touches(a, c) {
                        let is_outward = (points[b] - points[a])
                            .cross(points[c] - points[a])
                            .dot(points[a])
                            > 0.0;
                        let (a, b, c) = (a as u32, b as u32, c as u32);
                        triangles.push(if is_outward { [a, b, c] } else { [a, c, b] });
                    }
                }
            }
        }
        for _ in 0..levels {
            let mut middles: HashMap<(u32, u32), u32> = HashMap::new();
            let mut finer = Vec::with_capacity(triangles.len() * 4);
            for [a, b, c] in triangles {
                let mut middle = |from: u32, to: u32| {
                    *middles
                        .entry((from.min(to), from.max(to)))
                        .or_insert_with(|| {
                            points.push((points[from as usize] + points[to as usize]).normalize());
                            points.len() as u32 - 1
                        })
                };
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            }
            triangles = finer;
        }
        Self {
            positions: points.iter().map(|point| *point * radius).collect(),
            normals: points,
            uvs: Vec::new(),
            triangles,
        }
    }

    /// An upright panel in the plane z = 0, x from `-half_width`, y from 0, front towards +Z, with a round-arched
    /// opening around x = 0, and the opening's reveal `depth` deep towards -Z. uv in metres.
    pub fn arched_panel(panel: &ArchedPanel) -> Self {
        let ArchedPanel {
            half_width,
            height,
            opening_half_width: r,
            sill,
            spring,
            depth,
            segments,
        } = *panel;
        let flat = |x0: f64, x1: f64, y0: f64, y1: f64| {
            Self::quad([x0, y0, 0.0], DVec3::X * (x1 - x0), DVec3::Y * (y1 - y0))
        };
        let mut shape = Self::default();
        let bottom = sill.unwrap_or(spring);
        if half_width > r {
            shape.append(flat(-half_width, -r, 0.0, height));
            shape.append(flat(r, half_width, 0.0, height));
        }
        if sill.is_some_and(|sill| sill > 0.0) {
            shape.append(flat(-r, r, 0.0, bottom));
        }
        let rim = |at: u32| {
            let angle = PI * (1.0 - f64::from(at) / f64::from(segments));
            DVec2::new(r * angle.cos(), spring + r * angle.sin())
        };
        for at in 0..segments {
            let (left, right) = (rim(at), rim(at + 1));
            let base = shape.positions.len() as u32;
            for (x, y) in [
                (left.x, left.y),
                (right.x, right.y),
                (right.x, height),
                (left.x, height),
            ] {
                shape.positions.push(DVec3::new(x, y, 0.0));
                shape.normals.push(DVec3::Z);
            }
            shape
                .triangles
                .extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
        }
        // The soffit of the arch looks towards its centre; the jambs and the sill close the opening below.
        let back = DVec3::Z * -depth;
        let mut soffit = Self::default();
        for at in 0..=segments {
            let point = rim(at);
            let inward = (DVec2::new(0.0, spring) - point) / r;
            let front = point.extend(0.0);
            soffit.positions.extend([front, front + back]);
            soffit.normals.extend([inward.extend(0.0); 2]);
        }
        for at in 0..segments {
            let a = 2 * at;
            soffit
                .triangles
                .extend([[a, a + 1, a + 3], [a, a + 3, a + 2]]);
        }
        shape.append(soffit);
        if let Some(sill) = sill {
            let rise = DVec3::Y * (spring - sill);
            shape.append(Self::quad([-r, sill, 0.0], back, rise));
            shape.append(Self::quad(DVec3::new(r, sill, 0.0) + back, -back, rise));
            if sill > 0.0 {
                shape.append(Self::quad([-r, sill, 0.0], DVec3::X * 2.0 * r, back));
            }
        }
        shape
    }

    /// Adds another shape's triangles.
    pub fn append(&mut self, other: Self) {
        let base = self.positions.len() as u32;
        self.positions.extend(other.positions);
        self.normals.extend(other.normals);
        self.uvs.extend(other.uvs);
        self.triangles.extend(
            other
                .triangles
                .iter()
                .map(|triangle| triangle.map(|vertex| vertex + base)),
        );
    }

    /// The same shape elsewhere. The transform must not mirror.
    pub fn transformed(mut self, to_from_here: DAffine3) -> Self {
        let normal_matrix = to_from_here.matrix3.inverse().transpose();
        self.positions
            .iter_mut()
            .for_each(|point| *point = to_from_here.transform_point3(*point));
        self.normals
            .iter_mut()
            .for_each(|normal| *normal = (normal_matrix * *normal).normalize_or(DVec3::Y));
        self
    }

    /// The same surface seen from its other side.
    pub fn inside_out(mut self) -> Self {
        self.triangles
            .iter_mut()
            .for_each(|triangle| triangle.swap(1, 2));
        self.normals
            .iter_mut()
            .for_each(|normal| *normal = -*normal);
        self
    }

    /// Area of all triangles.
    pub fn area_m2(&self) -> f64 {
        self.triangles
            .iter()
            .map(|triangle| {
                let [a, b, c] = triangle.map(|vertex| self.positions[vertex as usize]);
                0.5 * (b - a).cross(c - a).length()
            })
            .sum()
    }

    /// For the writer, with uvs.
    pub fn part(self, material: u32) -> Part {
        Part {
            material,
            positions: self.positions,
            normals: self.normals,
            uvs: self.uvs,
            triangles: self.triangles,
            ..Part::default()
        }
    }

    /// For the writer, without uvs.
    pub fn plain_part(self, material: u32) -> Part {
        Part {
            uvs: Vec::new(),
            ..self.part(material)
        }
    }
}

/// Measures of [`Shape::arched_panel`].
#[derive(Clone, Copy, Debug)]
pub struct ArchedPanel {
    pub half_width: f64,
    pub height: f64,
    pub opening_half_width: f64,
    /// Height of the opening's lower edge; none where the opening ends at the springing line.
    pub sill: Option<f64>,
    /// Height at which the half circle begins.
    pub spring: f64,
    pub depth: f64,
    pub segments: u32,
}

fn sign_of(bit: i32) -> f64 {
    if bit == 0 { -1.0 } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume by the divergence theorem: positive only if closed and facing outward.
    fn volume(shape: &Shape) -> f64 {
        shape
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|vertex| shape.positions[vertex as usize]);
                a.dot(b.cross(c)) / 6.0
            })
            .sum()
    }

    fn assert_normals_agree(shape: &Shape) {
        for triangle in &shape.triangles {
            let [a, b, c] = triangle.map(|vertex| shape.positions[vertex as usize]);
            let geometric = (b - a).cross(c - a);
            for vertex in triangle {
                let normal = shape.normals[*vertex as usize];
                assert!((normal.length() - 1.0).abs() < 1e-9);
                assert!(
                    geometric.dot(normal) > 0.0 || geometric.length() < 1e-12,
                    "{triangle:?}"
                );
            }
        }
    }

    #[test]
    fn beveled_box_is_closed_and_faces_outward() {
        let shape = Shape::beveled_box([1.0, 2.0, 3.0], [3.0, 5.0, 7.0], 0.0);
        assert!((volume(&shape) - 24.0).abs() < 1e-9);
        let bevel = 0.25;
        let shape = Shape::beveled_box(DVec3::splat(-1.0), DVec3::splat(1.0), bevel);
        assert_normals_agree(&shape);
        // Cube less twelve prisms of bevel^2 / 2 over the inner length, and at each corner the cube of the bevel less
        // the tetrahedron that stays (bevel^3 / 6).
        let expected = 8.0
            - 12.0 * bevel * bevel / 2.0 * (2.0 - 2.0 * bevel)
            - 8.0 * bevel.powi(3) * (5.0 / 6.0);
        assert!(
            (volume(&shape) - expected).abs() < 1e-9,
            "{} {expected}",
            volume(&shape)
        );
    }

    #[test]
    fn icosphere_counts_and_faces_outward() {
        let shape = Shape::icosphere(2.0, 3);
        assert_eq!(shape.triangles.len(), 20 * 64);
        assert_eq!(shape.positions.len(), 10 * 64 + 2);
        assert_normals_agree(&shape);
        // Inscribed: below the ball's volume by about 3 % at most.
        let share = volume(&shape) / (4.0 / 3.0 * PI * 8.0);
        assert!((0.97..1.0).contains(&share), "{share}");
    }

    #[test]
    fn lathe_faces_outward() {
        let profile = [
            DVec2::new(0.0, 0.0),
            DVec2::new(1.0, 0.0),
            DVec2::new(1.0, 2.0),
            DVec2::new(0.0, 2.0),
        ];
        let shape = Shape::lathe(&profile, 256, |_| 1.0);
        assert_normals_agree(&shape);
        // A prism over a regular 256-gon: pi less 1e-4 of it.
        assert!(
            (volume(&shape) / (2.0 * PI) - 1.0).abs() < 2e-4,
            "{}",
            volume(&shape)
        );
    }

    #[test]
    fn arched_panel_area_and_facing() {
        let panel = ArchedPanel {
            half_width: 1.0,
            height: 3.0,
            opening_half_width: 0.5,
            sill: Some(1.0),
            spring: 2.0,
            depth: 0.2,
            segments: 64,
        };
        let shape = Shape::arched_panel(&panel);
        assert_normals_agree(&shape);
        let front = 6.0 - (1.0 + PI * 0.125);
        let reveal = 0.2 * (1.0 + 1.0 + 1.0 + PI * 0.5);
        // The arch is a 64-gon's half: its area is short by 1.6e-3 of the half disk, its length by 1e-4.
        assert!(
            (shape.area_m2() - front - reveal).abs() < 2e-3,
            "{} {}",
            shape.area_m2(),
            front + reveal
        );
    }
}
