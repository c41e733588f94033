//! A drag of a handle: where the object goes, and what is shown of a turn.

use std::f64::consts::{PI, TAU};

use egui::{Color32, Mesh, Painter, Pos2, Shape, Stroke, Vec2};
use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::geometry::Geometry;
use super::{Handle, Mode, OUTER, SIZE, SNAP_RAD, SNAP_SCALE, STROKE};

/// From the press on a handle to its release.
pub(super) struct Drag {
    pub(super) handle: Handle,
    pub(super) mode: Mode,
    pub(super) is_local: bool,
    /// World from object.
    start: DAffine3,
    /// Directions of a move.
    directions: Vec<DVec3>,
    /// Where the handle was grabbed, in the world; on a ring, the direction from its middle.
    grabbed: DVec3,
    /// From the object to the pointer in the window.
    arm: Vec2,
    /// Axis of a turn, and how far it has gone.
    axis: DVec3,
    turned_rad: f64,
    /// The pointer's angle around the object in the last pass.
    last_rad: f64,
}

fn angle(arm: Vec2) -> f64 {
    f64::from(arm.y).atan2(f64::from(arm.x))
}

fn snapped(value: f64, step: Option<f64>) -> f64 {
    step.map_or(value, |step| (value / step).round() * step)
}

impl Drag {
    pub(super) fn new(
        geometry: &Geometry<'_>,
        handle: Handle,
        is_local: bool,
        start: DAffine3,
        at: Pos2,
    ) -> Option<Self> {
        let axis = geometry.ring_axis(handle);
        let directions = geometry.directions(handle);
        let arm = at - geometry.project(geometry.place)?;
        let grabbed = match geometry.mode {
            Mode::Move => {
                let eye = geometry.view.position_in_world;
                eye + geometry.under(at, geometry.place, &directions)?
            }
            Mode::Turn => {
                let u = axis.any_orthonormal_vector();
                let on_ring = geometry.under(at, geometry.place, &[u, axis.cross(u)]);
                on_ring
                    .and_then(|point| (point - geometry.place).try_normalize())
                    .unwrap_or(u)
            }
            Mode::Scale => DVec3::ZERO,
        };
        Some(Self {
            handle,
            mode: geometry.mode,
            is_local,
            start,
            directions,
            grabbed,
            arm,
            axis,
            turned_rad: 0.0,
            last_rad: angle(arm),
        })
    }

    /// The object's place for the pointer `at` (world from object); `None` if the pointer points nowhere.
    pub(super) fn update(
        &mut self,
        geometry: &Geometry<'_>,
        at: Pos2,
        snap_m: Option<f64>,
    ) -> Option<DAffine3> {
        let snaps = snap_m.is_some();
        let mut moved = self.start;
        let arm =
            at - geometry.project(self.start.translation - geometry.view.position_in_world)?;
        match self.mode {
            Mode::Move => {
                let eye = geometry.view.position_in_world;
                let point = eye + geometry.under(at, self.grabbed - eye, &self.directions)?;
                for direction in &self.directions {
                    let way = direction.dot(point - self.grabbed);
                    moved.translation += *direction * snapped(way, snap_m);
                }
            }
            Mode::Turn => {
                // The window's y points down: seen along the axis, angles grow as they do in space.
                let facing = -self.axis.dot(geometry.place).signum();
                let way = (angle(arm) - self.last_rad + PI).rem_euclid(TAU) - PI;
                self.last_rad = angle(arm);
                self.turned_rad -= facing * way;
                let angle = snapped(self.turned_rad, snaps.then_some(SNAP_RAD));
                let turn = DMat3::from_axis_angle(self.axis, angle);
                moved.matrix3 = turn * self.start.matrix3;
            }
            Mode::Scale => {
                let ratio = f64::from(arm.length() / self.arm.length().max(1.0));
                let ratio = snapped(ratio, snaps.then_some(SNAP_SCALE)).max(1e-4);
                moved = self.scaled(ratio);
            }
        }
        Some(moved)
    }

    fn scaled(&self, ratio: f64) -> DAffine3 {
        let along = match self.handle {
            Handle::Axis(axis) => DVec3::AXES[axis],
            Handle::Plane(normal) => (DVec3::ONE - DVec3::AXES[normal]).normalize(),
            Handle::View => DVec3::ONE,
        };
        let factors = DVec3::ONE + along * (ratio - 1.0);
        if self.is_local {
            return self.start * DAffine3::from_scale(factors);
        }
        // Along the world's axes a turned object would be sheared: its own axes take what they get of the lengths.
        let (_, rotation, place) = self.start.to_scale_rotation_translation();
        let (scale, ..) =
            (DAffine3::from_scale(factors) * self.start).to_scale_rotation_translation();
        DAffine3::from_scale_rotation_translation(scale, rotation, place)
    }

    /// The ring, and the sector that was turned through.
    pub(super) fn draw_turn(
        &self,
        geometry: &Geometry<'_>,
        painter: &Painter,
        color: Color32,
        snaps: bool,
    ) -> Option<()> {
        let is_view = self.handle == Handle::View;
        let radius = if is_view { OUTER } else { SIZE };
        let turned_rad = snapped(self.turned_rad, snaps.then_some(SNAP_RAD));
        let at = |angle: f64, radius: f64| {
            let direction = DQuat::from_axis_angle(self.axis, angle) * self.grabbed;
            geometry.project(geometry.point(radius * direction))
        };
        let stroke = Stroke::new(STROKE as f32, color);
        let middle = geometry.project(geometry.place)?;
        let steps = 2 + (turned_rad.abs() / 0.1) as u32;
        let mut sector = Mesh::default();
        sector.colored_vertex(middle, color.linear_multiply(0.25));
        for step in 0..=steps {
            let angle = turned_rad * f64::from(step) / f64::from(steps);
            sector.colored_vertex(at(angle, radius)?, color.linear_multiply(0.25));
            if step > 0 {
                sector.add_triangle(0, step, step + 1);
            }
        }
        painter.add(Shape::mesh(sector));
        let ends = [at(0.0, radius)?, middle, at(turned_rad, radius)?];
        painter.add(Shape::line(ends.to_vec(), stroke));
        let ring = (0..64).map(|step| at(TAU * f64::from(step) / 64.0, radius));
        painter.add(Shape::closed_line(ring.collect::<Option<_>>()?, stroke));
        if snaps {
            let thin = Stroke::new(0.5 * STROKE as f32, color);
            for step in 0..64 {
                let angle = turned_rad + SNAP_RAD * f64::from(step);
                painter.line_segment([at(angle, 1.1 * radius)?, at(angle, 1.2 * radius)?], thin);
            }
        }
        Some(())
    }
}
