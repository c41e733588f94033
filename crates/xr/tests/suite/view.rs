//! Projection and rays of one eye: closed forms, then inverse to each other everywhere.

#![allow(clippy::unwrap_used)]

use glam::{DAffine3, DMat4, DQuat, DVec3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::f64::consts::{FRAC_PI_2, PI};
use stereolux_xr::view::NEAR_M;
use stereolux_xr::{Fov, Headset, Pose, View};

fn view(position: DVec3, orientation: DQuat, fov: Fov) -> View {
    View {
        position_in_world: position,
        orientation,
        fov,
    }
}

fn straight(fov: Fov) -> View {
    view(DVec3::ZERO, DQuat::IDENTITY, fov)
}

/// Pixel error that rounding alone may cause when a point at depth `depth_m` on a ray with tangents up to
/// `tangent` is stored in world coordinates of magnitude `far_m`: half an ulp of each of three coordinates
/// (together under 1.74 x 2^-53 far), seen from depth_m, moves a tangent by (1 + tangent) of that over
/// depth; some ten f64 operations on the way add 1e-14 relative. The result is scaled to pixels.
fn pixel_tolerance(view: &View, far_m: f64, depth_m: f64, size: u32) -> f64 {
    let t = view.fov.tangents();
    let tangent = [t.left, t.right, t.up, t.down]
        .into_iter()
        .fold(0.0_f64, |m, t| m.max(t.abs()));
    let stored = 1.74 * far_m * 2.0_f64.powi(-53) / depth_m;
    let tangent_error = (1.0 + tangent) * stored + 1e-14 * (1.0 + tangent * tangent);
    // 2: the subtraction h - e rounds as the sum did.
    2.0 * tangent_error * f64::from(size) / (t.right - t.left).min(t.up - t.down)
}

#[test]
fn pixels_in_closed_form() {
    let view = straight(Fov::from_degrees(-45.0, 45.0, 45.0, -45.0));
    let at = |x: f64, y: f64, z: f64| view.pixel_from_point_in_world(DVec3::new(x, y, z), 100, 80);
    let near = |a: Option<(f64, f64)>, b: (f64, f64)| {
        // tan(45 degrees) is 1 to one ulp: errors of 1e-16 of 100 pixels.
        a.is_some_and(|a| (a.0 - b.0).abs() < 1e-12 && (a.1 - b.1).abs() < 1e-12)
    };
    assert!(near(at(0.0, 0.0, -2.0), (50.0, 40.0)));
    assert!(near(at(1.0, 0.0, -2.0), (75.0, 40.0)));
    assert!(
        near(at(0.0, 1.0, -2.0), (50.0, 20.0)),
        "up is towards row 0"
    );
    assert!(!near(at(0.0, 1.0, -2.0), (50.0, 60.0)));
}

#[test]
fn the_image_is_half_open_and_nothing_behind_is_seen() {
    // Tangents that are exact in binary: left -1, right 1, up 1, down -1 would need atan; use a view whose
    // borders are tested through its own tangents instead.
    let view = straight(Fov::from_degrees(-50.0, 40.0, 30.0, -20.0));
    let t = view.fov.tangents();
    let at = |x: f64, y: f64, z: f64| view.pixel_from_point_in_world(DVec3::new(x, y, z), 64, 64);
    assert_eq!(at(t.left, 0.0, -1.0).unwrap().0, 0.0);
    assert_eq!(at(0.0, t.up, -1.0).unwrap().1, 0.0);
    assert!(at(t.right, 0.0, -1.0).is_none());
    assert!(at(0.0, t.down, -1.0).is_none());
    assert!(at(t.left.next_down(), 0.0, -1.0).is_none());
    assert!(at(0.0, t.up.next_up(), -1.0).is_none());
    assert!(at(0.0, 0.0, 1.0).is_none());
    assert!(at(0.0, 0.0, 0.0).is_none());
    assert!(at(0.0, 0.0, -NEAR_M).is_none());
    assert!(at(0.0, 0.0, -1.01 * NEAR_M).is_some());
    assert!(at(f64::NAN, 0.0, -1.0).is_none());
    assert!(at(0.0, 0.0, f64::NEG_INFINITY).is_none_or(|(x, _)| x.is_finite()));
}

#[test]
fn rolled_eyes() {
    let fov = Fov::from_degrees(-45.0, 45.0, 45.0, -45.0);
    // Rolled by +90 degrees about +Z, the eye's right is the world's up: a point above shows on the right.
    let rolled = view(DVec3::ZERO, DQuat::from_rotation_z(FRAC_PI_2), fov);
    let above = DVec3::new(0.0, 1.0, -2.0);
    let (x, y) = rolled.pixel_from_point_in_world(above, 100, 100).unwrap();
    assert!(
        (x - 75.0).abs() < 1e-12 && (y - 50.0).abs() < 1e-12,
        "{x} {y}"
    );
    let upside_down = view(DVec3::ZERO, DQuat::from_rotation_z(PI), fov);
    let (x, y) = upside_down
        .pixel_from_point_in_world(above, 100, 100)
        .unwrap();
    assert!(
        (x - 50.0).abs() < 1e-12 && (y - 75.0).abs() < 1e-12,
        "{x} {y}"
    );
}

#[test]
fn canted_eyes_look_outwards() {
    let index = Headset::load("index").unwrap();
    let [left, right] = index.views_from_head(&Pose::IDENTITY);
    let forward = |view: &View| view.orientation * DVec3::NEG_Z;
    let sin5 = 5.0_f64.to_radians().sin();
    assert!((forward(&left).x + sin5).abs() < 1e-15);
    assert!((forward(&right).x - sin5).abs() < 1e-15);
    assert!(left.position_in_world.x < right.position_in_world.x);
}

#[test]
fn rigid_inverse_undoes_the_pose() {
    let turned = DQuat::from_euler(glam::EulerRot::YXZ, 1.0, -0.7, 2.9);
    let view = view(
        DVec3::new(1e6, -2e5, 3e5),
        turned,
        Fov::from_degrees(-40.0, 50.0, 30.0, -60.0),
    );
    let identity = view.eye_from_world() * view.world_from_eye();
    // Coordinates up to 1.1e6, three products summed: 6 x 1.1e6 x 2^-53 < 1e-9 m.
    assert!(
        identity.abs_diff_eq(DAffine3::IDENTITY, 1e-9),
        "{identity:?}"
    );
    let control = view.world_from_eye() * view.world_from_eye();
    assert!(!control.abs_diff_eq(DAffine3::IDENTITY, 1e-9));
    let point = DVec3::new(1e6 + 3.0, -2e5, 3e5 - 7.0);
    let by_matrix = view.eye_from_world().transform_point3(point);
    assert!(by_matrix.distance(view.point_in_eye(point)) < 1e-9);
}

#[test]
fn clip_space_agrees_with_pixels() {
    let view = view(
        DVec3::new(0.3, 1.6, -2.0),
        DQuat::from_euler(glam::EulerRot::YXZ, 0.4, -0.2, 0.1),
        Fov::from_degrees(-54.0, 40.0, 43.98, -54.27),
    );
    let (width, height) = (200, 300);
    let ray = view.ray_through_pixel(31.25, 220.5, width, height);
    let point = ray.origin + 3.0 * ray.direction;
    let clip_from_world = view.clip_from_eye(0.1) * DMat4::from(view.eye_from_world());
    let clip = clip_from_world * point.extend(1.0);
    let x = (clip.x / clip.w * 0.5 + 0.5) * 200.0;
    let y = (0.5 - clip.y / clip.w * 0.5) * 300.0;
    // A few dozen f64 operations on numbers below 300.
    assert!(
        (x - 31.25).abs() < 1e-11 && (y - 220.5).abs() < 1e-11,
        "{x} {y}"
    );
    let depth = |z: f64| {
        let clip = view.clip_from_eye(0.1) * glam::DVec4::new(0.0, 0.0, z, 1.0);
        clip.z / clip.w
    };
    assert_eq!(depth(-0.1), 1.0);
    assert!(depth(-1.0) < 1.0 && depth(-1.0) > depth(-2.0) && depth(-1e9) > 0.0);
}

#[test]
fn heading_survives_steep_gazes() {
    let heading = |yaw: f64, pitch: f64, roll: f64| {
        let orientation = DQuat::from_euler(glam::EulerRot::YXZ, yaw, pitch, roll);
        Pose::new(DVec3::ZERO, orientation).heading_rad()
    };
    for yaw in [-3.0, -1.0, 0.0, 0.5, 2.0] {
        for pitch in [-FRAC_PI_2, -1.5, 0.0, 0.7, FRAC_PI_2] {
            // Error of the trigonometry over cos(pitch), at most 1e-16 / 0.07, or at the pole 1e-16.
            assert!(
                (heading(yaw, pitch, 0.0) - yaw).abs() < 1e-13,
                "{yaw} {pitch}"
            );
        }
    }
    assert!(
        (heading(0.5, 0.2, 1.0) - 0.5).abs() < 1e-13,
        "roll does not turn the heading"
    );
}

prop_compose! {
    /// Any fov whose edges are at least half a degree apart, up to +-89 degrees, asymmetric.
    fn any_fov()(a in -89.0..88.4_f64, b in 0.5..178.0_f64, c in -89.0..88.4_f64, d in 0.5..178.0_f64) -> Fov {
        Fov::from_degrees(a, (a + b).min(89.0), (c + d).min(89.0), c)
    }
}

fn special_fov() -> impl Strategy<Value = Fov> {
    prop_oneof![
        4 => any_fov(),
        1 => Just(Fov::from_degrees(-85.0, 85.0, 85.0, -85.0)),
        1 => Just(Fov::from_degrees(-0.5, 0.5, 0.5, -0.5)),
        1 => Just(Fov::from_degrees(-54.0, 40.0, 43.98, -54.27)),
    ]
}

prop_compose! {
    fn any_orientation()(x in -1.0..1.0_f64, y in -1.0..1.0_f64, z in -1.0..1.0_f64, w in 0.01..1.0_f64) -> DQuat {
        DQuat::from_xyzw(x, y, z, w).normalize()
    }
}

fn special_orientation() -> impl Strategy<Value = DQuat> {
    prop_oneof![
        4 => any_orientation(),
        1 => Just(DQuat::from_rotation_z(FRAC_PI_2)),
        1 => Just(DQuat::from_rotation_z(PI)),
        1 => Just(DQuat::from_rotation_y(5.0_f64.to_radians())),
    ]
}

fn position() -> impl Strategy<Value = DVec3> {
    prop_oneof![Just(1.0), Just(1e3), Just(1e6)].prop_flat_map(|scale: f64| {
        [-scale..scale, -scale..scale, -scale..scale].prop_map(DVec3::from_array)
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, rng_seed: RngSeed::Fixed(1),
        failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn rays_and_pixels_are_inverse(
        fov in special_fov(),
        orientation in special_orientation(),
        position in position(),
        // Off the border by more than the tolerance ever is.
        u in 0.001..0.999_f64,
        v in 0.001..0.999_f64,
        depth_m in 0.1..1000.0_f64,
    ) {
        let view = view(position, orientation, fov);
        let size = 512;
        let (x, y) = (u * 512.0, v * 512.0);
        let point = position + orientation * (depth_m * view.direction_in_eye(x, y, size, size));
        let far_m = point.abs().max_element().max(position.abs().max_element());
        let tolerance = pixel_tolerance(&view, far_m, depth_m, size);
        prop_assert!(tolerance < 0.5, "the tolerance would accept anything: {tolerance}");
        let found = view.pixel_from_point_in_world(point, size, size);
        prop_assert!(found.is_some());
        let (fx, fy) = found.unwrap();
        prop_assert!((fx - x).abs() <= tolerance && (fy - y).abs() <= tolerance,
            "({fx}, {fy}) is not ({x}, {y}) within {tolerance}");
        // The control: a neighbouring ray does not pass.
        let other = position + orientation * (depth_m * view.direction_in_eye(x + 0.51, y, size, size));
        if let Some((ox, _)) = view.pixel_from_point_in_world(other, size, size) {
            prop_assert!((ox - x).abs() > tolerance);
        }
        // The unit ray goes through the same point.
        let ray = view.ray_through_pixel(x, y, size, size);
        prop_assert!((ray.direction.length() - 1.0).abs() < 1e-14);
        let along = (point - position).dot(ray.direction);
        let miss_m = (position + along * ray.direction).distance(point);
        prop_assert!(miss_m <= 1e-15 * (20.0 * (far_m + along)), "{miss_m}");
    }

    #[test]
    fn points_behind_are_never_seen(
        fov in special_fov(),
        orientation in special_orientation(),
        position in position(),
        x in -9.0..9.0_f64, y in -9.0..9.0_f64, z in 0.0..9.0_f64,
    ) {
        let view = view(position, orientation, fov);
        // 1 mm behind at least: a million metres out, a point is placed to 1e-9 m.
        let point = position + orientation * DVec3::new(x, y, z + 1e-3);
        prop_assert_eq!(view.pixel_from_point_in_world(point, 64, 64), None);
    }
}
