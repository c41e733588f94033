//! Where the handles of an object stand in a picture, and which of them is under a point of it.

use std::f64::consts::{FRAC_PI_2, PI};

use egui::{Pos2, Rect, Vec2};
use glam::{DAffine3, DQuat, DVec3};

use super::{GRAB, HANDLES, Handle, INNER, Mode, NEAREST_M, OUTER, SIZE, SQUARE, STROKE};
use crate::xr::View;

/// Where the handles stand in a picture.
#[derive(Clone, Copy)]
pub(super) struct Geometry<'a> {
    pub(super) view: &'a View,
    pub(super) area: Rect,
    pub(super) mode: Mode,
    /// The object's place, from the eye.
    pub(super) place: DVec3,
    /// Directions of the axes; unit length.
    pub(super) axes: [DVec3; 3],
    /// Metres per point across the view at the object's depth.
    pub(super) m_per_point: f64,
}

/// What is drawn of a handle, and grabbed.
pub(super) struct Outline {
    pub(super) points: Vec<DVec3>,
    pub(super) is_closed: bool,
    /// Its inside can be grabbed as well.
    pub(super) is_full: bool,
}

impl<'a> Geometry<'a> {
    /// `None` if the object is behind the eye or too near.
    pub(super) fn new(
        view: &'a View,
        area: Rect,
        mode: Mode,
        is_local: bool,
        world_from_object: DAffine3,
    ) -> Option<Self> {
        let (scale, rotation, place) = world_from_object.to_scale_rotation_translation();
        let place = place - view.position_in_world;
        let depth_m = -(view.orientation.conjugate() * place).z;
        if depth_m.is_nan() || depth_m < NEAREST_M || !place.is_finite() || !scale.is_finite() {
            return None;
        }
        let turn = if is_local { rotation } else { DQuat::IDENTITY };
        let t = view.fov.tangents();
        Some(Self {
            view,
            area,
            mode,
            place,
            axes: [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| turn * axis),
            m_per_point: depth_m * (t.right - t.left) / f64::from(area.width().max(1.0)),
        })
    }

    /// Where a point is in the window; `None` behind the eye.
    pub(super) fn project(&self, from_eye: DVec3) -> Option<Pos2> {
        let p = self.view.orientation.conjugate() * from_eye;
        let t = self.view.fov.tangents();
        let x = (p.x / -p.z - t.left) / (t.right - t.left);
        let y = (t.up - p.y / -p.z) / (t.up - t.down);
        let at = self.area.min + self.area.size() * Vec2::new(x as f32, y as f32);
        (p.z < 0.0 && at.is_finite()).then_some(at)
    }

    /// Direction from the eye to what is under a point of the window; unit length.
    fn ray(&self, at: Pos2) -> DVec3 {
        let [x, y] = <[f32; 2]>::from((at - self.area.min) / self.area.size()).map(f64::from);
        self.view.ray_through_pixel(x, y, 1, 1).direction
    }

    fn direction_to_eye(&self) -> DVec3 {
        -self.place.normalize()
    }

    /// The view's right and up.
    fn screen(&self) -> [DVec3; 2] {
        [DVec3::X, DVec3::Y].map(|axis| self.view.orientation * axis)
    }

    /// `offset`: points along directions.
    pub(super) fn point(&self, offset: DVec3) -> DVec3 {
        self.place + offset * self.m_per_point
    }

    /// The directions in which a handle moves its object: one, or two across each other.
    pub(super) fn directions(&self, handle: Handle) -> Vec<DVec3> {
        match handle {
            Handle::Axis(axis) => vec![self.axes[axis]],
            Handle::Plane(normal) => vec![self.axes[(normal + 1) % 3], self.axes[(normal + 2) % 3]],
            Handle::View => self.screen().to_vec(),
        }
    }

    /// What a ring turns about.
    pub(super) fn ring_axis(&self, handle: Handle) -> DVec3 {
        match handle {
            Handle::Axis(axis) | Handle::Plane(axis) => self.axes[axis],
            Handle::View => self.view.orientation * DVec3::NEG_Z,
        }
    }

    /// 0 to 1: arrows that point at the eye and planes seen from their edge fade.
    pub(super) fn visibility(&self, handle: Handle) -> f32 {
        let along = |axis: usize| self.direction_to_eye().dot(self.axes[axis]).abs();
        let faded = match handle {
            _ if self.mode == Mode::Turn => 0.0,
            Handle::Axis(axis) => (along(axis) - 0.95) / 0.04,
            Handle::Plane(normal) => (1.0 - along(normal) - 0.70) / 0.16,
            Handle::View => 0.0,
        };
        1.0 - faded.clamp(0.0, 1.0) as f32
    }

