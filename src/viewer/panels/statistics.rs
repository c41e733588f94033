//! What the last frames cost, and what became of the right eye's pixels.

use egui::{Color32, Grid, Panel, RichText, ScrollArea, Ui};
use egui_plot::{AxisHints, HLine, Line, Plot, PlotPoints};

use crate::frame_loop::FrameStats;
use crate::settings::Eyes;
use crate::viewer::app::App;
use crate::viewer::frames::FrameReport;

/// Parts of a frame, as the history keeps them.
const PARTS: [(&str, Color32); 4] = [
    ("photons", Color32::from_rgb(240, 180, 60)),
    ("left eye", Color32::from_rgb(90, 160, 240)),
    ("right eye", Color32::from_rgb(230, 90, 90)),
    ("reconstruction", Color32::from_rgb(120, 200, 120)),
];

/// The headset's time for a frame.
const BUDGET: Color32 = Color32::from_rgb(235, 235, 130);

/// The bottom panel.
pub fn show(app: &mut App, ui: &mut Ui) {
    Panel::bottom("status").show(ui, |ui| status(app, ui));
    if !app.window_state.statistics {
        return;
    }
    Panel::bottom("statistics")
        .resizable(true)
        .default_size(150.0)
        .max_size(super::MOST_OF_WINDOW * ui.ctx().content_rect().height())
        .show(ui, |ui| {
            ScrollArea::both().auto_shrink(false).show(ui, |ui| {
                ui.horizontal_top(|ui| {
                    plot(app, ui);
                    if let Some(frame) = &app.frame {
                        ui.separator();
                        passes(&frame.stats, ui);
                        ui.separator();
                        counts(frame, ui);
                        ui.separator();
                        budget(app, frame, ui);
                    }
                });
            });
        });
}

/// One line on what is seen.
fn status(app: &App, ui: &mut Ui) {
    let Some(frame) = &app.frame else {
        ui.weak("no frame yet");
        return;
    };
    let [width, height] = frame.size;
    let kind = if frame.is_full { "" } else { ", preview" };
    let times = &frame.stats.gpu_ms;
    let reuse = frame.stats.stereo.reuse_fraction;
    ui.horizontal(|ui| {
        ui.label(format!("{width} x {height} per eye{kind}"));
        ui.separator();
        let plural = if frame.frames == 1 { "" } else { "s" };
        ui.label(format!("{} frame{plural} averaged", frame.frames));
        if app.is_stopped {
            ui.separator();
            ui.strong("stopped")
                .on_hover_text("any change goes on with it");
        }
        ui.separator();
        ui.label(format!("{:.1} ms of passes", times.total));
        if frame.rendered == Eyes::Both {
            ui.separator();
            ui.label(format!("reuse {:.1} %", 100.0 * reuse));
        }
        let scene = app.document.scene();
        ui.separator();
        ui.label(format!("{} triangles", scene.triangle_count()));
        ui.separator();
        ui.label(format!("walks at {:.2} m/s", app.speed_m_per_s(ui.ctx())))
            .on_hover_text("[ and ] change it; Shift runs, Alt is slow");
        if let Some(awaited) = app.awaited() {
            ui.separator();
            ui.strong(awaited);
        }
    });
}

