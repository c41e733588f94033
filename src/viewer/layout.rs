//! How two eyes' pictures share one area.

use egui::{Color32, ColorImage, Rect, pos2, vec2};
use serde::{Deserialize, Serialize};

use crate::settings::Eyes;

stereolux_base::words! {
    /// What the picture area shows.
    #[derive(Default, Serialize, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum Layout: name {
        /// The left eye's picture.
        Left = "Left eye",
        /// The right eye's picture.
        Right = "Right eye",
        /// Both, the left eye's on the left.
        #[default]
        SideBySide = "Side by side",
        /// Both, the left eye's on the right: crossing one's eyes fuses them.
        CrossEye = "Cross-eye",
        /// Red from the left eye, green and blue from the right, for red-cyan glasses.
        Anaglyph = "Anaglyph",
        /// How far the two pictures are apart, pixel by pixel.
        Difference = "Difference",
        /// The left eye under two methods or settings, with a divider between them.
        Split = "Split",
    }
}

impl Layout {
    /// The eyes that it shows. A right eye that `reuses` needs the left one.
    pub fn eyes(self, reuses: bool) -> Eyes {
        match self {
            Self::Left | Self::Split => Eyes::Left,
            Self::Right if !reuses => Eyes::Right,
            _ => Eyes::Both,
        }
    }

    /// One line on what it shows.
    pub fn about(self) -> &'static str {
        match self {
            Self::Left => "what the left eye sees",
            Self::Right => "what the right eye sees",
            Self::SideBySide => "both eyes, left on the left",
            Self::CrossEye => "both eyes, left on the right: cross your eyes to fuse them",
            Self::Anaglyph => "red from the left eye, green and blue from the right",
            Self::Difference => "difference of the two eyes' pictures, pixel by pixel",
            Self::Split => "the left eye with two methods or settings; drag the line between",
        }
    }

    /// What is drawn, in order. A pixel of the picture is that of the eye named.
    pub fn parts(self) -> &'static [Part] {
        match self {
            Self::Left | Self::Split => &[Part::Left],
            Self::Right => &[Part::Right],
            Self::SideBySide => &[Part::Left, Part::Right],
            Self::CrossEye => &[Part::Right, Part::Left],
            Self::Anaglyph => &[Part::Anaglyph],
            Self::Difference => &[Part::Difference],
        }
    }
}

/// A picture among those of a layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// The left eye's.
    Left,
    /// The right eye's.
    Right,
    /// Made of both.
    Anaglyph,
    /// Made of both.
    Difference,
}

impl Part {
    /// The eye that a click in it means, 0 left or 1 right. Pictures made of both go by the left.
    pub fn eye(self) -> usize {
        usize::from(self == Self::Right)
    }
}

/// Space between two pictures, points.
const GAP_POINTS: f32 = 2.0;

/// Where `count` pictures of one aspect ratio (width over height) lie side by side, as large as they fit in the middle of
/// `area`.
pub fn rectangles(area: Rect, count: usize, aspect: f32) -> Vec<Rect> {
    if count == 0 || !area.is_positive() || !(aspect.is_finite() && aspect > 0.0) {
        return Vec::new();
    }
    let gaps = GAP_POINTS * (count - 1) as f32;
    let width = ((area.width() - gaps) / count as f32)
        .min(area.height() * aspect)
        .max(1.0);
    let size = vec2(width, width / aspect);
    let left = area.center().x - 0.5 * (width * count as f32 + gaps);
    let top = area.center().y - 0.5 * size.y;
    (0..count)
        .map(|index| {
            let x = left + index as f32 * (width + GAP_POINTS);
            Rect::from_min_size(pos2(x, top), size)
        })
        .collect()
}

/// Red from `left`, green and blue from `right`. Both of one size.
pub fn anaglyph(left: &ColorImage, right: &ColorImage) -> ColorImage {
    combine(left, right, |left, right| {
        Color32::from_rgb(left.r(), right.g(), right.b())
    })
}

/// Absolute difference of each channel. Both of one size.
pub fn difference(left: &ColorImage, right: &ColorImage) -> ColorImage {
    combine(left, right, |left, right| {
        Color32::from_rgb(
            left.r().abs_diff(right.r()),
            left.g().abs_diff(right.g()),
            left.b().abs_diff(right.b()),
        )
    })
}

fn combine(
    left: &ColorImage,
    right: &ColorImage,
    of: impl Fn(Color32, Color32) -> Color32,
) -> ColorImage {
    let pixels = left
        .pixels
        .iter()
        .zip(&right.pixels)
        .map(|(left, right)| of(*left, *right))
        .collect();
    ColorImage::new(left.size, pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_keep_their_shape_and_lie_side_by_side_in_the_middle() {
        let area = Rect::from_min_size(pos2(10.0, 20.0), vec2(802.0, 300.0));
        let two = rectangles(area, 2, 2.0);
        assert_eq!(two[0].size(), vec2(400.0, 200.0));
        assert_eq!(two[1].min.x - two[0].max.x, GAP_POINTS);
        assert_eq!(two[0].min, pos2(10.0, 70.0));
        let tall = rectangles(area, 1, 0.5);
        assert_eq!(tall[0].size(), vec2(150.0, 300.0));
        assert_eq!(tall[0].center(), area.center());
        assert!(rectangles(Rect::NOTHING, 1, 1.0).is_empty());
        assert!(rectangles(area, 1, f32::NAN).is_empty());
    }

    #[test]
    fn anaglyph_and_difference_take_each_channel_from_where_they_say() {
        let left = ColorImage::new([1, 1], vec![Color32::from_rgb(10, 20, 30)]);
        let right = ColorImage::new([1, 1], vec![Color32::from_rgb(40, 50, 25)]);
        assert_eq!(
            anaglyph(&left, &right).pixels[0],
            Color32::from_rgb(10, 50, 25)
        );
        assert_eq!(
            difference(&left, &right).pixels[0],
            Color32::from_rgb(30, 30, 5)
        );
    }

    #[test]
    fn cross_eye_exchanges_the_eyes_and_clicks_find_the_right_one() {
        assert_eq!(Layout::CrossEye.parts(), [Part::Right, Part::Left]);
        assert_eq!(Layout::CrossEye.parts()[0].eye(), 1);
        assert_eq!(Layout::Anaglyph.parts()[0].eye(), 0);
        assert_eq!(Layout::Right.eyes(false), Eyes::Right);
        for layout in Layout::ALL {
            let needed = layout.eyes(true);
            let is_left = layout.parts() == [Part::Left];
            assert_eq!(needed, if is_left { Eyes::Left } else { Eyes::Both });
            assert!(!layout.parts().is_empty(), "{}", layout.name());
        }
    }
}
