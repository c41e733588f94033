//! The meshes that hands and controllers are put together from, each a solid of revolution or a triangle.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::{DAffine3, DMat3, DVec2, DVec3};

use crate::scene::Mesh;

/// Corners of a circle.
const AROUND: u32 = 32;

/// A corner of a profile: distance from the axis and place along it, and the normal there, likewise.
type Corner = (DVec2, DVec2);

/// A mesh in the making: corners and the normals there, and what triangles lie between them.
#[derive(Default)]
pub(super) struct Solid {
    corners: Vec<[DVec3; 2]>,
    triangles: Vec<[u32; 3]>,
}

/// Radius 1 about the origin.
pub(super) fn ball() -> Solid {
    turned(&[arc(DVec2::ZERO, 1.0, -FRAC_PI_2, FRAC_PI_2)])
}

/// Radius 1 about Z from 0 to 1, open at both ends: what it joins closes it.
pub(super) fn tube() -> Solid {
    let normal = DVec2::X;
    turned(&[vec![(DVec2::X, normal), (DVec2::new(1.0, 1.0), normal)]])
}

/// The half of the ball where Z is positive, open.
pub(super) fn half() -> Solid {
    turned(&[arc(DVec2::ZERO, 1.0, 0.0, FRAC_PI_2)])
}

/// The origin, X and Y.
pub(super) fn triangle() -> Solid {
    Solid {
        corners: [DVec3::ZERO, DVec3::X, DVec3::Y]
            .map(|at| [at, DVec3::Z])
            .into(),
        triangles: vec![[0, 1, 2]],
    }
}

/// What the fingers close around: along Z, thumb at -Z.
pub(super) fn handle() -> Solid {
    const ROUND_M: f64 = 0.006;
    // Butt, waist, and the end that the head sits on: place along Z and radius, metres.
    let rings = [
        (0.07, 0.0165),
        (0.03, 0.0155),
        (-0.02, 0.0165),
        (-0.045, 0.018),
    ];
    let mut profile = vec![];
    let [(butt_m, wide_m), .., (top_m, top_radius_m)] = rings;
    let bow = |x: f64, y: f64, from: f64, to: f64| arc(DVec2::new(x, y), ROUND_M, from, to);
    profile.push((DVec2::new(0.0, butt_m + ROUND_M), DVec2::Y));
    profile.extend(bow(wide_m - ROUND_M, butt_m, FRAC_PI_2, 0.0));
    profile.extend(rings.map(|(z_m, radius_m)| (DVec2::new(radius_m, z_m), DVec2::X)));
    profile.extend(bow(top_radius_m - ROUND_M, top_m, 0.0, -FRAC_PI_2));
    profile.push((DVec2::new(0.0, top_m - ROUND_M), DVec2::NEG_Y));
    turned(&[profile])
}

/// What sits on the handle: a disc with a stick, a trigger below, and a ring before it. It points along -Z, its top is +Y.
pub(super) fn head() -> Solid {
    const DISC_M: [f64; 2] = [0.023, 0.011];
    const RING_M: [f64; 2] = [0.042, 0.0055];
    // Their axes point up.
    let upright = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
    let at = |x: f64, y: f64, z: f64| DAffine3::from_mat3_translation(upright, DVec3::new(x, y, z));
    let mut head = Solid::default();
    let [radius_m, half_m] = DISC_M;
    let edge = |from, to| arc(DVec2::new(radius_m - half_m, 0.0), half_m, from, to);
    let mut disc = vec![(DVec2::new(0.0, -half_m), DVec2::NEG_Y)];
    disc.extend(edge(-FRAC_PI_2, FRAC_PI_2));
    disc.push((DVec2::new(0.0, half_m), DVec2::Y));
    head.add(&at(0.0, 0.0, 0.0), &turned(&[disc]));
    // A stick: a stem under a cap.
    let stem = vec![
        (DVec2::new(0.004, 0.0), DVec2::X),
        (DVec2::new(0.004, 0.018), DVec2::X),
    ];
    let cap = arc(DVec2::ZERO, 1.0, -FRAC_PI_2, FRAC_PI_2);
    let cap = cap.into_iter().map(|(corner, normal)| {
        let size = DVec2::new(0.0085, 0.0035);
        (
            corner * size + DVec2::Y * 0.0185,
            (normal / size).normalize(),
        )
    });
    head.add(&at(0.0, 0.0, 0.0), &turned(&[stem, cap.collect()]));
    let [radius_m, half_m] = RING_M;
    let ring = arc(DVec2::new(radius_m, 0.0), half_m, -PI, PI);
    // Its rear is in the disc.
    head.add(&at(0.0, 0.0, -radius_m - 0.006), &turned(&[ring]));
    let trigger = DAffine3::from_scale_rotation_translation(
        DVec3::new(0.007, 0.014, 0.009),
        glam::DQuat::from_rotation_x(0.5),
        DVec3::new(0.0, -0.014, -0.014),
    );
    head.add(&trigger, &ball());
    head
}

