//! The textures of a frame: the eyes, what is made of both, and the outline of the selection.

use std::sync::Arc;

use egui::{Color32, ColorImage, Context, TextureHandle, TextureOptions};

use super::frames::{FrameReport, Seen};
use super::layout::{Part, anaglyph, difference};
use super::selection::Selection;
use crate::scene::Scene;

/// Colour of what is selected.
const SELECTED: Color32 = Color32::from_rgb(255, 170, 30);

/// Textures of the last frame.
#[derive(Default)]
pub struct Pictures {
    eyes: [Option<TextureHandle>; 2],
    other: Option<TextureHandle>,
    combined: Option<(Part, u32, TextureHandle)>,
    outlines: [Option<TextureHandle>; 2],
    /// Frame and nodes.
    outlined: Option<(u32, Vec<usize>)>,
    shows_pixels: bool,
}

fn put(
    context: &Context,
    slot: &mut Option<TextureHandle>,
    name: &str,
    image: Arc<ColorImage>,
    options: TextureOptions,
) {
    match slot {
        Some(texture) => texture.set(image, options),
        None => *slot = Some(context.load_texture(name, image, options)),
    }
}

impl Pictures {
    /// From now on pixels are squares, or blend into one another; true if that is a change, which frames have to be taken
    /// anew for.
    pub fn show_pixels(&mut self, shows_pixels: bool) -> bool {
        let is_new = self.shows_pixels != shows_pixels;
        if is_new {
            self.shows_pixels = shows_pixels;
            self.combined = None;
            self.outlined = None;
        }
        is_new
    }

    fn options(&self) -> TextureOptions {
        if self.shows_pixels {
            TextureOptions::NEAREST
        } else {
            TextureOptions::LINEAR
        }
    }

    /// Takes a new frame over.
    pub fn take(&mut self, context: &Context, frame: &FrameReport) {
        // The same frame may show another view now.
        self.combined = None;
        let options = self.options();
        for (eye, name) in ["left eye", "right eye"].into_iter().enumerate() {
            put(
                context,
                &mut self.eyes[eye],
                name,
                Arc::clone(&frame.shown.eyes[eye]),
                options,
            );
        }
        if let Some(other) = &frame.other {
            put(
                context,
                &mut self.other,
                "other settings",
                Arc::clone(other),
                options,
            );
        }
    }

    /// The left eye under the other settings, of the last frame that had it.
    pub fn other(&self) -> Option<&TextureHandle> {
        self.other.as_ref()
    }

    /// What `part` shows of `frame`.
    pub fn texture(
        &mut self,
        context: &Context,
        frame: &FrameReport,
        part: Part,
    ) -> Option<TextureHandle> {
        match part {
            Part::Left | Part::Right => self.eyes[part.eye()].clone(),
            Part::Anaglyph | Part::Difference => {
                if let Some((of, index, texture)) = &self.combined
                    && (*of, *index) == (part, frame.index)
                {
                    return Some(texture.clone());
                }
                let combine = if part == Part::Anaglyph {
                    anaglyph
                } else {
                    difference
                };
                let image = combine(&frame.shown.eyes[0], &frame.shown.eyes[1]);
                let texture = context.load_texture("both eyes", image, self.options());
                self.combined = Some((part, frame.index, texture.clone()));
                Some(texture)
            }
        }
    }

    /// Outline of the selection and what hangs below it, as that eye sees it.
    pub fn outline(
        &mut self,
        context: &Context,
        frame: &FrameReport,
        selected: &Selection,
        scene: &Scene,
        eye: usize,
    ) -> Option<TextureHandle> {
        selected.last()?;
        let is_known = self.outlined.as_ref().is_some_and(|(index, nodes)| {
            *index == frame.index && nodes.as_slice() == selected.nodes()
        });
        if !is_known {
            let is_inside = selected.covered(scene)?;
            self.outlined = Some((frame.index, selected.nodes().to_vec()));
            let options = self.options();
            for eye in (0..2).filter(|eye| frame.stands_for(*eye) == *eye) {
                let image = outline_image(&frame.seen[eye], &is_inside);
                put(
                    context,
                    &mut self.outlines[eye],
                    "outline",
                    Arc::new(image),
                    options,
                );
            }
        }
        self.outlines[eye].clone()
    }
}

/// Transparent but for the pixels of the selection that touch others.
fn outline_image(seen: &Seen, is_inside: &[bool]) -> ColorImage {
    let [width, height] = seen.size.map(|edge| edge as usize);
    let inside = |x: usize, y: usize| {
        let node = seen.nodes[y * width + x];
        is_inside.get(node as usize).copied().unwrap_or(false)
    };
    let pixels = (0..width * height)
        .map(|index| {
            let (x, y) = (index % width, index / width);
            let is_edge = inside(x, y)
                && (x == 0
                    || y == 0
                    || x + 1 == width
                    || y + 1 == height
                    || !inside(x - 1, y)
                    || !inside(x + 1, y)
                    || !inside(x, y - 1)
                    || !inside(x, y + 1));
            if is_edge {
                SELECTED
            } else {
                Color32::TRANSPARENT
            }
        })
        .collect();
    ColorImage::new([width, height], pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outlines_are_the_inner_rim_of_the_selection() {
        // A 5x5 image in which node 1 covers the 3x3 middle.
        let nodes = (0..25)
            .map(|i| u32::from((1..4).contains(&(i % 5)) && (1..4).contains(&(i / 5))))
            .collect();
        let seen = Seen {
            size: [5, 5],
            nodes,
            distances_m: vec![1.0; 25],
            ..Seen::default()
        };
        let image = outline_image(&seen, &[false, true]);
        let marked: Vec<usize> = (0..25).filter(|i| image.pixels[*i] == SELECTED).collect();
        assert_eq!(
            marked,
            [6, 7, 8, 11, 13, 16, 17, 18],
            "all but the middle one"
        );
        let none = outline_image(&seen, &[false, false]);
        assert!(
            none.pixels
                .iter()
                .all(|pixel| *pixel == Color32::TRANSPARENT)
        );
    }
}
