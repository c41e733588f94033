//! Handles that move, turn and scale the selected object in the picture.
//!
//! Positions are metres from the eye along the world's axes: a scene far from the origin has handles as exact as one
//! at it. Handles have the same size on the screen at every depth.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use egui::{Color32, Key, Mesh, Painter, Pos2, Rect, Shape, Stroke, Vec2};
use glam::{DAffine3, DMat3, DQuat, DVec3};

use crate::xr::View;

/// Which handles are shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Arrows and planes.
    #[default]
    Move,
    /// Rings.
    Turn,
    /// Boxes.
    Scale,
}

impl Mode {
    /// All, in the order of the keys.
    pub const ALL: [Self; 3] = [Self::Move, Self::Turn, Self::Scale];

    /// Name for people.
    pub fn name(self) -> &'static str {
        match self {
            Self::Move => "Move",
            Self::Turn => "Turn",
            Self::Scale => "Scale",
        }
    }
}

/// Keys of the modes.
pub const KEYS: [(Key, Mode); 3] = [
    (Key::Num1, Mode::Move),
    (Key::Num2, Mode::Turn),
    (Key::Num3, Mode::Scale),
];

/// Objects nearer to the eye than this have no handles, metres: they would not fit the view.
const NEAREST_M: f64 = 1e-3;
/// Length of arrows and radius of rings, points.
const SIZE: f64 = 60.0;
/// Width of lines, points.
const STROKE: f64 = 4.0;
/// Length and width of an arrow's tip, points.
const TIP: f64 = 2.4 * STROKE;
/// A handle is grabbed up to this far beside its line, points.
const GRAB: f32 = 7.0;
/// Radius of the circle in the middle, points.
const INNER: f64 = 0.2 * SIZE;
/// Radius of the circle around everything, points.
const OUTER: f64 = SIZE + STROKE + 5.0;
/// Half the side of a plane's square, points.
const SQUARE: f64 = 7.0;
/// Step of a turn, radians.
const SNAP_RAD: f64 = PI / 32.0;
/// Step of a scale.
const SNAP_SCALE: f64 = 0.1;
/// x, y, z, and the view.
const COLORS: [Color32; 4] = [
    Color32::from_rgb(255, 0, 125),
    Color32::from_rgb(0, 255, 125),
    Color32::from_rgb(0, 125, 255),
    Color32::WHITE,
];

/// One handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Handle {
    /// Along an axis, or about it.
    Axis(usize),
    /// In the plane across an axis.
    Plane(usize),
    /// In the plane of the view, about its direction, or in all directions.
    View,
}

const HANDLES: [Handle; 7] = [
    Handle::Axis(0),
    Handle::Axis(1),
    Handle::Axis(2),
    Handle::Plane(0),
    Handle::Plane(1),
    Handle::Plane(2),
    Handle::View,
];

/// What the pointer does over the picture.
#[derive(Clone, Copy, Debug, Default)]
pub struct Pointer {
    /// Where it is, points of the window.
    pub at: Option<Pos2>,
    /// Nothing else is in front of the picture there.
    pub is_over: bool,
    /// The primary button went down in this pass.
    pub pressed: bool,
    /// The primary button is held.
    pub is_down: bool,
    /// Ctrl is held.
    pub snaps: bool,
}

/// What a pass of the handles did.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Handled {
    /// Nothing.
    Idle,
    /// The pointer is over a handle, or holds one that has not moved.
    Held,
    /// The object stands there now (world from object).
    Moved(DAffine3),
}

/// Where the handles stand in a picture.
#[derive(Clone, Copy)]
struct Geometry<'a> {
    view: &'a View,
    area: Rect,
    mode: Mode,
    /// The object's place, from the eye.
    place: DVec3,
    /// Directions of the axes; unit length.
    axes: [DVec3; 3],
    /// Metres per point across the view at the object's depth.
    m_per_point: f64,
}

/// What is drawn of a handle, and grabbed.
struct Outline {
    points: Vec<DVec3>,
    is_closed: bool,
    /// Its inside can be grabbed as well.
    is_full: bool,
}

