//! Both eyes' pictures of one view, by whoever has what they are made of: the rendering thread, or the window from a frame
//! that it has already.

use std::sync::Arc;

use egui::{Color32, ColorImage};

use super::frames::{FrameReport, Seen, ViewMode};
use crate::false_color::{self, Coloring, Legend, Picture};
use crate::images::{ImageError, ImageRgb8};
use crate::renderer::{Eye, Inspected, InspectedValues, Inspection};

/// Pixels of a picture that is kept in stock, at most; larger ones are kept coarser.
const MOST_KEPT_PIXELS: usize = 512 * 512;

/// What is said of the error before there is one.
pub const NO_REFERENCE: &str = "the reference begins once the view stands still";

/// See the module.
#[derive(Clone, Debug, PartialEq)]
pub struct ViewPictures {
    /// Left and right eye. One that was not rendered has the other's.
    pub eyes: [Arc<ColorImage>; 2],
    /// What the colours mean, if they are false.
    pub legend: Option<Legend>,
    /// A line that is said of an eye's picture, such as why there is nothing to see.
    pub notes: [Option<String>; 2],
}

/// An eye's picture, what its colours mean if they are false, and what is said of it.
pub type Colored = (Arc<ColorImage>, Option<Legend>, Option<String>);

/// With a legend.
pub fn with_legend(picture: Picture) -> Colored {
    (
        Arc::new(color_image(&picture.image)),
        Some(picture.legend),
        None,
    )
}

/// Colours of a view's values on the scale of `first`, if there is one: both eyes share one scale, or they could not be
/// compared.
///
/// # Errors
/// [`ImageError::Shape`] if values and size do not go together.
pub fn color(inspected: &Inspected, first: Option<&Legend>) -> Result<Colored, ImageError> {
    let coloring = shared(Coloring::of(inspected.inspection), first);
    Ok(with_legend(false_color::picture(inspected, coloring)?))
}

/// The second eye takes the first one's scale.
pub fn shared(coloring: Coloring, first: Option<&Legend>) -> Coloring {
    let range = match first {
        Some(Legend::Bar { range, .. }) => Some(*range),
        Some(Legend::White { white, .. }) => Some([0.0, *white]),
        Some(Legend::Wheel { longest, .. }) => Some([0.0, *longest]),
        _ => None,
    };
    Coloring { range, ..coloring }
}

impl ViewPictures {
    /// Of the eyes for which `of` has one; it is given the eye, 0 left or 1 right, and the first one's legend. `None` if it
    /// has none.
    ///
    /// # Errors
    /// Those of `of`.
    pub fn make<E>(
        mut of: impl FnMut(usize, Option<&Legend>) -> Result<Option<Colored>, E>,
    ) -> Result<Option<Self>, E> {
        let mut eyes = [None, None];
        let mut notes = [None, None];
        let mut legend = None;
        for eye in 0..2 {
            if let Some((image, own_legend, note)) = of(eye, legend.as_ref())? {
                eyes[eye] = Some(image);
                notes[eye] = note;
                legend = legend.or(own_legend);
            }
        }
        let any = eyes.iter().flatten().next().cloned();
        Ok(any.map(|any| Self {
            eyes: eyes.map(|picture| picture.unwrap_or_else(|| Arc::clone(&any))),
            legend,
            notes,
        }))
    }

    /// Of a frame that shows something else, where it brought what they are made of: the picture, and the surfaces that its
    /// pixels see.
    pub fn of_frame(frame: &FrameReport, mode: ViewMode) -> Option<Self> {
        let made = Self::make(|eye, first| {
            if frame.stands_for(eye) != eye {
                return Ok(None);
            }
            let shown = frame.pictures[eye].clone();
            match mode {
                ViewMode::Picture => Ok(shown.map(|picture| (picture, None, None))),
                ViewMode::Inspection(inspection) => frame.seen[eye]
                    .inspected(inspection, Eye::ALL[eye])
                    .map(|inspected| color(&inspected, first))
                    .transpose(),
                ViewMode::Error => {
                    let why = NO_REFERENCE.to_owned();
                    Ok(shown.map(|picture| (picture, None, Some(why))))
                }
            }
        });
        match made {
            Ok(pictures) => pictures,
            Err(error) => {
                log::debug!("{}: {error}", mode.name());
                None
            }
        }
    }

    /// As fine as is kept in stock.
    #[must_use]
    pub fn kept(self) -> Self {
        Self {
            eyes: self.eyes.map(|picture| coarser(&picture)),
            ..self
        }
    }
}

