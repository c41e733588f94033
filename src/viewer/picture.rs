//! The picture area: the eyes in their layout, what is selected, and what the pointer does there.

use egui::{
    Align2, Color32, Context, FontId, Painter, PointerButton, Pos2, Rect, Response, Sense, Stroke,
    Ui, pos2, vec2,
};
use glam::{DAffine3, DVec3};

use super::aim;
use super::app::App;
use super::frames::{FrameReport, PicturePlace, PixelRadiance};
use super::gizmo::{Handled, Pointer};
use super::layout::{Layout, Part, rectangles};
use super::selection;
use super::session::Player;
use super::worker::decided;
use crate::false_color::{Legend, map_color};

/// Frames grow in steps of so many pixels when the window is resized: every step allocates.
const SIZE_STEP: f32 = 16.0;
/// Without `size`, no eye's image is larger than this by default on either edge: on a software adapter, more would take
/// seconds to refine.
const MOST_PIXELS: f32 = 1024.0;
/// Half the width in which the divider of a split view can be grabbed, points.
const GRAB_POINTS: f32 = 6.0;

/// The central part of the window.
pub fn show(app: &mut App, ui: &mut Ui) {
    let panel = egui::CentralPanel::default().frame(egui::Frame::NONE.fill(Color32::from_gray(12)));
    panel.show(ui, |ui| {
        let area = ui.available_rect_before_wrap();
        let layout = app.window_state.layout;
        let parts = layout.parts();
        let rectangles = rectangles(area, parts.len(), aspect(app));
        app.shown_at = parts
            .iter()
            .copied()
            .zip(rectangles.iter().copied())
            .collect();
        let Some(first) = rectangles.first().copied() else {
            return;
        };
        app.show_at_hand(ui.ctx());
        wish_size(app, first, ui.ctx().pixels_per_point());
        // Pictures made of both eyes are of frames alone.
        let is_plain = |part: &Part| matches!(part, Part::Left | Part::Right);
        app.is_sketched = app.is_behind() && parts.iter().all(is_plain);
        let last = app.frame.take();
        if app.pictures.show_pixels(app.zoom.is_on())
            && let Some(last) = &last
        {
            app.pictures.take(ui.ctx(), last);
        }
        // Of this scene and these eyes: another one's is no picture of it.
        let frame = last
            .as_deref()
            .filter(|frame| frame.changes >= app.opened_at() && frame.has(app.rendered()));
        let shown = frame.filter(|_| !app.is_sketched);
        let mut has_gizmo = false;
        for (part, rect) in parts.iter().zip(&rectangles) {
            show_part(app, ui, shown, *part, *rect, &mut has_gizmo);
        }
        if !has_gizmo {
            if app.gizmo.is_dragging() {
                app.document.end_gesture();
            }
            app.gizmo.hide();
        }
        let has_frozen = app.frozen.is_some() && parts.iter().all(is_plain);
        if layout == Layout::Split || has_frozen {
            divider(app, ui, first);
        }
        if let Some(frame) = frame {
            show_notes(app, ui, frame, parts, area);
        }
        app.frame = last;
        show_awaited(app, ui, area);
    });
}

/// What is said of a frame across the whole area.
fn show_notes(app: &App, ui: &Ui, frame: &FrameReport, parts: &[Part], area: Rect) {
    let is_other = frame.view_mode != app.view_mode;
    if is_other {
        // Never one view's picture under another's name.
        ui.painter()
            .rect_filled(area, 0.0, Color32::from_black_alpha(200));
        let awaited = app.awaited().unwrap_or_default();
        note(ui.painter(), area, &awaited);
    } else if let Some(legend) = &frame.shown.legend {
        show_legend(ui.painter(), area, &frame.view_mode.name(), legend);
    }
    let notes = parts.iter().filter_map(|part| frame.note(part.eye()));
    if let (Some(text), false) = (notes.into_iter().next(), is_other) {
        note(ui.painter(), area, text);
    }
}

/// What is being waited for, at the lower left.
fn show_awaited(app: &App, ui: &Ui, area: Rect) {
    if let Some(awaited) = app.awaited() {
        let at = area.left_bottom() + vec2(10.0, -10.0);
        let text = format!("{awaited}\u{2026} Esc stops");
        label(ui.painter(), at, Align2::LEFT_BOTTOM, &text);
    }
}

