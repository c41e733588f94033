//! Looks of the window: egui's dark colours, with text that can be read, and nothing that fades.

use egui::{Color32, Context, Theme};

/// Hints, units and shortcuts: egui's own are 2.7 times as bright as the panels.
const WEAK_TEXT: Color32 = Color32::from_gray(160);
/// Labels.
const TEXT: Color32 = Color32::from_gray(190);

/// Dark, whatever the desktop has: pictures are judged beside it.
pub fn apply(context: &Context) {
    context.set_theme(Theme::Dark);
    context.style_mut_of(Theme::Dark, |style| {
        // On a slow adapter what fades away would still take clicks after it was closed.
        style.animation_time = 0.0;
        let visuals = &mut style.visuals;
        visuals.weak_text_color = Some(WEAK_TEXT);
        visuals.widgets.noninteractive.fg_stroke.color = TEXT;
        visuals.widgets.inactive.fg_stroke.color = Color32::from_gray(200);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Contrast of two opaque colours by WCAG 2.1.
    fn contrast(one: Color32, other: Color32) -> f64 {
        let luminance = |color: Color32| {
            let linear = |byte: u8| {
                let value = f64::from(byte) / 255.0;
                if value <= 0.040_45 {
                    value / 12.92
                } else {
                    ((value + 0.055) / 1.055).powf(2.4)
                }
            };
            0.2126 * linear(color.r()) + 0.7152 * linear(color.g()) + 0.0722 * linear(color.b())
        };
        let [one, other] = [luminance(one), luminance(other)];
        (one.max(other) + 0.05) / (one.min(other) + 0.05)
    }

    #[test]
    fn all_text_has_a_contrast_of_at_least_4_5() {
        assert!((contrast(Color32::WHITE, Color32::BLACK) - 21.0).abs() < 1e-9);
        let context = Context::default();
        let least = |context: &Context| {
            let visuals = context.style_of(Theme::Dark).visuals.clone();
            let widgets = &visuals.widgets;
            [
                (visuals.weak_text_color(), visuals.panel_fill),
                (visuals.weak_text_color(), visuals.window_fill),
                (visuals.text_color(), visuals.panel_fill),
                (widgets.inactive.text_color(), widgets.inactive.weak_bg_fill),
                (widgets.hovered.text_color(), widgets.hovered.weak_bg_fill),
                (widgets.active.text_color(), widgets.active.weak_bg_fill),
                (visuals.selection.stroke.color, visuals.selection.bg_fill),
                (visuals.weak_text_color(), visuals.extreme_bg_color),
            ]
            .map(|(text, ground)| contrast(text, ground))
            .into_iter()
            .fold(f64::INFINITY, f64::min)
        };
        assert!(least(&context) < 4.5, "egui's own would do");
        apply(&context);
        assert!(least(&context) >= 4.5, "{}", least(&context));
    }
}