/// Every so manieth pixel of a large picture: false colours have no mean.
fn coarser(picture: &Arc<ColorImage>) -> Arc<ColorImage> {
    let [width, height] = picture.size;
    let mut step = 1;
    while width.div_ceil(step) * height.div_ceil(step) > MOST_KEPT_PIXELS {
        step += 1;
    }
    if step == 1 {
        return Arc::clone(picture);
    }
    let rows = (0..height).step_by(step);
    let pixels = rows.flat_map(|y| {
        let row = &picture.pixels[y * width..(y + 1) * width];
        row.iter().step_by(step).copied()
    });
    let size = [width.div_ceil(step), height.div_ceil(step)];
    Arc::new(ColorImage::new(size, pixels.collect()))
}

/// Pictures of views that nothing was asked of yet, of the frames with one [`FrameReport::picture`].
#[derive(Default)]
pub struct Stock {
    picture: u64,
    views: Vec<(ViewMode, ViewPictures)>,
}

impl Stock {
    /// Keeps a view of frames of `picture`; those of other frames are let go.
    pub fn put(&mut self, picture: u64, mode: ViewMode, pictures: ViewPictures) {
        if self.picture != picture {
            self.picture = picture;
            self.views.clear();
        }
        self.views.retain(|(known, _)| *known != mode);
        self.views.push((mode, pictures));
    }

    /// The view of frames of `picture`, if it is kept.
    pub fn get(&self, picture: u64, mode: ViewMode) -> Option<&ViewPictures> {
        let mut views = self.views.iter().filter(|_| self.picture == picture);
        views
            .find(|(known, _)| *known == mode)
            .map(|(_, pictures)| pictures)
    }
}

impl Seen {
    /// Whether a view shows nothing but what is kept here.
    pub fn holds(inspection: Inspection) -> bool {
        matches!(
            inspection,
            Inspection::Albedo
                | Inspection::Normal
                | Inspection::Depth
                | Inspection::Instance
                | Inspection::BvhSteps
        )
    }

    /// The values of such a view.
    pub fn inspected(&self, inspection: Inspection, eye: Eye) -> Option<Inspected> {
        let values = match inspection {
            Inspection::Albedo => InspectedValues::Color(self.albedos.clone()),
            Inspection::Normal => InspectedValues::Direction(self.normals.clone()),
            Inspection::Depth => InspectedValues::Scalar(self.distances_m.clone()),
            Inspection::Instance => InspectedValues::Labels(self.instances.clone()),
            Inspection::BvhSteps => {
                InspectedValues::Scalar(self.steps.iter().map(|steps| *steps as f32).collect())
            }
            _ => return None,
        };
        // Rays enter nodes also where they meet nothing.
        let has_value = (inspection != Inspection::BvhSteps)
            .then(|| self.distances_m.iter().map(|at| *at > 0.0).collect());
        Some(Inspected {
            inspection,
            eye,
            size: self.size,
            values,
            has_value,
        })
    }
}

/// For egui.
fn color_image(image: &ImageRgb8) -> ColorImage {
    let pixels = image
        .pixels
        .iter()
        .map(|[r, g, b]| Color32::from_rgb(*r, *g, *b))
        .collect();
    ColorImage::new([image.width as usize, image.height as usize], pixels)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gray(size: [usize; 2]) -> ViewPictures {
        let pixels = (0..size[0] * size[1]).map(|i| Color32::from_gray((i % 251) as u8));
        let eye = Arc::new(ColorImage::new(size, pixels.collect()));
        ViewPictures {
            eyes: [Arc::clone(&eye), eye],
            legend: None,
            notes: [None, None],
        }
    }

    #[test]
    fn stock_is_of_one_picture_and_large_ones_are_kept_coarser() {
        let mut stock = Stock::default();
        let (depth, error) = (ViewMode::Inspection(Inspection::Depth), ViewMode::Error);
        stock.put(3, depth, gray([4, 2]));
        stock.put(3, error, gray([2, 2]));
        assert_eq!(stock.get(3, depth), Some(&gray([4, 2])));
        assert_eq!(stock.get(4, depth), None, "of another picture");
        stock.put(4, error, gray([2, 2]));
        assert_eq!(stock.get(3, depth), None);
        assert!(stock.get(4, error).is_some());
        assert_eq!(gray([512, 512]).kept(), gray([512, 512]));
        let coarse = &gray([1023, 700]).kept().eyes[0];
        assert_eq!(coarse.size, [512, 350]);
        assert_eq!(coarse.pixels[512], gray([1023, 700]).eyes[0].pixels[2046]);
    }
}