/// The texture that the window draws itself, see [`super::sketch`].
pub fn sketch_texture(eye: usize) -> egui::TextureId {
    egui::TextureId::User(eye as u64)
}

/// Width over height of an eye's picture.
fn aspect(app: &App) -> f32 {
    if let Some([width, height]) = app.settings.size {
        return width as f32 / height as f32;
    }
    let tangents = app.views()[0].fov.tangents();
    ((tangents.right - tangents.left) / (tangents.up - tangents.down)) as f32
}

/// Asks for as many pixels as the picture covers, or as the settings say.
fn wish_size(app: &mut App, rect: Rect, pixels_per_point: f32) {
    app.size = app.settings.size.unwrap_or_else(|| {
        let pixels = rect.size() * pixels_per_point;
        let shrink = (MOST_PIXELS / pixels.max_elem()).min(1.0);
        [pixels.x, pixels.y].map(|edge| {
            let steps = (edge * shrink / SIZE_STEP).round().max(1.0);
            (steps * SIZE_STEP) as u32
        })
    });
}

/// One picture of the layout: of `frame`, or the sketch without one.
fn show_part(
    app: &mut App,
    ui: &mut Ui,
    frame: Option<&FrameReport>,
    part: Part,
    place: Rect,
    has_gizmo: &mut bool,
) {
    let context = ui.ctx().clone();
    let response = ui.allocate_rect(place, Sense::click_and_drag());
    let painter = ui.painter().with_clip_rect(place);
    // The whole picture, of which the clip shows a part.
    let rect = app.zoom.whole(place);
    let draw = |texture: egui::TextureId, clip: Rect| {
        let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
        let painter = ui.painter().with_clip_rect(clip);
        painter.image(texture, rect, whole, Color32::WHITE);
    };
    let texture = match frame {
        Some(frame) => app
            .pictures
            .texture(&context, frame, part)
            .map(|of| of.id()),
        None => app.is_sketched.then(|| sketch_texture(part.eye())),
    };
    if let Some(texture) = texture {
        draw(texture, place);
    }
    let share = app.window_state.divider.clamp(0.0, 1.0);
    let divider_x = place.min.x + place.width() * share;
    let (left, right) = place.split_left_right_at_x(divider_x);
    if app.window_state.layout == Layout::Split
        && let (Some(other), Some(_)) =
            (app.pictures.other(), frame.and_then(|of| of.other.as_ref()))
    {
        draw(other.id(), right);
    }
    if let (Some(frozen), Part::Left | Part::Right) = (&app.frozen, part) {
        // As the picture beside it.
        let frozen = &frozen[part.eye()][usize::from(app.zoom.is_on())];
        draw(frozen.id(), left);
        let top = place.min.y + 30.0;
        label(&painter, pos2(divider_x - 8.0, top), Align2::RIGHT_TOP, "A");
        label(&painter, pos2(divider_x + 8.0, top), Align2::LEFT_TOP, "B");
    }
    let scene = app.document.scene();
    if let Some(frame) = frame
        && let Some(outline) =
            app.pictures
                .outline(&context, frame, &app.selected, scene, part.eye())
    {
        draw(outline.id(), place);
    }
    let handled = handles(app, &painter, frame, part, rect, &response);
    *has_gizmo |= handled.is_some();
    let is_handled = matches!(handled, Some(Handled::Held | Handled::Moved(_)));
    pointer(app, &context, frame, part, rect, &response, is_handled);
    enlarge(app, &context, place, &response, &painter);
    // Of a sketch nobody knows it without a search.
    if let Some(frame) = frame {
        name_under_pointer(app, &painter, frame, part, rect, &response);
    }
}

/// Enlarges what lies under the pointer.
fn enlarge(app: &mut App, context: &Context, place: Rect, response: &Response, painter: &Painter) {
    if let Some(at) = response.hover_pos() {
        let factor = context.input(|input| input.zoom_delta());
        if factor != 1.0 {
            app.zoom.about(factor, place, at);
            context.request_repaint();
        }
    }
    if response.dragged_by(PointerButton::Primary) && shifts_zoom(app, context) {
        app.zoom.shift(response.drag_delta(), place);
    }
    if app.zoom.is_on() {
        let text = format!("{:.1} times, Esc shows all", app.zoom.times());
        let at = place.right_bottom() - vec2(8.0, 8.0);
        label(painter, at, Align2::RIGHT_BOTTOM, &text);
    }
}

