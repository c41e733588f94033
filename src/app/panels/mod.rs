//! Panels in the scene: widgets of egui on a rectangle, clicked by where a hand points.
//!
//! A panel is an ordinary part of the scene, a black rectangle of two triangles whose front shines with its picture, so that
//! every pass sees it like anything else. The picture is drawn on the host, and uploaded where it has changed. All that
//! widgets learn (time, where hands point, triggers) is the frame's recorded input: a replay has the same pictures.

mod canvas;

use egui::epaint::ClippedShape;
use egui::{CentralPanel, Color32, Event, LayerId, Order, PointerButton, Pos2, RawInput, Rect, Ui};
use glam::{DQuat, DVec2, DVec3};

use super::world::{World, WorldError};
use crate::pose::Pose;
use crate::scene::{Image, Material, Mesh, Node, Scene, ScenePart, Texture, TextureRef, Wrap};
use crate::xr::{Button, Side};
use canvas::Canvas;

/// Most pixels of a panel across or down.
const MOST_PIXELS: u32 = 4096;
/// How far a hand may wander between pressing and letting go for that to be a click, points.
const CLICK_POINTS: f32 = 24.0;
/// How much nearer than the panel something must be to stand before it, metres.
const BEFORE_M: f64 = 1e-3;

/// A panel to be added ([`World::add_panel`]).
#[derive(Clone, Debug, PartialEq)]
pub struct PanelSpec {
    /// Name of its node.
    pub name: String,
    /// World from panel: the origin is its middle, +X goes right, +Y up, and its front looks along +Z.
    pub world_from_panel: Pose,
    /// Width, metres, above 0; the height follows from the pixels, which are square.
    pub width_m: f64,
    /// Pixels across and down, 1 to 4096; a pixel is a point of egui's.
    pub pixels: [u32; 2],
    /// What white shines with, W sr^-1 m^-2, above 0.
    pub radiance: f32,
}

impl Default for PanelSpec {
    fn default() -> Self {
        Self {
            name: "panel".to_owned(),
            world_from_panel: Pose::IDENTITY,
            width_m: 0.5,
            pixels: [320, 200],
            radiance: 1.0,
        }
    }
}

/// A panel that was added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Panel(usize);

/// What is kept of a panel.
pub(super) struct Kept {
    part: ScenePart,
    pixels: [u32; 2],
    width_m: f64,
    egui: egui::Context,
    canvas: Canvas,
    shapes: Vec<ClippedShape>,
    pointer: Pointer,
}

/// What egui knows of the hands.
#[derive(Clone, Copy, Default)]
struct Pointer {
    at: Option<Pos2>,
    /// The hand whose trigger has gone down on the panel and is down yet.
    pressing: Option<Side>,
}

impl PanelSpec {
    fn check(&self) -> Result<(), WorldError> {
        let is_size = |value: f64| value.is_finite() && value > 0.0;
        let fault = if !is_size(self.width_m) {
            format!("width_m is {}, not above 0", self.width_m)
        } else if !self
            .pixels
            .iter()
            .all(|count| (1..=MOST_PIXELS).contains(count))
        {
            let [across, down] = self.pixels;
            format!("pixels are {across} x {down}, not 1 to {MOST_PIXELS} each")
        } else if !is_size(f64::from(self.radiance)) {
            format!("radiance is {}, not above 0", self.radiance)
        } else {
            return Ok(());
        };
        Err(WorldError::Panel(format!("{}: {fault}", self.name)))
    }

    /// The rectangle as a scene of its own. Its picture is grey until one is drawn: a lamp's power is that of its picture.
    fn scene(&self) -> Scene {
        let [width, height] = self.pixels.map(|count| count as usize);
        let half_x = 0.5 * self.width_m as f32;
        let half_y = half_x * height as f32 / width as f32;
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let positions = corners.map(|[x, y]| [x * half_x, y * half_y, 0.0]).into();
        let normals = vec![[0.0, 0.0, 1.0]; 4];
        let mesh = Mesh {
            name: self.name.clone(),
            tangents: vec![[1.0, 0.0, 0.0, 1.0]; 4],
            uv0: corners.map(|[x, y]| [0.5 + 0.5 * x, 0.5 - 0.5 * y]).into(),
            ..Mesh::plain(positions, normals, [[0, 1, 2], [0, 2, 3]], 0)
        };
        Scene {
            name: self.name.clone(),
            nodes: vec![Node {
                name: self.name.clone(),
                ..Node::of_mesh(0)
            }],
            roots: vec![0],
            meshes: vec![mesh],
            materials: vec![Material {
                emission: [self.radiance; 3],
                emissive_texture: Some(TextureRef::plain(0)),
                ..Material::lambert(&self.name, [0.0; 3])
            }],
            textures: vec![Texture {
                wrap_u: Wrap::Clamp,
                wrap_v: Wrap::Clamp,
                ..Texture::default()
            }],
            images: vec![Image {
                name: self.name.clone(),
                width: self.pixels[0],
                height: self.pixels[1],
                rgba8: [128, 128, 128, 255].repeat(width * height),
            }],
            ..Scene::default()
        }
    }
}

