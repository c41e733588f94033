//! What is selected: where it stands, what it is made of, how it shines.

use std::ops::RangeInclusive;

use egui::emath::Numeric;
use egui::{Button, CollapsingHeader, ComboBox, DragValue, Grid, Response, TextEdit, Ui};
use glam::{DAffine3, DQuat, DVec3, EulerRot};

use super::hierarchy::kind;
use crate::scene::Trs;
use crate::scene::edit::{Edit, MaterialPreset, NewContent, NewNode, Placement};
use crate::scene::{LightKind, Material, Mesh, Node, PunctualLight};
use crate::viewer::app::App;

/// Radiant intensity of a light that is added, W/sr: lights a room of a few metres.
const NEW_LIGHT_W_PER_SR: f32 = 5.0;
/// Half angle of a spot that a light is turned into, radians.
const NEW_CONE_RAD: f32 = 0.6;

/// The tab.
pub fn show(app: &mut App, ui: &mut Ui) {
    let last = app.selected.last();
    if app
        .fields
        .name
        .as_ref()
        .is_some_and(|(of, _)| Some(*of) != last)
    {
        // Its field is not shown any more.
        app.take_name();
    }
    let Some(node) = last else {
        ui.weak("Nothing is selected: click an object in the picture, or a node of the scene.");
        return;
    };
    let mut edits = Edits::default();
    let scene = app.document.scene();
    let Some(shown) = scene.nodes.get(node) else {
        return;
    };
    let count = app.selected.nodes().len();
    if count > 1 {
        ui.weak(format!(
            "{count} selected: shown, moved and deleted together; the last one is edited here"
        ));
    }
    name(node, shown, &mut app.fields.name, ui, &mut edits);
    let mut is_shown = !shown.is_hidden;
    if ui.checkbox(&mut is_shown, "Visible").changed() {
        edits.one = app.selected.show(node, !is_shown);
    }
    transform(node, shown, ui, &mut edits);
    let known = app.fields.materials.take();
    let materials = match known {
        // Counting looks at all triangles, and what paints them changes the number of materials.
        Some((of, among, materials)) if (of, among) == (node, scene.materials.len()) => materials,
        _ => materials_of(app, node),
    };
    for [mesh, material, users] in &materials {
        if let Some(found) = scene.materials.get(*material) {
            material_panel(*mesh, *material, found, *users, ui, &mut edits);
        }
    }
    if let Some(light) = shown.light
        && let Some(found) = scene.lights.get(light)
    {
        light_panel(light, found, ui, &mut edits);
    }
    app.fields.materials = Some((node, scene.materials.len(), materials));
    ui.separator();
    let pressed = buttons(node, ui, &mut edits);
    carry_out(app, ui, edits);
    if let Some(pressed) = pressed {
        pressed(app, ui.ctx());
    }
}

/// Kind and name of the node. `written` is a name that is being written, and of which node.
fn name(
    node: usize,
    shown: &Node,
    written: &mut Option<(usize, String)>,
    ui: &mut Ui,
    edits: &mut Edits,
) {
    ui.horizontal(|ui| {
        ui.weak(kind(shown));
        let mut name = match written {
            Some((of, name)) if *of == node => name.clone(),
            _ => shown.name.clone(),
        };
        let response = ui.add(TextEdit::singleline(&mut name).desired_width(180.0));
        if response.lost_focus() {
            *written = None;
            let cancelled = ui.input(|input| input.key_pressed(egui::Key::Escape));
            if name != shown.name && !cancelled {
                edits.one = Some(Edit::Rename { node, name });
            }
        } else if response.has_focus() {
            *written = Some((node, name));
        }
    });
}

/// What is done with all that is selected.
type Pressed = fn(&mut App, &egui::Context);