/// Whether a drag moves the part that is shown, and not the gaze.
fn shifts_zoom(app: &App, context: &Context) -> bool {
    app.zoom.is_on()
        && !app.gizmo.is_dragging()
        && !app.fields.drags_divider
        && context.input(|input| input.modifiers.command)
}

/// Draws the gizmo into one picture, and carries out what it asks for.
fn handles(
    app: &mut App,
    painter: &Painter,
    frame: Option<&FrameReport>,
    part: Part,
    rect: Rect,
    response: &Response,
) -> Option<Handled> {
    // In a picture made of both eyes the handles would stand in one eye's place only.
    let is_plain = matches!(part, Part::Left | Part::Right);
    let last = app.selected.last();
    let node = last.filter(|_| is_plain && app.player.as_ref().is_none_or(Player::is_left))?;
    let scene = app.document.scene();
    if !scene.reaches(node) || scene.nodes[node].skin.is_some() {
        return None;
    }
    let world_from_node = scene.world_from_node(node);
    // The handles stand in the middle of what is seen, wherever the node's own origin is.
    let pivot_in_node = match app.fields.pivot {
        Some((of, pivot)) if of == node => pivot,
        _ => {
            let middle = scene.bounds_below(node).map(|bounds| bounds.center());
            let node_from_world = world_from_node.inverse();
            let pivot = middle.map_or(DVec3::ZERO, |middle| {
                node_from_world.transform_point3(middle)
            });
            app.fields.pivot = Some((node, pivot));
            pivot
        }
    };
    let world_from_pivot = world_from_node * DAffine3::from_translation(pivot_in_node);
    let context = response.ctx.clone();
    let pointer = context.input(|input| Pointer {
        at: input.pointer.latest_pos(),
        is_over: response.contains_pointer(),
        pressed: input.pointer.primary_pressed(),
        is_down: input.pointer.primary_down(),
        snaps: input.modifiers.command,
    });
    // The gizmo belongs to one picture at a time: the one in which it is dragged, else the one under the pointer.
    let here = pointer
        .at
        .is_some_and(|at| painter.clip_rect().contains(at));
    let is_first = part == app.window_state.layout.parts()[0];
    let owner = app.fields.gizmo_part;
    if app.gizmo.is_dragging() {
        if owner != Some(part) {
            return None;
        }
    } else if here || (is_first && owner.is_none()) {
        app.fields.gizmo_part = Some(part);
    } else if owner != Some(part) {
        return None;
    }
    let was_dragging = app.gizmo.is_dragging();
    let view = &frame.map_or_else(|| app.views(), |frame| frame.views)[part.eye()];
    let handled = app
        .gizmo
        .show(painter, rect, view, world_from_pivot, pointer);
    match (was_dragging, app.gizmo.is_dragging()) {
        (false, true) => app.document.begin_gesture(),
        (true, false) => app.document.end_gesture(),
        _ => {}
    }
    // A click on a handle moves nothing, but for rounding.
    let reach = 1e-12
        * world_from_pivot
            .to_cols_array()
            .into_iter()
            .fold(0.0, |most: f64, x| most.max(x.abs()));
    if let Handled::Moved(moved) = handled
        && !moved.abs_diff_eq(world_from_pivot, reach)
    {
        let world_from_pivot = moved;
        let world_from_node = world_from_pivot * DAffine3::from_translation(-pivot_in_node);
        let moved = app.selected.carry(app.document.scene(), world_from_node);
        if let Some(edit) = moved {
            app.edit(&context, edit);
        }
        context.request_repaint();
    }
    Some(handled)
}