impl Kept {
    /// Where on the panel a ray from outside meets its front, points from the upper left corner, and how far away.
    fn meets(
        &self,
        panel_from_world: &Pose,
        origin: DVec3,
        direction: DVec3,
    ) -> Option<(Pos2, f64)> {
        let from = panel_from_world.position + panel_from_world.orientation * origin;
        let along = panel_from_world.orientation * direction;
        let distance_m = -from.z / along.z;
        if along.z >= 0.0 || distance_m < 0.0 {
            return None;
        }
        let per_m = f64::from(self.pixels[0]) / self.width_m;
        let size = DVec2::from(self.pixels.map(f64::from));
        let met = (from + distance_m * along).truncate();
        let at = 0.5 * size + per_m * DVec2::new(met.x, -met.y);
        let is_on = at.cmpge(DVec2::ZERO).all() && at.cmplt(size).all();
        is_on.then_some((Pos2::new(at.x as f32, at.y as f32), distance_m))
    }

    /// What egui is told of a frame.
    fn input(&mut self, now: Pointer) -> RawInput {
        let size = self.pixels.map(|count| count as f32);
        RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, size.into())),
            events: events(std::mem::replace(&mut self.pointer, now), now),
            ..RawInput::default()
        }
    }

    /// Runs the widgets; the new picture, if it is another one.
    fn draw(&mut self, input: RawInput, mut content: impl FnMut(&mut Ui)) -> Option<Vec<u8>> {
        let at = self.pointer.at;
        let output = self.egui.run_ui(input, |root| {
            CentralPanel::default().show(root, &mut content);
            if let Some(at) = at {
                let layer = LayerId::new(Order::Tooltip, egui::Id::unique("aim"));
                let painter = root.ctx().layer_painter(layer);
                painter.circle(at, 3.5, Color32::WHITE, (1.5, Color32::BLACK));
            }
        });
        let is_same = output.textures_delta.is_empty() && output.shapes == self.shapes;
        self.canvas.take_textures(output.textures_delta);
        if is_same {
            return None;
        }
        self.shapes.clone_from(&output.shapes);
        let primitives = self.egui.tessellate(output.shapes, output.pixels_per_point);
        self.canvas.draw(&primitives);
        Some(self.canvas.rgba8())
    }
}

/// What egui is told of the hands from one frame to the next.
fn events(mut before: Pointer, now: Pointer) -> Vec<Event> {
    let mut events = Vec::new();
    let press = |pos, pressed| Event::PointerButton {
        pos,
        button: PointerButton::Primary,
        pressed,
        modifiers: egui::Modifiers::NONE,
    };
    // One hand lets go before the other presses.
    let is_another = |side| now.pressing.is_some_and(|now| now != side);
    if before.pressing.take_if(|side| is_another(*side)).is_some() {
        events.extend(before.at.map(|pos| press(pos, false)));
    }
    if let Some(at) = now.at.filter(|at| before.at != Some(*at)) {
        events.push(Event::PointerMoved(at));
    }
    // Where the pointer has left, the button goes up where it was last.
    if let Some(pos) = now.at.or(before.at)
        && before.pressing.is_some() != now.pressing.is_some()
    {
        events.push(press(pos, now.pressing.is_some()));
    }
    if now.at.is_none() && before.at.is_some() {
        events.push(Event::PointerGone);
    }
    events
}

