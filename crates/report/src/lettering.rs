//! Letters of a bitmap. The plotting library leaves out the room that a font gives each letter on its left, and cuts its
//! place to whole pixels, so that words grow together.

use ab_glyph::{Font as _, FontRef, ScaleFont as _, point};
use plotters::prelude::{BitMapBackend, DrawingBackend};
use plotters_backend::text_anchor::{HPos, VPos};
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingErrorKind,
};

/// A bitmap with letters of `font`.
pub struct Lettered<'a> {
    bitmap: BitMapBackend<'a>,
    font: FontRef<'static>,
}

impl<'a> Lettered<'a> {
    /// # Errors
    /// The font's bytes are none.
    pub fn new(bitmap: BitMapBackend<'a>, font: &'static [u8]) -> Result<Self, String> {
        let font = FontRef::try_from_slice(font).map_err(|error| error.to_string())?;
        Ok(Self { bitmap, font })
    }

    /// Pixels of a line of text and how much of each it covers; its baseline begins at the origin.
    fn cover(&self, text: &str, size: f32) -> (f32, Vec<(i32, i32, f32)>) {
        let font = self.font.as_scaled(size);
        let (mut x, mut before) = (0.0, None);
        let mut covered = Vec::new();
        for letter in text.chars() {
            let id = font.glyph_id(letter);
            x += before.map_or(0.0, |before| font.kern(before, id));
            let glyph = id.with_scale_and_position(size, point(x, 0.0));
            if let Some(outline) = font.outline_glyph(glyph) {
                let corner = outline.px_bounds().min;
                let [left, top] = [corner.x as i32, corner.y as i32];
                outline.draw(|x, y, share| covered.push((left + x as i32, top + y as i32, share)));
            }
            x += font.h_advance(id);
            before = Some(id);
        }
        (x, covered)
    }
}

type Drawn<'a> = Result<(), DrawingErrorKind<<BitMapBackend<'a> as DrawingBackend>::ErrorType>>;

impl<'a> DrawingBackend for Lettered<'a> {
    type ErrorType = <BitMapBackend<'a> as DrawingBackend>::ErrorType;

    fn get_size(&self) -> (u32, u32) {
        self.bitmap.get_size()
    }

    fn ensure_prepared(&mut self) -> Drawn<'a> {
        self.bitmap.ensure_prepared()
    }

    fn present(&mut self) -> Drawn<'a> {
        self.bitmap.present()
    }

    fn draw_pixel(&mut self, at: BackendCoord, color: BackendColor) -> Drawn<'a> {
        self.bitmap.draw_pixel(at, color)
    }

    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> Drawn<'a> {
        self.bitmap.draw_line(from, to, style)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        upper_left: BackendCoord,
        lower_right: BackendCoord,
        style: &S,
        fill: bool,
    ) -> Drawn<'a> {
        self.bitmap.draw_rect(upper_left, lower_right, style, fill)
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        at: BackendCoord,
    ) -> Drawn<'a> {
        let size = style.size() as f32;
        let (width, covered) = self.cover(text, size);
        // Three quarters of the size hold capitals and what hangs below the line.
        let (height, baseline) = (0.8 * size, 0.6 * size);
        let left = match style.anchor().h_pos {
            HPos::Left => 0.0,
            HPos::Center => -0.5 * width,
            HPos::Right => -width,
        };
        let top = match style.anchor().v_pos {
            VPos::Top => 0.0,
            VPos::Center => -0.5 * height,
            VPos::Bottom => -height,
        };
        let [left, top] = [left, top + baseline].map(|shift| shift.round() as i32);
        let (transform, color) = (style.transform(), style.color());
        let (wide, high) = self.get_size();
        for (x, y, share) in covered {
            let (x, y) = transform.transform(x + left, y + top);
            let (x, y) = (at.0 + x, at.1 + y);
            let alpha = color.alpha * f64::from(share.clamp(0.0, 1.0));
            if (0..wide as i32).contains(&x) && (0..high as i32).contains(&y) {
                self.draw_pixel((x, y), BackendColor { alpha, ..color })?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A gap between two words is a blank as wide as the font says, give or take the letters' own sides.
    #[test]
    fn words_stand_apart() {
        let mut pixels = vec![0; 3];
        let bitmap = BitMapBackend::with_buffer(&mut pixels, (1, 1));
        let lettered = Lettered::new(bitmap, epaint_default_fonts::UBUNTU_LIGHT).unwrap();
        let columns = |text: &str| {
            let (_, covered) = lettered.cover(text, 16.0);
            let mut columns: Vec<i32> = covered
                .iter()
                .filter(|(_, _, share)| *share > 0.1)
                .map(|(x, _, _)| *x)
                .collect();
            columns.sort_unstable();
            columns.dedup();
            columns
        };
        let widest = |text: &str| {
            let columns = columns(text);
            columns.windows(2).map(|pair| pair[1] - pair[0] - 1).max()
        };
        let within = widest("photonpaths").unwrap();
        let between = widest("photon paths").unwrap();
        let advance = lettered.font.as_scaled(16.0);
        let space = advance.h_advance(lettered.font.glyph_id(' '));
        assert!(
            between >= within + space as i32,
            "{within} {between} {space}"
        );
    }
}