/// Looks, walks and selects.
fn pointer(
    app: &mut App,
    context: &Context,
    frame: Option<&FrameReport>,
    part: Part,
    rect: Rect,
    response: &Response,
    is_handled: bool,
) {
    if response.clicked()
        && !is_handled
        && let Some(at) = response.interact_pointer_pos()
    {
        // Keys move the head again, whatever was written in.
        context.memory_mut(|memory| {
            if let Some(field) = memory.focused() {
                memory.surrender_focus(field);
            }
        });
        let met = surface_at(app, frame, part, place_in(rect, at))
            .map(|(node, _)| node)
            .filter(|node| app.document.scene().reaches(*node));
        app.selected.click(met, selection::adds(context));
        app.tab = super::app::Tab::Inspector;
        app.fields.scroll_to_selected = true;
    }
    let is_free = !is_handled && !app.gizmo.is_dragging() && !app.fields.drags_divider;
    if response.drag_started_by(PointerButton::Middle)
        && let Some(at) = response.interact_pointer_pos()
    {
        // Where there is only sky, what is a room away.
        app.fields.orbit_m = surface_at(app, frame, part, place_in(rect, at))
            .map_or(2.0 * app.camera.speed, |(_, distance_m)| distance_m);
    }
    if response.dragged_by(PointerButton::Middle) {
        let travel = response.drag_delta();
        let travel = [f64::from(travel.x), f64::from(travel.y)];
        if travel != [0.0; 2] {
            app.take_head();
            let modifiers = context.input(|input| input.modifiers);
            let orbit_m = &mut app.fields.orbit_m;
            if modifiers.shift {
                app.camera.pan(travel, *orbit_m);
            } else if modifiers.command {
                *orbit_m = app.camera.approach(travel[1], *orbit_m);
            } else {
                app.camera.orbit(travel, *orbit_m);
            }
        }
    }
    if response.dragged_by(PointerButton::Primary) && is_free && !shifts_zoom(app, context) {
        let travel = response.drag_delta();
        if travel != egui::Vec2::ZERO {
            app.take_head();
            app.camera.look([f64::from(travel.x), f64::from(travel.y)]);
        }
    }
    if response.hovered() {
        let notches = context.input(|input| input.smooth_scroll_delta().y) / 50.0;
        if notches != 0.0 {
            app.take_head();
            app.camera.dolly(f64::from(notches));
        }
    }
}

/// The node whose surface is shown at a place of an eye's picture, by `frame` or by the sketch without one, and its distance,
/// metres.
fn surface_at(
    app: &App,
    frame: Option<&FrameReport>,
    part: Part,
    place: [f32; 2],
) -> Option<(usize, f64)> {
    let eye = part.eye();
    let Some(frame) = frame else {
        return aim::surface_at(app.document.scene(), &app.views()[eye], place);
    };
    let seen = &frame.seen[eye];
    let node = seen.node_at(place)?;
    Some((node, seen.distances_m[seen.pixel_at(place)?].into()))
}

/// From (0, 0) at the top left of `rect` to (1, 1).
fn place_in(rect: Rect, at: Pos2) -> [f32; 2] {
    [
        (at.x - rect.min.x) / rect.width(),
        (at.y - rect.min.y) / rect.height(),
    ]
}

fn name_under_pointer(
    app: &mut App,
    painter: &Painter,
    frame: &FrameReport,
    part: Part,
    rect: Rect,
    response: &Response,
) {
    let Some(at) = response.hover_pos() else {
        return;
    };
    let (eye, at) = (part.eye(), place_in(rect, at));
    let seen = &frame.seen[eye];
    let Some(pixel) = seen.pixel_at(at) else {
        return;
    };
    app.point_at(PicturePlace { eye, at });
    let Some(node) = app.document.scene().nodes.get(seen.nodes[pixel] as usize) else {
        return;
    };
    let mut text = format!("{}, {:.3} m", node.name, seen.distances_m[pixel]);
    let [x, y] = [pixel as u32 % seen.size[0], pixel as u32 / seen.size[0]];
    text += &format!("\npixel {x} {y}");
    let is_of =
        |known: &&PixelRadiance| (known.eye, known.pixel, known.size) == (eye, pixel, seen.size);
    // The device is asked, and soon answers.
    if let Some(known) = frame.radiance.as_ref().filter(is_of) {
        let [r, g, b] = known.radiance;
        text += &format!(": {r:.4} {g:.4} {b:.4} W/(m\u{b2} sr)");
    }
    label(
        painter,
        painter.clip_rect().right_top() + vec2(-8.0, 8.0),
        Align2::RIGHT_TOP,
        &text,
    );
}