/// What can be done with the node, and with all that is selected.
fn buttons(node: usize, ui: &mut Ui, edits: &mut Edits) -> Option<Pressed> {
    let mut pressed: Option<Pressed> = None;
    ui.horizontal_wrapped(|ui| {
        if ui.add(Button::new("Focus").shortcut_text("F")).clicked() {
            pressed = Some(|app, _| app.focus_selected());
        }
        let child = |name: &str, content| Edit::Add {
            parent: Some(node),
            node: NewNode {
                name: name.to_owned(),
                to: Placement::Parts(Trs::default()),
                content,
            },
        };
        if ui.button("Add child with light").clicked() {
            let light = PunctualLight {
                name: "light".to_owned(),
                kind: LightKind::Point,
                intensity: [NEW_LIGHT_W_PER_SR; 3],
            };
            edits.add(child("light", NewContent::Light(light)));
        }
        let group = ui.button("Add child").on_hover_text("an empty group");
        if group.clicked() {
            edits.add(child("group", NewContent::Empty));
        }
        let duplicate = Button::new("Duplicate").shortcut_text("Ctrl+D");
        if ui.add(duplicate).clicked() {
            pressed = Some(App::duplicate_selected);
        }
        if ui.add(Button::new("Delete").shortcut_text("Del")).clicked() {
            pressed = Some(App::delete_selected);
        }
    });
    pressed
}

/// What the widgets asked for.
#[derive(Default)]
struct Edits {
    one: Option<Edit>,
    /// The last node is selected when it is done.
    selects_new: bool,
    drag_begins: bool,
    drag_ends: bool,
}

impl Edits {
    /// An edit that adds a node, which is selected when it is done.
    fn add(&mut self, edit: Edit) {
        self.one = Some(edit);
        self.selects_new = true;
    }

    /// A number to be dragged or written; true if it changed.
    fn number<N: Numeric>(
        &mut self,
        ui: &mut Ui,
        value: &mut N,
        range: RangeInclusive<N>,
        speed: f64,
    ) -> bool {
        let field = DragValue::new(value).range(range).speed(speed);
        // Who only looks changes nothing.
        let field = field.clamp_existing_to_range(false);
        self.watch(&ui.add(field.max_decimals(4)))
    }

    /// Notes the drag of a value; true if the value changed.
    fn watch(&mut self, response: &Response) -> bool {
        self.drag_begins |= response.drag_started();
        self.drag_ends |= response.drag_stopped();
        response.changed()
    }
}

fn carry_out(app: &mut App, ui: &Ui, edits: Edits) {
    let context = ui.ctx().clone();
    if edits.drag_begins {
        app.document.begin_gesture();
    }
    let count = app.document.scene().nodes.len();
    if let Some(edit) = edits.one {
        app.edit(&context, edit);
        if edits.selects_new && app.document.scene().nodes.len() > count {
            app.selected.set(Some(count));
            app.fields.scroll_to_selected = true;
        }
        app.forget_missing();
    }
    if edits.drag_ends {
        app.document.end_gesture();
    }
}

fn transform(node: usize, shown: &Node, ui: &mut Ui, edits: &mut Edits) {
    let from = shown.trs();
    CollapsingHeader::new("Transform")
        .default_open(true)
        .show(ui, |ui| {
            let mut to = from;
            let mut changed = false;
            Grid::new("transform").num_columns(4).show(ui, |ui| {
                ui.label("Position, m");
                changed |= vector(ui, edits, &mut to.translation, 0.01);
                ui.end_row();
                // Turned about y, then x, then z, as a head is: yaw, pitch, roll.
                let (yaw, pitch, roll) = from.rotation.to_euler(EulerRot::YXZ);
                // What rounds to nothing has no sign.
                let shown = |angle: f64| {
                    let degrees = angle.to_degrees();
                    if degrees.abs() < 5e-5 { 0.0 } else { degrees }
                };
                let mut degrees = DVec3::new(pitch, yaw, roll).map(shown);
                ui.label("Rotation, degrees");
                if vector(ui, edits, &mut degrees, 0.5) {
                    let [pitch, yaw, roll] = degrees.map(f64::to_radians).to_array();
                    to.rotation = DQuat::from_euler(EulerRot::YXZ, yaw, pitch, roll);
                    changed = true;
                }
                ui.end_row();
                ui.label("Scale");
                changed |= vector(ui, edits, &mut to.scale, 0.01);
                ui.end_row();
            });
            if changed {
                // A matrix may hold shear, which parts do not.
                let only_moves = (to.rotation, to.scale) == (from.rotation, from.scale);
                let to = match shown.exact_parts() {
                    None if only_moves => Placement::Matrix(DAffine3 {
                        translation: to.translation,
                        ..shown.parent_from_node
                    }),
                    _ => Placement::Parts(to),
                };
                edits.one = Some(Edit::Transform { node, to });
            }
        });
}

