//! The images of a frame, read back.

use super::LoopError;
use crate::gpu::ShaderLibrary;
use crate::images::{Image, ImageRgb};
use crate::output::FrameImages;
use crate::renderer::{Eye, Inspected, Inspection, Renderer};
use crate::settings::Aov;

/// The view that a layer is.
pub fn inspection(aov: Aov) -> Inspection {
    match aov {
        Aov::Depth => Inspection::Depth,
        Aov::Normal => Inspection::Normal,
        Aov::Albedo => Inspection::Albedo,
        Aov::Motion => Inspection::Motion,
        Aov::Instance => Inspection::Instance,
    }
}

/// What each pixel of the eyes in `images` sees through its centre.
pub(super) fn read_aovs(
    renderer: &mut Renderer,
    library: &ShaderLibrary,
    aovs: &[Aov],
    images: &FrameImages,
) -> Result<Vec<Inspected>, LoopError> {
    let mut layers = Vec::new();
    for (eye, _) in &images.radiance {
        for aov in aovs {
            layers.push(renderer.inspect(library, inspection(*aov), *eye)?);
        }
    }
    Ok(layers)
}

/// Reads the frame's images; values that are not finite become 0 and are counted.
///
/// # Errors
/// [`LoopError::Render`].
pub fn read_images(
    renderer: &Renderer,
    non_finite_pixels: &mut usize,
) -> Result<FrameImages, LoopError> {
    let size = renderer.size();
    // Of a pixel that is counted parts may be wrong, too.
    let mut image = |mut pixels: Vec<[f32; 3]>, counts: bool| -> Result<ImageRgb, LoopError> {
        for pixel in &mut pixels {
            if !pixel.iter().all(|channel| channel.is_finite()) {
                *pixel = [0.0; 3];
                *non_finite_pixels += usize::from(counts);
            }
        }
        Ok(Image::new(size[0], size[1], pixels)?)
    };
    let mut radiance = Vec::new();
    for eye in [Eye::Left, Eye::Right] {
        if let Some(pixels) = renderer.read_radiance(eye)? {
            radiance.push((eye, image(pixels, true)?));
        }
    }
    let mut parts = Vec::new();
    for eye in [Eye::Left, Eye::Right] {
        if let Some(read) = renderer.read_parts(eye)? {
            for (part, pixels) in [
                ("direct", read.direct),
                ("indirect", read.indirect),
                ("albedo", read.albedo),
            ] {
                parts.push((eye, part, image(pixels, false)?));
            }
        }
    }
    if *non_finite_pixels > 0 {
        log::error!(
            "{non_finite_pixels} pixels were not finite and are written as 0; please report the scene"
        );
    }
    let has_right = radiance.iter().any(|(eye, _)| *eye == Eye::Right);
    let provenance = if has_right {
        renderer.read_provenance()?
    } else {
        None
    };
    Ok(FrameImages {
        radiance,
        provenance,
        parts,
        aovs: Vec::new(),
    })
}