fn divider(app: &mut App, ui: &mut Ui, rect: Rect) {
    let x = rect.min.x + rect.width() * app.window_state.divider.clamp(0.0, 1.0);
    let grab = Rect::from_center_size(
        pos2(x, rect.center().y),
        vec2(2.0 * GRAB_POINTS, rect.height()),
    );
    let response = ui
        .interact(grab, ui.scope_id().with("divider"), Sense::drag())
        .on_hover_cursor(egui::CursorIcon::ResizeHorizontal);
    app.fields.drags_divider = response.dragged();
    if response.dragged()
        && let Some(at) = response.interact_pointer_pos()
    {
        app.window_state.divider = place_in(rect, at)[0].clamp(0.0, 1.0);
    }
    let painter = ui.painter();
    painter.vline(x, rect.y_range(), Stroke::new(2.0, Color32::WHITE));
    if app.window_state.layout != Layout::Split {
        return;
    }
    let [ours, theirs] = [&app.settings, &app.other].map(|settings| summary(settings));
    let top = rect.min.y + 30.0;
    label(painter, pos2(x - 8.0, top), Align2::RIGHT_TOP, &ours);
    label(painter, pos2(x + 8.0, top), Align2::LEFT_TOP, &theirs);
}

/// A few words on settings.
fn summary(settings: &crate::settings::Settings) -> String {
    let filtered = if decided(settings).render.reconstruct.is_on() {
        ", filtered"
    } else {
        ""
    };
    format!(
        "{}, {} spp{filtered}",
        settings.render.method, settings.render.spp
    )
}

fn note(painter: &Painter, area: Rect, text: &str) {
    label(painter, area.center(), Align2::CENTER_CENTER, text);
}

/// Text on a dark plate, readable on any picture.
fn label(painter: &Painter, at: Pos2, align: Align2, text: &str) {
    let font = FontId::proportional(13.0);
    let galley = painter.layout_no_wrap(text.to_owned(), font, Color32::WHITE);
    let rect = align.anchor_size(at, galley.size());
    painter.rect_filled(rect.expand(4.0), 3.0, Color32::from_black_alpha(170));
    painter.galley(rect.min, galley, Color32::WHITE);
}

/// What the colours mean, in numbers, at the right edge of the picture's area.
fn show_legend(painter: &Painter, area: Rect, quantity: &str, legend: &Legend) {
    match legend {
        Legend::Bar { unit, ticks, .. } => {
            let bar = Rect::from_min_size(
                area.left_top() + vec2(16.0, 40.0),
                vec2(14.0, (area.height() - 90.0).clamp(40.0, 260.0)),
            );
            painter.rect_filled(
                bar.expand2(vec2(60.0, 26.0)).translate(vec2(50.0, 0.0)),
                3.0,
                Color32::from_black_alpha(150),
            );
            // Bright on top: a value's height is its share of the range.
            let height = |share: f64| bar.max.y - bar.height() * share as f32;
            const STEPS: usize = 64;
            for step in 0..STEPS {
                let [from, to] = [step, step + 1].map(|edge| edge as f64 / STEPS as f64);
                let [r, g, b] = map_color(0.5 * (from + to));
                let cell =
                    Rect::from_min_max(pos2(bar.min.x, height(to)), pos2(bar.max.x, height(from)));
                painter.rect_filled(cell, 0.0, Color32::from_rgb(r, g, b));
            }
            let font = FontId::proportional(12.0);
            let white = Color32::WHITE;
            for (share, text) in ticks {
                let y = height(*share);
                painter.hline(bar.max.x..=bar.max.x + 4.0, y, Stroke::new(1.0, white));
                painter.text(
                    pos2(bar.max.x + 7.0, y),
                    Align2::LEFT_CENTER,
                    text,
                    font.clone(),
                    white,
                );
            }
            painter.text(
                bar.left_top() - vec2(0.0, 8.0),
                Align2::LEFT_BOTTOM,
                match *unit {
                    "" => quantity.to_owned(),
                    unit => format!("{quantity}, {unit}"),
                },
                font,
                white,
            );
        }
        Legend::Labels(labels) => {
            let mut at = area.left_top() + vec2(16.0, 24.0);
            for ([r, g, b], text) in labels {
                let swatch = Rect::from_min_size(at, vec2(12.0, 12.0));
                painter.rect_filled(swatch, 2.0, Color32::from_rgb(*r, *g, *b));
                label(painter, at + vec2(20.0, -2.0), Align2::LEFT_TOP, text);
                at.y += 24.0;
            }
        }
        other => {
            label(
                painter,
                area.left_top() + vec2(16.0, 24.0),
                Align2::LEFT_TOP,
                &other.line(),
            );
        }
    }
}