/// Three numbers; true if one changed.
fn vector(ui: &mut Ui, edits: &mut Edits, value: &mut DVec3, speed: f64) -> bool {
    let mut changed = false;
    for axis in 0..3 {
        changed |= edits.number(
            ui,
            &mut value[axis],
            f64::NEG_INFINITY..=f64::INFINITY,
            speed,
        );
    }
    changed
}

/// Mesh and materials of the node, the ones with most triangles first, and how many meshes have each.
fn materials_of(app: &App, node: usize) -> Vec<[usize; 3]> {
    let scene = app.document.scene();
    let Some(mesh) = scene.nodes.get(node).and_then(|node| node.mesh) else {
        return Vec::new();
    };
    let mut counts: Vec<(usize, usize)> = Vec::new();
    for triangle in &scene.meshes[mesh].triangles {
        let material = triangle.material as usize;
        match counts.iter_mut().find(|(of, _)| *of == material) {
            Some((_, count)) => *count += 1,
            None => counts.push((material, 1)),
        }
    }
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let has = |mesh: &&Mesh, material: usize| {
        let mut triangles = mesh.triangles.iter();
        triangles.any(|triangle| triangle.material as usize == material)
    };
    counts
        .into_iter()
        .map(|(material, _)| {
            let users = scene.meshes.iter().filter(|mesh| has(mesh, material));
            [mesh, material, users.count()]
        })
        .collect()
}

fn material_panel(
    mesh: usize,
    index: usize,
    from: &Material,
    users: usize,
    ui: &mut Ui,
    edits: &mut Edits,
) {
    CollapsingHeader::new(format!("Material: {}", from.name))
        .id_salt(("material", index))
        .default_open(true)
        .show(ui, |ui| {
            let mut to = from.clone();
            let changed = material_values(index, from, &mut to, ui, edits);
            let textures = [
                ("base colour", from.base_color_texture),
                ("metallic and roughness", from.metallic_roughness_texture),
                ("normal", from.normal_texture),
                ("emission", from.emissive_texture),
            ];
            let textured: Vec<&str> = textures
                .iter()
                .filter_map(|(name, texture)| texture.map(|_| *name))
                .collect();
            if !textured.is_empty() {
                ui.weak(format!("textures: {}", textured.join(", ")));
            }
            if users > 1 {
                ui.horizontal(|ui| {
                    ui.weak(format!("{users} meshes have it"));
                    let own = ui
                        .button("Make its own")
                        .on_hover_text("a copy for this mesh alone");
                    if own.clicked() {
                        edits.one = Some(Edit::OwnMaterial {
                            mesh,
                            material: index,
                        });
                    }
                });
            }
            if changed {
                edits.one = Some(Edit::Material {
                    material: index,
                    to: Box::new(to),
                });
            }
        });
}

/// The material's numbers, from `from` into `to`; true if one changed.
fn material_values(
    index: usize,
    from: &Material,
    to: &mut Material,
    ui: &mut Ui,
    edits: &mut Edits,
) -> bool {
    let mut changed = false;
    let grid = Grid::new(("material values", index)).num_columns(2);
    grid.show(ui, |ui| {
        ui.label("Type");
        let now = MaterialPreset::of(from);
        let mut wanted = now;
        ComboBox::from_id_salt(("type", index))
            .selected_text(now.name())
            .show_ui(ui, |ui| {
                for preset in MaterialPreset::ALL {
                    ui.selectable_value(&mut wanted, preset, preset.name());
                }
            });
        if wanted != now {
            *to = wanted.applied_to(from);
            changed = true;
        }
        ui.end_row();
        let [r, g, b, a] = to.base_color;
        let mut rgb = [r, g, b];
        ui.label("Base colour")
            .on_hover_text("linear RGB, times the texture if there is one");
        if color(ui, edits, &mut rgb) {
            to.base_color = [rgb[0], rgb[1], rgb[2], a];
            changed = true;
        }
        ui.end_row();
        let shares = [
            ("Metallic", "0 dielectric to 1 metal", &mut to.metallic),
            (
                "Roughness",
                "0 mirror to 1 dull; GGX alpha is its square",
                &mut to.roughness,
            ),
            (
                "Specular",
                "strength of the dielectric's reflection; 0 is ideal Lambert",
                &mut to.specular,
            ),
            (
                "Transmission",
                "share of light that passes through: glass at 1",
                &mut to.transmission,
            ),
        ];
        for (name, about, value) in shares {
            ui.label(name).on_hover_text(about);
            changed |= edits.number(ui, value, 0.0..=1.0, 0.005);
            ui.end_row();
        }
        ui.label("Index of refraction");
        changed |= edits.number(ui, &mut to.ior, 1.0..=4.0, 0.005);
        ui.end_row();
        ui.label("Emission")
            .on_hover_text("radiance, W/(m² sr), linear RGB");
        changed |= radiance(ui, edits, &mut to.emission);
        ui.end_row();
    });
    changed
}

