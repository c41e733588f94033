//! Handles are dragged and the object goes where it should.

use std::f64::consts::FRAC_PI_2;

use egui::Vec2;
use glam::{DMat3, DQuat, DVec3};

use super::*;
use crate::xr::Fov;
use egui::pos2;

/// An eye far from the origin, half a metre before an object that is turned about y.
fn view() -> View {
    View {
        position_in_world: DVec3::new(1000.0, 2.0, -3000.0),
        orientation: DQuat::from_rotation_y(0.3),
        fov: Fov::from_degrees(-40.0, 50.0, 45.0, -35.0),
    }
}

fn object() -> DAffine3 {
    let in_eye = DVec3::new(0.02, -0.05, -0.5);
    DAffine3::from_scale_rotation_translation(
        DVec3::new(1.0, 2.0, 3.0),
        DQuat::from_rotation_y(0.5),
        view().position_in_world + view().orientation * in_eye,
    )
}

const AREA: Rect = Rect {
    min: pos2(10.0, 20.0),
    max: pos2(610.0, 520.0),
};

/// Where the object stands after a drag from one place of the window to another.
fn dragged(gizmo: &mut TransformGizmo, from: Pos2, to: Pos2) -> DAffine3 {
    let painter = egui::Context::default().debug_painter();
    let pass = |gizmo: &mut TransformGizmo, object, at, pressed| {
        let pointer = Pointer {
            at: Some(at),
            is_over: true,
            pressed,
            is_down: true,
            snaps: false,
        };
        match gizmo.show(&painter, AREA, &view(), object, pointer) {
            Handled::Moved(object) => object,
            other => panic!("{other:?} at {at}"),
        }
    };
    let pressed = pass(gizmo, object(), from, true);
    assert!(pressed.abs_diff_eq(object(), 1e-9), "a press moves nothing");
    // By a way around, which must not matter.
    let middle = pass(gizmo, pressed, from.lerp(to, 0.5), false);
    let moved = pass(gizmo, middle, to, false);
    let released = Pointer::default();
    let idle = gizmo.show(&painter, AREA, &view(), moved, released);
    assert_eq!((idle, gizmo.is_dragging()), (Handled::Idle, false));
    moved
}

fn geometry(gizmo: &TransformGizmo, view: &View) -> Geometry<'static> {
    let view: &'static View = Box::leak(Box::new(*view));
    Geometry::new(view, AREA, gizmo.mode, gizmo.is_local, object()).unwrap()
}

#[test]
fn moves_keep_to_their_line_or_plane_and_end_under_the_pointer() {
    for is_local in [false, true] {
        let mut gizmo = TransformGizmo {
            is_local,
            ..TransformGizmo::default()
        };
        let seen = geometry(&gizmo, &view());
        let mut dragged_handles = 0;
        for handle in HANDLES {
            let outline = seen.outline(handle).unwrap();
            let count = outline.points.len() as f64;
            let middle = outline.points.iter().sum::<DVec3>() / count;
            let from = seen.project(middle).unwrap();
            let to = from + egui::vec2(25.0, 18.0);
            if seen.pick(from) != Some(handle) {
                continue; // Another handle is before it, or it has faded.
            }
            dragged_handles += 1;
            let moved = dragged(&mut gizmo, from, to);
            let way = moved.translation - object().translation;
            assert!(way.length() > 1e-3, "{handle:?}");
            assert_eq!(moved.matrix3, object().matrix3);
            let directions = seen.directions(handle);
            let along: DVec3 = directions.iter().map(|d| *d * d.dot(way)).sum();
            assert!((along - way).length() < 1e-9, "{handle:?}");
            if directions.len() == 2 {
                let grabbed = seen.project(middle + way).unwrap();
                assert!((grabbed - to).length() < 0.1, "{handle:?}: {grabbed} {to}");
            }
        }
        assert!(dragged_handles >= 3, "{dragged_handles}");
        gizmo.snaps = true;
        gizmo.snap_m = 0.025;
        let from = seen.project(seen.point(30.0 * seen.axes[0])).unwrap();
        let moved = dragged(&mut gizmo, from, from + egui::vec2(40.0, 0.0));
        let steps = (moved.translation - object().translation).length() / 0.025;
        assert!(
            steps > 0.5 && (steps - steps.round()).abs() < 1e-6,
            "{steps}"
        );
    }
}