impl World<'_> {
    /// Adds a panel. In [`super::App::start`] the renderer is made for it; later it takes no compiling where textures and
    /// lamps are in use already.
    ///
    /// # Errors
    /// [`WorldError::Panel`]: a size that no panel can have; [`WorldError::Edit`].
    pub fn add_panel(&mut self, spec: &PanelSpec) -> Result<Panel, WorldError> {
        spec.check()?;
        let at = spec.world_from_panel.affine();
        let part = self.insert(spec.scene(), &spec.name, at)?;
        let egui = egui::Context::default();
        egui.set_theme(egui::Theme::Dark);
        egui.options_mut(|options| {
            // A hand is slower than a mouse and trembles.
            options.input_options.max_click_duration = f64::INFINITY;
            options.input_options.max_click_dist = CLICK_POINTS;
        });
        let panels = &mut self.kept.panels;
        panels.push(Some(Kept {
            part,
            pixels: spec.pixels,
            width_m: spec.width_m,
            egui,
            canvas: Canvas::new(spec.pixels),
            shapes: Vec::new(),
            pointer: Pointer::default(),
        }));
        Ok(Panel(panels.len() - 1))
    }

    /// The node of a panel: to be moved, hidden, found. It is not to be scaled.
    ///
    /// # Errors
    /// [`WorldError::Panel`]: it was removed.
    pub fn node_of_panel(&self, panel: Panel) -> Result<usize, WorldError> {
        let known = self.kept.panels.get(panel.0).and_then(Option::as_ref);
        let known = known.ok_or_else(|| WorldError::Panel("it was removed".into()))?;
        Ok(known.part.root())
    }

    /// Takes a panel out of the scene.
    ///
    /// # Errors
    /// [`WorldError::Panel`]: it was taken out before. [`WorldError::Edit`]: another node shows its mesh; the panel stays.
    pub fn remove_panel(&mut self, panel: Panel) -> Result<(), WorldError> {
        let known = self.take_panel(panel)?;
        let removed = self.remove_part(&known.part);
        if removed.is_err() {
            self.kept.panels[panel.0] = Some(known);
        }
        removed
    }

    /// Lets a panel show what `content` makes of it with egui, in the frame under way; until the next call it stays as it is.
    ///
    /// Where a hand points at its front with nothing in between is the pointer (the right hand's, where both do, unless the left
    /// one has begun to press), the trigger is the button. Only a picture that differs from the last one is drawn and
    /// uploaded. To be called once a frame. In [`super::App::start`] nobody points.
    ///
    /// # Errors
    /// [`WorldError::Panel`]: it was removed. [`WorldError::Edit`]: its node was deleted.
    pub fn panel(&mut self, panel: Panel, content: impl FnMut(&mut Ui)) -> Result<(), WorldError> {
        let node = self.node_of_panel(panel)?;
        let world_from_panel = self.world_from_node(node)?;
        let mut known = self.take_panel(panel)?;
        let turn = DQuat::from_mat3(&world_from_panel.matrix3).conjugate();
        let panel_from_world = Pose::new(turn * -world_from_panel.translation, turn);
        let pointer = self.pointer_on(&known, &panel_from_world);
        let mut input = known.input(pointer);
        if let Some(frame) = self.frame {
            input.time = Some(frame.time_s());
            input.predicted_dt = (frame.period_ns as f64 * 1e-9) as f32;
        }
        let picture = known.draw(input, content);
        if let Some(rgba8) = picture {
            self.repaint(known.part.images.start, rgba8);
        }
        self.kept.panels[panel.0] = Some(known);
        Ok(())
    }

    fn take_panel(&mut self, panel: Panel) -> Result<Kept, WorldError> {
        let known = self.kept.panels.get_mut(panel.0).and_then(Option::take);
        known.ok_or_else(|| WorldError::Panel("it was removed".into()))
    }

    /// Which hand is a panel's pointer, and where.
    fn pointer_on(&self, known: &Kept, panel_from_world: &Pose) -> Pointer {
        let Some(frame) = self.frame else {
            return Pointer::default();
        };
        let before = known.pointer.pressing;
        let met = |side: Side| {
            let (origin, direction) = frame.aim(side)?;
            let (at, distance_m) = known.meets(panel_from_world, origin, direction)?;
            let hit = self.cast_ray(origin, direction, distance_m - BEFORE_M, &[]);
            hit.is_none().then_some(at)
        };
        let is_held = |side: Side| frame.hand(side).pressed.has(Button::Trigger);
        let pressing = before.filter(|side| is_held(*side));
        let order = match pressing {
            // Nobody else may drag what one hand has hold of.
            Some(side) => [side; 2],
            None => [Side::Right, Side::Left],
        };
        let pointing = order.into_iter().find_map(|side| Some((side, met(side)?)));
        let begins = |side: Side| frame.pressed(side, Button::Trigger);
        Pointer {
            at: pointing.map(|(_, at)| at),
            pressing: pressing.or_else(|| {
                let side = pointing.map(|(side, _)| side)?;
                begins(side).then_some(side)
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_hand_lets_go_before_the_other_presses() {
        let pointer = |x, pressing| Pointer {
            at: Some(Pos2::new(x, 1.0)),
            pressing: Some(pressing),
        };
        let told = events(pointer(1.0, Side::Left), pointer(5.0, Side::Right));
        let places = told.iter().map(|event| match event {
            Event::PointerMoved(at) => (at.x, None),
            Event::PointerButton { pos, pressed, .. } => (pos.x, Some(*pressed)),
            other => panic!("{other:?}"),
        });
        let expected = [(1.0, Some(false)), (5.0, None), (5.0, Some(true))];
        assert_eq!(places.collect::<Vec<_>>(), expected);
    }

    #[test]
    fn a_button_goes_up_where_the_pointer_left() {
        let before = Pointer {
            at: Some(Pos2::new(3.0, 1.0)),
            pressing: Some(Side::Left),
        };
        let told = events(before, Pointer::default());
        assert!(matches!(
            told[..],
            [
                Event::PointerButton { pos, pressed: false, .. },
                Event::PointerGone
            ] if pos.x == 3.0
        ));
    }
}