    fn arc(&self, radius: f64, [u, v]: [DVec3; 2], half_angle: f64) -> Vec<DVec3> {
        (0..=64)
            .map(|step| half_angle * (f64::from(step) / 32.0 - 1.0))
            .map(|angle| self.point(radius * (angle.cos() * u + angle.sin() * v)))
            .collect()
    }

    /// `None`: the mode has no such handle.
    pub(super) fn outline(&self, handle: Handle) -> Option<Outline> {
        let is_turn = self.mode == Mode::Turn;
        let (points, is_closed) = match handle {
            Handle::Axis(axis) if is_turn => {
                // The half that faces the eye, or all of it seen from the front.
                let normal = self.axes[axis];
                let facing = self.direction_to_eye().reject_from_normalized(normal);
                let u = facing
                    .try_normalize()
                    .unwrap_or(normal.any_orthonormal_vector());
                let front = (self.direction_to_eye().dot(normal).abs() - 0.990) / 0.005;
                let half_angle = FRAC_PI_2 * (1.0 + front.clamp(0.0, 1.0));
                (self.arc(SIZE, [u, normal.cross(u)], half_angle), false)
            }
            Handle::Axis(axis) => {
                let ends = [INNER + 0.5 * STROKE, SIZE - 2.0 * STROKE];
                let points = ends.map(|points| self.point(points * self.axes[axis]));
                (points.to_vec(), false)
            }
            Handle::Plane(_) if is_turn => return None,
            Handle::Plane(_) => {
                let directions = self.directions(handle);
                let (a, b) = (directions[0], directions[1]);
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                let corner = |(s, t)| {
                    self.point((0.5 * SIZE + SQUARE * s) * a + (0.5 * SIZE + SQUARE * t) * b)
                };
                (corners.map(corner).to_vec(), true)
            }
            Handle::View => {
                let is_move = self.mode == Mode::Move;
                let radius = if is_move { INNER } else { OUTER };
                (self.arc(radius, self.screen(), PI), true)
            }
        };
        Some(Outline {
            points,
            is_closed,
            is_full: is_closed && (self.mode == Mode::Move || handle != Handle::View),
        })
    }

    /// The handle under a point: of several, the nearest to the eye.
    pub(super) fn pick(&self, at: Pos2) -> Option<Handle> {
        let depth = |handle: &Handle| {
            let outline = self.outline(*handle)?;
            let found = self.distance(&outline, at)?;
            (self.visibility(*handle) > 0.0 && found.0 <= GRAB).then_some(found.1)
        };
        HANDLES
            .into_iter()
            .filter_map(|handle| Some((depth(&handle)?, handle)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, handle)| handle)
    }

    /// How far a point of the window is from an outline, points, and how far that place is from the eye, metres.
    fn distance(&self, outline: &Outline, at: Pos2) -> Option<(f32, f64)> {
        let seen: Vec<Pos2> = self.seen(&outline.points)?;
        let count = seen.len();
        let mut nearest = (f32::INFINITY, 0.0);
        let mut is_inside = false;
        for index in 0..count - usize::from(!outline.is_closed) {
            let next = (index + 1) % count;
            let (a, b) = (seen[index], seen[next]);
            let share = ((at - a).dot(b - a) / (b - a).length_sq().max(1e-6)).clamp(0.0, 1.0);
            let distance = (at - a.lerp(b, share)).length();
            if distance < nearest.0 {
                let place = outline.points[index].lerp(outline.points[next], f64::from(share));
                nearest = (distance, place.length());
            }
            // Crossings of a line to the right (even-odd rule).
            is_inside ^= (a.y > at.y) != (b.y > at.y)
                && at.x < a.x + (at.y - a.y) / (b.y - a.y) * (b.x - a.x);
        }
        if outline.is_full && is_inside {
            let middle = outline.points.iter().sum::<DVec3>() / count as f64;
            nearest = (0.0, middle.length());
        }
        Some(nearest)
    }

    pub(super) fn seen(&self, points: &[DVec3]) -> Option<Vec<Pos2>> {
        points.iter().map(|point| self.project(*point)).collect()
    }

    /// The point of the line, or of the plane, through `origin` that the pointer points at.
    pub(super) fn under(&self, at: Pos2, origin: DVec3, directions: &[DVec3]) -> Option<DVec3> {
        let ray = self.ray(at);
        match *directions {
            [along] => {
                let cos = along.dot(ray);
                let sin2 = 1.0 - cos * cos;
                let way = (cos * ray.dot(origin) - along.dot(origin)) / sin2;
                (sin2 > 1e-6).then_some(origin + way * along)
            }
            [u, v] => {
                let normal = u.cross(v);
                let distance = normal.dot(origin) / normal.dot(ray);
                (distance.is_finite() && distance > 0.0).then_some(distance * ray)
            }
            _ => None,
        }
    }
}
