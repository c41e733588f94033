//! A part of the pictures, enlarged, so that pixels can be looked at one by one.

use egui::{Pos2, Rect, Vec2};

/// At most so many times as large.
const MOST: f32 = 64.0;

/// The part of a picture that fills its place on the screen; the same for all pictures of a layout.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Zoom {
    /// Times as large.
    times: f32,
    /// Upper left corner of the part, from (0, 0) to (1, 1) of the picture.
    corner: Vec2,
}

impl Default for Zoom {
    /// All of it.
    fn default() -> Self {
        Self {
            times: 1.0,
            corner: Vec2::ZERO,
        }
    }
}

impl Zoom {
    /// Times as large.
    pub fn times(&self) -> f32 {
        self.times
    }

    /// Whether only a part is shown.
    pub fn is_on(&self) -> bool {
        self.times > 1.0
    }

    /// Where the whole picture lies, of which a part is seen in `place`.
    pub fn whole(&self, place: Rect) -> Rect {
        let size = place.size() * self.times;
        Rect::from_min_size(place.min - self.corner * size, size)
    }

    /// Enlarges by `factor`; what lies at `at` stays there.
    pub fn about(&mut self, factor: f32, place: Rect, at: Pos2) {
        let whole = self.whole(place);
        let fixed = (at - whole.min) / whole.size();
        self.times = (self.times * factor).clamp(1.0, MOST);
        self.corner = fixed - (at - place.min) / (place.size() * self.times);
        self.stay_within();
    }

    /// Moves what is shown along with the pointer.
    pub fn shift(&mut self, travel: Vec2, place: Rect) {
        self.corner -= travel / (place.size() * self.times);
        self.stay_within();
    }

    fn stay_within(&mut self) {
        let last = Vec2::splat(1.0 - 1.0 / self.times);
        self.corner = self.corner.clamp(Vec2::ZERO, last);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::{pos2, vec2};

    #[test]
    fn what_is_under_the_pointer_stays_and_nothing_beyond_the_picture_is_shown() {
        let place = Rect::from_min_size(pos2(100.0, 50.0), vec2(400.0, 200.0));
        let mut zoom = Zoom::default();
        assert_eq!(zoom.whole(place), place);
        let at = pos2(180.0, 200.0);
        let share = |zoom: &Zoom| {
            let whole = zoom.whole(place);
            (at - whole.min) / whole.size()
        };
        let before = share(&zoom);
        for factor in [2.0, 1.7, 3.0, 0.5] {
            zoom.about(factor, place, at);
            // Half units of f32 on some hundred points, over some hundred points.
            assert!((share(&zoom) - before).length() < 1e-5, "{zoom:?}");
        }
        // A pixel of travel is a pixel on the screen, and at the picture's edge there is none.
        let left = zoom.whole(place).min;
        zoom.shift(vec2(7.0, -3.0), place);
        assert!((zoom.whole(place).min - left - vec2(7.0, -3.0)).length() < 1e-3);
        for travel in [vec2(1e6, 1e6), vec2(-1e6, -1e6)] {
            zoom.shift(travel, place);
            assert!(
                zoom.whole(place).expand(1e-2).contains_rect(place),
                "{zoom:?}"
            );
        }
        zoom.about(1e-9, place, at);
        assert_eq!(zoom.whole(place), place);
        zoom.about(1e9, place, at);
        assert_eq!(zoom.times(), MOST);
    }
}
