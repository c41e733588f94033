//! Handles that move, turn and scale the selected object in the picture, by the `transform-gizmo` crate.

use egui::epaint::{Mesh, Vertex};
use egui::{Color32, Key, Painter, Pos2, Rect, Rgba, Shape, pos2};
use glam::{DAffine3, DMat4, DQuat, DVec3};
use transform_gizmo::math::{Rect as GizmoRect, Transform};
use transform_gizmo::{
    EnumSet, Gizmo, GizmoConfig, GizmoInteraction, GizmoMode, GizmoOrientation, GizmoVisuals, mint,
};

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

/// Length of the handles, points.
const SIZE_POINTS: f32 = 60.0;
/// Objects nearer to the eye than this have no handles, metres: they would not fit the view.
const NEAREST_M: f64 = 1e-3;

/// Handles, and what they snap to.
#[derive(Default)]
pub struct TransformGizmo {
    gizmo: Gizmo,
    /// Which handles.
    pub mode: Mode,
    /// Along the object's axes instead of the world's.
    pub is_local: bool,
    /// In steps; holding Ctrl does the same for one drag.
    pub snaps: bool,
    /// Step of a move, metres.
    pub snap_m: f32,
    is_dragging: bool,
    handles: Option<[Pos2; 3]>,
}

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

impl TransformGizmo {
    /// True from the press on a handle to its release.
    pub fn is_dragging(&self) -> bool {
        self.is_dragging
    }

    /// See [`super::app::App::gizmo_handles`].
    pub fn handles(&self) -> Option<[Pos2; 3]> {
        self.handles
    }

    /// There is nothing to handle.
    pub fn hide(&mut self) {
        self.handles = None;
        self.is_dragging = false;
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
        // Relative to the eye: a scene far from the origin has handles as exact as one at it.
        let (scale, rotation, place) = world_from_object.to_scale_rotation_translation();
        let from_eye = place - view.position_in_world;
        let axis_into = view.orientation.conjugate();
        let in_eye = axis_into * from_eye;
        if -in_eye.z < NEAREST_M || !in_eye.is_finite() || !scale.is_finite() {
            self.hide();
            return Handled::Idle;
        }
        let clip_from_eye = clip_from_eye(view, -in_eye.z);
        let eye_from_place = DMat4::from_quat(axis_into);
        let pixels_per_point = painter.pixels_per_point();
        self.gizmo.update_config(GizmoConfig {
            view_matrix: rows(eye_from_place),
            projection_matrix: rows(clip_from_eye),
            viewport: GizmoRect {
                min: [area.min.x, area.min.y].into(),
                max: [area.max.x, area.max.y].into(),
            },
            modes: self.modes(),
            orientation: if self.is_local {
                GizmoOrientation::Local
            } else {
                GizmoOrientation::Global
            },
            snapping: self.snaps || pointer.snaps,
            snap_distance: self.snap_m.max(1e-3),
            visuals: GizmoVisuals {
                gizmo_size: SIZE_POINTS,
                ..GizmoVisuals::default()
            },
            pixels_per_point,
            ..GizmoConfig::default()
        });
        let target = Transform::from_scale_rotation_translation(
            to_mint(scale),
            mint::Quaternion {
                v: to_mint(DVec3::new(rotation.x, rotation.y, rotation.z)),
                s: rotation.w,
            },
            to_mint(from_eye),
        );
        let at = pointer.at.unwrap_or(Pos2::new(-1e4, -1e4));
        let moved = self.gizmo.update(
            GizmoInteraction {
                cursor_pos: (at.x, at.y),
                hovered: pointer.is_over,
                drag_started: pointer.pressed && pointer.is_over,
                dragging: pointer.is_down,
            },
            &[target],
        );
        let is_focused = self.gizmo.is_focused();
        self.is_dragging = pointer.is_down && (self.is_dragging || (is_focused && pointer.pressed));
        self.draw(painter, area);
        let project = |point: DVec3| {
            let clip = clip_from_eye * (axis_into * point).extend(1.0);
            let [x, y] = [clip.x / clip.w, clip.y / clip.w];
            pos2(
                area.min.x + area.width() * (0.5 + 0.5 * x as f32),
                area.min.y + area.height() * (0.5 - 0.5 * y as f32),
            )
        };
        // On the arrows' shafts, by their length across the view at the object's depth.
        let tangents = view.fov.tangents();
        let m_per_point =
            -in_eye.z * (tangents.right - tangents.left) / f64::from(area.width().max(1.0));
        let turn = if self.is_local {
            rotation
        } else {
            DQuat::IDENTITY
        };
        self.handles = Some([DVec3::X, DVec3::Y, DVec3::Z].map(|axis| {
            project(from_eye + turn * axis * (m_per_point * 0.6 * f64::from(SIZE_POINTS)))
        }));
        match moved.and_then(|(_, targets)| targets.first().copied()) {
            Some(to) => {
                let [x, y, z] = <[f64; 3]>::from(to.rotation.v);
                let rotation = DQuat::from_xyzw(x, y, z, to.rotation.s).normalize();
                let (scale, place) = (from_mint(to.scale), from_mint(to.translation));
                Handled::Moved(DAffine3::from_scale_rotation_translation(
                    scale,
                    rotation,
                    place + view.position_in_world,
                ))
            }
            None if is_focused => Handled::Held,
            None => Handled::Idle,
        }
    }

    fn modes(&self) -> EnumSet<GizmoMode> {
        match self.mode {
            Mode::Move => GizmoMode::all_translate(),
            Mode::Turn => GizmoMode::all_rotate(),
            Mode::Scale => GizmoMode::all_scale(),
        }
    }

    fn draw(&self, painter: &Painter, area: Rect) {
        let drawn = self.gizmo.draw();
        let color =
            |[r, g, b, a]: [f32; 4]| Color32::from(Rgba::from_rgba_premultiplied(r, g, b, a));
        let vertices = drawn
            .vertices
            .iter()
            .zip(&drawn.colors)
            .map(|([x, y], rgba)| Vertex::untextured(pos2(*x, *y), color(*rgba)))
            .collect();
        let mesh = Mesh {
            indices: drawn.indices,
            vertices,
            ..Mesh::default()
        };
        if mesh.is_valid() {
            painter.with_clip_rect(area).add(Shape::mesh(mesh));
        }
    }
}

/// Clip from eye in OpenGL's clip space, which the crate expects: depth -1 near, 1 far. The planes lie so that the object
/// is well between them.
fn clip_from_eye(view: &View, distance_m: f64) -> DMat4 {
    let (near, far) = (0.01 * distance_m, 100.0 * distance_m);
    let mut clip_from_eye = view.clip_from_eye(near);
    clip_from_eye.z_axis.z = -(far + near) / (far - near);
    clip_from_eye.w_axis.z = -2.0 * far * near / (far - near);
    clip_from_eye
}

/// The crate has a glam of its own.
fn rows(matrix: DMat4) -> mint::RowMatrix4<f64> {
    mint::RowMatrix4::from(matrix.transpose().to_cols_array_2d())
}

fn to_mint(v: DVec3) -> mint::Vector3<f64> {
    mint::Vector3::from(v.to_array())
}

fn from_mint(v: mint::Vector3<f64>) -> DVec3 {
    DVec3::new(v.x, v.y, v.z)
}
