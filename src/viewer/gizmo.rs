//! Handles that move, turn and scale the selected object in the picture.
//!
//! Positions are metres from the eye along the world's axes: a scene far from the origin has handles as exact as one
//! at it. Handles have the same size on the screen at every depth.

mod drag;
mod geometry;
#[cfg(test)]
mod tests;

use std::f64::consts::PI;

use egui::{Color32, Key, Painter, Pos2, Rect, Shape, Stroke};
use glam::DAffine3;

use drag::Drag;
use geometry::Geometry;

use crate::xr::View;

stereolux_base::words! {
    /// Which handles are shown.
    #[derive(Default)]
    pub enum Mode: name {
        /// Arrows and planes.
        #[default]
        Move = "Move",
        /// Rings.
        Turn = "Turn",
        /// Boxes.
        Scale = "Scale",
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

    /// Where its axes can be grabbed, x, y and z, points of the window; `None` while there is no gizmo.
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
        self.draw(
            &after,
            &painter.with_clip_rect(area.intersect(painter.clip_rect())),
            focus,
            snaps,
        );
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