impl<'a> Geometry<'a> {
    /// `None` if the object is behind the eye or too near.
    fn new(
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
    fn project(&self, from_eye: DVec3) -> Option<Pos2> {
        let p = self.view.orientation.conjugate() * from_eye;
        let t = self.view.fov.tangents();
        let x = (p.x / -p.z - t.left) / (t.right - t.left);
        let y = (t.up - p.y / -p.z) / (t.up - t.down);
        let at = self.area.min + self.area.size() * Vec2::new(x as f32, y as f32);
        (p.z < 0.0 && at.is_finite()).then_some(at)
    }

    /// Direction from the eye to what is under a point of the window; unit length.
    fn ray(&self, at: Pos2) -> DVec3 {
        let t = self.view.fov.tangents();
        let [x, y] = <[f32; 2]>::from((at - self.area.min) / self.area.size()).map(f64::from);
        let x = t.left + x * (t.right - t.left);
        let y = t.up - y * (t.up - t.down);
        (self.view.orientation * DVec3::new(x, y, -1.0)).normalize()
    }

    fn direction_to_eye(&self) -> DVec3 {
        -self.place.normalize()
    }

    /// The view's right and up.
    fn screen(&self) -> [DVec3; 2] {
        [DVec3::X, DVec3::Y].map(|axis| self.view.orientation * axis)
    }

    /// `offset`: points along directions.
    fn point(&self, offset: DVec3) -> DVec3 {
        self.place + offset * self.m_per_point
    }

    /// The directions in which a handle moves its object: one, or two across each other.
    fn directions(&self, handle: Handle) -> Vec<DVec3> {
        match handle {
            Handle::Axis(axis) => vec![self.axes[axis]],
            Handle::Plane(normal) => vec![self.axes[(normal + 1) % 3], self.axes[(normal + 2) % 3]],
            Handle::View => self.screen().to_vec(),
        }
    }

    /// What a ring turns about.
    fn ring_axis(&self, handle: Handle) -> DVec3 {
        match handle {
            Handle::Axis(axis) | Handle::Plane(axis) => self.axes[axis],
            Handle::View => self.view.orientation * DVec3::NEG_Z,
        }
    }

    /// 0 to 1: arrows that point at the eye and planes seen from their edge fade.
    fn visibility(&self, handle: Handle) -> f32 {
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
    fn outline(&self, handle: Handle) -> Option<Outline> {
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
    fn pick(&self, at: Pos2) -> Option<Handle> {
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

    fn seen(&self, points: &[DVec3]) -> Option<Vec<Pos2>> {
        points.iter().map(|point| self.project(*point)).collect()
    }

    /// The point of the line, or of the plane, through `origin` that the pointer points at.
    fn under(&self, at: Pos2, origin: DVec3, directions: &[DVec3]) -> Option<DVec3> {
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

/// From the press on a handle to its release.
struct Drag {
    handle: Handle,
    mode: Mode,
    is_local: bool,
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
    fn new(
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
    fn update(
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
    fn draw_turn(
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

/// Draws one handle, if all of it is before the eye.
fn draw(geometry: &Geometry<'_>, painter: &Painter, handle: Handle, color: Color32) -> Option<()> {
    let outline = geometry.outline(handle)?;
    let seen = geometry.seen(&outline.points)?;
    let stroke = Stroke::new(STROKE as f32, color);
    match handle {
        Handle::Axis(axis) if geometry.mode != Mode::Turn => {
            let tip = TIP * geometry.m_per_point * geometry.axes[axis];
            let (start, end) = (seen[0], seen[1]);
            let neck = geometry.project(outline.points[1] - tip)?;
            painter.line_segment([start, neck], stroke);
            if geometry.mode == Mode::Scale {
                painter.line_segment([neck, end], Stroke::new(TIP as f32, color));
            } else {
                let side = 0.5 * TIP as f32 * (end - neck).normalized().rot90();
                let tip = vec![neck + side, end, neck - side];
                painter.add(Shape::convex_polygon(tip, color, Stroke::NONE));
            }
        }
        Handle::Plane(_) => {
            painter.add(Shape::convex_polygon(seen, color, Stroke::NONE));
        }
        _ if outline.is_closed => {
            painter.add(Shape::closed_line(seen, stroke));
        }
        _ => {
            painter.add(Shape::line(seen, stroke));
        }
    }
    Some(())
}

/// Handles, and what they snap to.
#[derive(Default)]
pub struct TransformGizmo {
    drag: Option<Drag>,
    /// Which handles.
    pub mode: Mode,
    /// Along the object's axes instead of the world's.
    pub is_local: bool,
    /// In steps; holding Ctrl does the same for one drag.
    pub snaps: bool,
    /// Step of a move, metres.
    pub snap_m: f32,
    handles: Option<[Pos2; 3]>,
}

impl TransformGizmo {
    /// True from the press on a handle to its release.
    pub fn is_dragging(&self) -> bool {
        self.drag.is_some()
    }

    /// See [`super::app::App::gizmo_handles`].
    pub fn handles(&self) -> Option<[Pos2; 3]> {
        self.handles
    }

    /// There is nothing to handle.
    pub fn hide(&mut self) {
        self.handles = None;
        self.drag = None;
    }

    /// Draws the handles of an object at `world_from_object` over the picture of `view` in `area`, and answers the pointer.
    pub fn show(
        &mut self,
        painter: &Painter,
        area: Rect,
        view: &View,
        world_from_object: DAffine3,
        pointer: Pointer,
    ) -> Handled {
        let geometry = |gizmo: &Self, world_from_object| {
            let (mode, is_local) = match &gizmo.drag {
                Some(drag) => (drag.mode, drag.is_local),
                None => (gizmo.mode, gizmo.is_local),
            };
            Geometry::new(view, area, mode, is_local, world_from_object)
        };
        if !pointer.is_down {
            self.drag = None;
        }
        let Some(before) = geometry(self, world_from_object) else {
            self.hide();
            return Handled::Idle;
        };
        let mut focus = self.drag.as_ref().map(|drag| drag.handle);
        if let (None, Some(at), true) = (focus, pointer.at, pointer.is_over) {
            focus = before.pick(at);
            if let (Some(handle), true) = (focus, pointer.pressed && pointer.is_down) {
                self.drag = Drag::new(&before, handle, self.is_local, world_from_object, at);
            }
        }
        let snaps = self.snaps || pointer.snaps;
        let snap_m = snaps.then_some(f64::from(self.snap_m.max(1e-3)));
        let moved = match (&mut self.drag, pointer.at) {
            (Some(drag), Some(at)) => drag.update(&before, at, snap_m),
            _ => None,
        };
        let after = moved.and_then(|moved| geometry(self, moved));
        let after = after.unwrap_or(before);
        self.draw(&after, &painter.with_clip_rect(area), focus, snaps);
        // On the arrows' shafts.
        let shafts = after.axes.map(|axis| after.point(0.6 * SIZE * axis));
        self.handles = after.seen(&shafts).and_then(|seen| seen.try_into().ok());
        match (moved, focus) {
            (Some(moved), _) => Handled::Moved(moved),
            (None, Some(_)) => Handled::Held,
            (None, None) => Handled::Idle,
        }
    }

    /// All handles, or that which is dragged.
    fn draw(&self, geometry: &Geometry<'_>, painter: &Painter, focus: Option<Handle>, snaps: bool) {
        let is_shown = |handle: &Handle| self.drag.is_none() || focus == Some(*handle);
        for handle in HANDLES.into_iter().filter(is_shown) {
            let base = match handle {
                Handle::Axis(axis) | Handle::Plane(axis) => COLORS[axis],
                Handle::View => COLORS[3],
            };
            let alpha = if focus == Some(handle) { 1.0 } else { 0.7 };
            let color = base.linear_multiply(alpha * geometry.visibility(handle));
            // What does not fit between the eye and the object is left out.
            match &self.drag {
                Some(drag) if drag.mode == Mode::Turn => {
                    drag.draw_turn(geometry, painter, color, snaps)
                }
                _ => draw(geometry, painter, handle, color),
            };
        }
    }
}

#[cfg(test)]
mod tests {
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
        for axis in 0..3 {
            let ring = seen.outline(Handle::Axis(axis)).unwrap().points;
            let [from, to] = [ring[32], ring[44]].map(|point| seen.project(point).unwrap());
            if seen.pick(from) != Some(Handle::Axis(axis)) {
                continue;
            }
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
}