#[test]
fn the_outer_ring_turns_as_far_as_the_pointer_goes_round() {
    let mut gizmo = TransformGizmo {
        mode: Mode::Turn,
        ..TransformGizmo::default()
    };
    let seen = geometry(&gizmo, &view());
    let middle = seen.project(seen.place).unwrap();
    let [right, up] = [(1.0, 0.0), (0.0, -1.0)].map(|(x, y)| middle + 68.9 * Vec2::new(x, y));
    // A quarter against the clock.
    let moved = dragged(&mut gizmo, right, up);
    let turn = moved.matrix3 * object().matrix3.inverse();
    let wanted = DMat3::from_axis_angle(view().orientation * DVec3::Z, FRAC_PI_2);
    assert!(turn.abs_diff_eq(wanted, 1e-3), "{turn} {wanted}");
    assert_eq!(moved.translation, object().translation);
}

#[test]
fn rings_turn_about_their_axes_in_steps_of_a_32nd() {
    let mut gizmo = TransformGizmo {
        mode: Mode::Turn,
        is_local: true,
        snaps: true,
        ..TransformGizmo::default()
    };
    let seen = geometry(&gizmo, &view());
    let mut turned = 0;
    for axis in 0..3 {
        let ring = seen.outline(Handle::Axis(axis)).unwrap().points;
        let [from, to] = [ring[32], ring[44]].map(|point| seen.project(point).unwrap());
        if seen.pick(from) != Some(Handle::Axis(axis)) {
            continue;
        }
        turned += 1;
        let moved = dragged(&mut gizmo, from, to);
        let turn = DQuat::from_mat3(&(moved.matrix3 * object().matrix3.inverse()));
        let (about, angle) = turn.to_axis_angle();
        assert!(about.dot(seen.axes[axis]) > 1.0 - 1e-9, "{axis}: {about}");
        let steps = angle / SNAP_RAD;
        assert!(
            steps > 0.5 && (steps - steps.round()).abs() < 1e-6,
            "{steps}"
        );
    }
    assert!(turned >= 2, "{turned} rings");
}

#[test]
fn boxes_scale_by_the_ratio_of_distances() {
    let mut gizmo = TransformGizmo {
        mode: Mode::Scale,
        is_local: true,
        ..TransformGizmo::default()
    };
    let seen = geometry(&gizmo, &view());
    let middle = seen.project(seen.place).unwrap();
    let from = seen.project(seen.point(50.0 * seen.axes[1])).unwrap();
    assert_eq!(seen.pick(from), Some(Handle::Axis(1)));
    let moved = dragged(&mut gizmo, from, middle + 1.5 * (from - middle));
    let (scale, _, _) = moved.to_scale_rotation_translation();
    assert!(
        (scale - DVec3::new(1.0, 3.0, 3.0)).length() < 1e-4,
        "{scale}"
    );
    // The ring around everything scales all axes.
    let ring = middle + Vec2::new(48.8, 48.8);
    let moved = dragged(&mut gizmo, ring, middle + 0.5 * (ring - middle));
    let (scale, ..) = moved.to_scale_rotation_translation();
    assert!(
        (scale - DVec3::new(0.5, 1.0, 1.5)).length() < 1e-4,
        "{scale}"
    );
    // Along the world's axes a turned object is not sheared.
    gizmo.is_local = false;
    let moved = dragged(&mut gizmo, from, middle + 1.5 * (from - middle));
    let (scale, rotation, _) = moved.to_scale_rotation_translation();
    assert!(
        (scale - DVec3::new(1.0, 3.0, 3.0)).length() < 1e-4,
        "{scale}"
    );
    assert!(rotation.angle_between(DQuat::from_rotation_y(0.5)) < 1e-6);
}