/// A colour to be picked, and its numbers.
fn color(ui: &mut Ui, edits: &mut Edits, rgb: &mut [f32; 3]) -> bool {
    let mut changed = false;
    ui.horizontal(|ui| {
        // The button rounds what it only shows.
        let mut picked = *rgb;
        if edits.watch(&ui.color_edit_button_rgb(&mut picked)) {
            *rgb = picked;
            changed = true;
        }
        for channel in rgb {
            changed |= edits.number(ui, channel, 0.0..=1.0, 0.005);
        }
    });
    changed
}

/// Three numbers of any size from 0.
fn radiance(ui: &mut Ui, edits: &mut Edits, rgb: &mut [f32; 3]) -> bool {
    let mut changed = false;
    ui.horizontal(|ui| {
        for channel in rgb {
            changed |= edits.number(ui, channel, 0.0..=1e9, 0.05);
        }
    });
    changed
}

fn light_panel(index: usize, from: &PunctualLight, ui: &mut Ui, edits: &mut Edits) {
    CollapsingHeader::new(format!("Light: {}", from.name))
        .id_salt(("light", index))
        .default_open(true)
        .show(ui, |ui| {
            let mut to = from.clone();
            let mut changed = false;
            Grid::new(("light values", index))
                .num_columns(2)
                .show(ui, |ui| {
                    let name = |kind: &LightKind| match kind {
                        LightKind::Point => "point",
                        LightKind::Spot { .. } => "spot",
                        LightKind::Directional => "directional",
                    };
                    ui.label("Kind");
                    ComboBox::from_id_salt(("kind", index))
                        .selected_text(name(&from.kind))
                        .show_ui(ui, |ui| {
                            let spot = LightKind::Spot {
                                inner_cone_rad: 0.5 * NEW_CONE_RAD,
                                outer_cone_rad: NEW_CONE_RAD,
                            };
                            for kind in [LightKind::Point, spot, LightKind::Directional] {
                                let is_now = name(&kind) == name(&from.kind);
                                if ui.selectable_label(is_now, name(&kind)).clicked() && !is_now {
                                    to.kind = kind;
                                    changed = true;
                                }
                            }
                        });
                    ui.end_row();
                    ui.label("Intensity").on_hover_text(
                        "linear RGB: W/sr, or W/m² at normal incidence for directional light",
                    );
                    changed |= radiance(ui, edits, &mut to.intensity);
                    ui.end_row();
                    if let LightKind::Spot {
                        inner_cone_rad,
                        outer_cone_rad,
                    } = &mut to.kind
                    {
                        for (name, angle) in [
                            ("Inner cone", &mut *inner_cone_rad),
                            ("Outer cone", &mut *outer_cone_rad),
                        ] {
                            let mut degrees = angle.to_degrees();
                            ui.label(name).on_hover_text("half angle");
                            let field = DragValue::new(&mut degrees)
                                .range(0.0..=90.0)
                                .speed(0.2)
                                .suffix("°");
                            if edits.watch(&ui.add(field)) {
                                *angle = degrees.to_radians();
                                changed = true;
                            }
                            ui.end_row();
                        }
                        // glTF has no inner cone that is wider than the outer one.
                        *inner_cone_rad = inner_cone_rad.min(*outer_cone_rad);
                    }
                });
            if changed {
                edits.one = Some(Edit::Light { light: index, to });
            }
        });
}