/// Corners of an arc about `middle`, from one angle to another, 0 away from the axis.
fn arc(middle: DVec2, radius: f64, from_rad: f64, to_rad: f64) -> Vec<Corner> {
    let count = (f64::from(AROUND) * (to_rad - from_rad).abs() / TAU).ceil() as u32;
    let corner = |step: u32| {
        let share = f64::from(step) / f64::from(count);
        let normal = DVec2::from_angle(from_rad + share * (to_rad - from_rad));
        (middle + radius * normal, normal)
    };
    (0..=count).map(corner).collect()
}

/// Profiles turned about Z.
fn turned(profiles: &[Vec<Corner>]) -> Solid {
    let mut solid = Solid::default();
    for profile in profiles {
        let first = solid.corners.len() as u32;
        for (corner, normal) in profile {
            for step in 0..=AROUND {
                // The last is where the first is, to the bit.
                let turn = DVec2::from_angle(TAU * f64::from(step % AROUND) / f64::from(AROUND));
                let corner = (turn * corner.x.max(0.0)).extend(corner.y);
                solid
                    .corners
                    .push([corner, (turn * normal.x).extend(normal.y)]);
            }
        }
        let row = AROUND + 1;
        for ring in 0..profile.len() as u32 - 1 {
            for step in 0..AROUND {
                let at = first + ring * row + step;
                solid.face([at, at + 1, at + row + 1]);
                solid.face([at, at + row + 1, at + row]);
            }
        }
    }
    solid
}

impl Solid {
    /// Adds another one.
    fn add(&mut self, to: &DAffine3, other: &Self) {
        let first = self.corners.len() as u32;
        let normals_to = to.matrix3.inverse().transpose();
        let moved = other.corners.iter().map(|&[corner, normal]| {
            [
                to.transform_point3(corner),
                (normals_to * normal).normalize(),
            ]
        });
        self.corners.extend(moved);
        for triangle in &other.triangles {
            self.face(triangle.map(|corner| corner + first));
        }
    }

    /// Adds a triangle, its front where its normals point; none where it has no area.
    fn face(&mut self, [a, b, c]: [u32; 3]) {
        let corners = [a, b, c].map(|corner| self.corners[corner as usize]);
        let [at_a, at_b, at_c] = corners.map(|[at, _]| at);
        let normal: DVec3 = corners.iter().map(|[_, normal]| normal).sum();
        let front = (at_b - at_a).cross(at_c - at_a);
        if front != DVec3::ZERO {
            let is_back = front.dot(normal) < 0.0;
            self.triangles
                .push(if is_back { [a, c, b] } else { [a, b, c] });
        }
    }

    /// Of one material.
    pub(super) fn mesh(self, material: u32) -> Mesh {
        let of = |which: usize| {
            self.corners
                .iter()
                .map(move |corner| corner[which].as_vec3().into())
        };
        Mesh::plain(of(0).collect(), of(1).collect(), self.triangles, material)
    }
}