/// Times of the last frames on a logarithmic scale, so that the budget is seen beside frames of seconds.
fn plot(app: &App, ui: &mut Ui) {
    let budget_ms = 1e3 / app.headset.refresh_hz;
    ui.vertical(|ui| {
        ui.horizontal(|ui| {
            ui.label("ms:");
            for (name, color) in PARTS {
                ui.colored_label(color, name);
            }
            ui.colored_label(BUDGET, format!("- budget {budget_ms:.1}"));
        });
        Plot::new("times")
            .width(400.0)
            .height(120.0)
            .include_y(0.0)
            // All marks: the label of one beyond would stand in the legend.
            .include_y(5.0)
            .allow_drag(false)
            .allow_zoom(false)
            .allow_scroll(false)
            .y_grid_spacer(|_| {
                (0..6)
                    .map(|power| egui_plot::GridMark {
                        value: f64::from(power),
                        step_size: 1.0,
                    })
                    .collect()
            })
            .custom_y_axes(vec![
                // A label for each power of ten, however low the chart is.
                AxisHints::new_y()
                    .label_spacing(1.0..=2.0)
                    .formatter(|mark, _| format!("{}", 10_f64.powf(mark.value).round())),
            ])
            .show_x(false)
            .show_axes([false, true])
            .show(ui, |plot| {
                for (part, (name, color)) in PARTS.into_iter().enumerate() {
                    let points: PlotPoints<'_> = app
                        .history
                        .iter()
                        .enumerate()
                        // What takes less than a tenth of a millisecond lies on the floor.
                        .map(|(index, ms)| [index as f64, f64::from(ms[part]).max(0.1).log10()])
                        .collect();
                    plot.line(Line::new(name, points).color(color));
                }
                let line = HLine::new("budget", budget_ms.log10()).color(BUDGET);
                plot.hline(line.width(2.0));
            });
    });
}

fn passes(stats: &FrameStats, ui: &mut Ui) {
    let mut passes: Vec<(&String, &f64)> = stats.pass_ms.iter().collect();
    passes.sort_by(|a, b| b.1.total_cmp(a.1));
    let rows = passes.into_iter();
    let rows = rows.map(|(name, ms)| (name.as_str(), format!("{ms:8.3}")));
    table(ui, "Passes of the last frame, ms", rows);
}

fn counts(frame: &FrameReport, ui: &mut Ui) {
    let (stereo, photons) = (&frame.stats.stereo, &frame.stats.photons);
    let because = &stereo.filled_because;
    let rows = [
        ("Left hits", stereo.left_hits.to_string()),
        ("Scattered", stereo.scattered.to_string()),
        ("Reused", stereo.reused.to_string()),
        ("Reuse fraction", format!("{:.4}", stereo.reuse_fraction)),
        ("Filled", stereo.filled.to_string()),
        ("  out of left view", because.out_of_left_view.to_string()),
        ("  disoccluded", because.disoccluded.to_string()),
        ("  edge", because.edge.to_string()),
        ("  view dependent", because.view_dependent.to_string()),
        ("  gap", because.gap.to_string()),
        ("Photons emitted", photons.map.emitted.to_string()),
        ("Photons stored", photons.map.stored.to_string()),
        ("Photons dropped", photons.map.dropped.to_string()),
    ];
    table(ui, "Stereo reuse and photons", rows);
}

fn table<'a>(ui: &mut Ui, title: &str, rows: impl IntoIterator<Item = (&'a str, String)>) {
    ui.vertical(|ui| {
        ui.label(RichText::new(title).strong());
        Grid::new(title).num_columns(2).show(ui, |ui| {
            for (name, value) in rows {
                ui.label(name);
                ui.monospace(value);
                ui.end_row();
            }
        });
    });
}

fn budget(app: &App, frame: &FrameReport, ui: &mut Ui) {
    let headset = &app.headset;
    let budget_ms = 1e3 / headset.refresh_hz;
    let total_ms = frame.stats.gpu_ms.total;
    let pixels = |size: [u32; 2]| f64::from(size[0]) * f64::from(size[1]);
    ui.vertical(|ui| {
        ui.label(RichText::new("Frame budget").strong());
        ui.label(format!(
            "{}: {:.0} Hz, {budget_ms:.2} ms",
            headset.name, headset.refresh_hz
        ));
        ui.label(format!(
            "last frame: {:.1} times the budget",
            total_ms / budget_ms
        ));
        let share = pixels(frame.size) / pixels(headset.size);
        ui.label(format!("at {:.1} % of the headset's pixels", 100.0 * share));
        if let Some(bytes) = frame.device_bytes {
            ui.label(format!("device memory: {:.1} MB", bytes as f64 / 1e6));
        }
    });
}
