//! What the window wants of a frame, and what a frame brings to it.

use std::sync::Arc;

use egui::ColorImage;

use super::view_pictures::ViewPictures;
use crate::frame_loop::FrameStats;
use crate::renderer::{Inspection, InstanceId, SeenSurface};
use crate::settings::{Eyes, Settings, Tone};
use crate::xr::View;

/// What is shown of a frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ViewMode {
    /// The picture.
    #[default]
    Picture,
    /// An intermediate result, in false colour.
    Inspection(Inspection),
    /// The error against a reference that is rendered meanwhile, in false colour.
    Error,
}

impl ViewMode {
    /// All, in the order of the menu.
    pub fn all() -> impl Iterator<Item = Self> {
        [Self::Picture]
            .into_iter()
            .chain(Inspection::ALL.into_iter().map(Self::Inspection))
            .chain([Self::Error])
    }

    /// Name for people.
    pub fn name(self) -> String {
        match self {
            Self::Picture => "Picture".to_owned(),
            Self::Inspection(Inspection::BvhSteps) => "BVH steps".to_owned(),
            Self::Inspection(inspection) => {
                let words = inspection.name().replace('-', " ");
                let (first, rest) = words.split_at(1);
                first.to_uppercase() + rest
            }
            Self::Error => "Error".to_owned(),
        }
    }

    /// One line on what it shows.
    pub fn about(self) -> &'static str {
        match self {
            Self::Picture => "what the eye sees, tone mapped",
            Self::Inspection(inspection) => inspection.doc(),
            Self::Error => {
                "relative squared error against a path-traced reference that improves while nothing changes"
            }
        }
    }
}

/// Everything that the window wants shown. The latest counts.
#[derive(Clone, PartialEq)]
pub struct Wanted {
    /// Grows with every change of what follows and with every request that came before it.
    pub number: u64,
    /// Settings of the renderer, and exposure and curve of pictures. Its `size` does not count: that below does.
    pub settings: Arc<Settings>,
    /// The other settings of a split view.
    pub other: Option<Arc<Settings>>,
    /// Both eyes.
    pub views: [View; 2],
    /// Those that are rendered.
    pub rendered: Eyes,
    /// Where the scene's animation stands, nanoseconds; none leaves the scene as its nodes have it.
    pub scene_time_ns: Option<i64>,
    /// Pixels per eye of a view that stands still.
    pub size: [u32; 2],
    /// What is shown of the frames.
    pub view_mode: ViewMode,
    /// The window has a picture of it already: frames need not begin small for its sake.
    pub stands: bool,
}

impl Wanted {
    /// Whether `other` wants nothing else but another view of the same frames, or another exposure or curve of it.
    pub fn is_of_frames_of(&self, other: &Self) -> bool {
        let displays_alone = Arc::ptr_eq(&self.settings, &other.settings)
            || without_display(&self.settings) == without_display(&other.settings);
        let kept = if displays_alone { self } else { other };
        *self
            == Self {
                number: self.number,
                settings: Arc::clone(&kept.settings),
                view_mode: self.view_mode,
                stands: self.stands,
                ..other.clone()
            }
    }
}

/// Settings with some exposure and curve, which are given with each frame.
pub fn without_display(settings: &Settings) -> Settings {
    let mut settings = settings.clone();
    settings.render.output.exposure = 1.0;
    settings.render.output.tone = Tone::Aces;
    settings
}

/// What one eye's pixels see.
#[derive(Clone, Debug, Default)]
pub struct Seen {
    /// Pixels, width and height.
    pub size: [u32; 2],
    /// Scene node of each pixel, row 0 on top; `u32::MAX` where no surface is seen.
    pub nodes: Vec<u32>,
    /// Distance along the ray, metres; 0 where no surface is seen.
    pub distances_m: Vec<f32>,
    /// Number of the instance; `u32::MAX` where no surface is seen.
    pub instances: Vec<u32>,
    /// Base colour of the surface.
    pub albedos: Vec<[f32; 3]>,
    /// Shading normal, world axes.
    pub normals: Vec<[f32; 3]>,
    /// Nodes of the hierarchies that the ray entered, also where it met nothing.
    pub steps: Vec<u32>,
}

impl Seen {
    /// Keeps what the window needs.
    pub fn of(size: [u32; 2], surfaces: &[SeenSurface]) -> Self {
        fn each<T>(surfaces: &[SeenSurface], value: impl Fn(&SeenSurface) -> T) -> Vec<T> {
            surfaces.iter().map(value).collect()
        }
        let number = |InstanceId(number)| number;
        Self {
            size,
            nodes: each(surfaces, |seen| seen.node.unwrap_or(u32::MAX)),
            distances_m: each(surfaces, |seen| seen.distance_m),
            instances: each(surfaces, |seen| seen.instance.map_or(u32::MAX, number)),
            albedos: each(surfaces, |seen| seen.albedo),
            normals: each(surfaces, |seen| seen.normal_in_world),
            steps: each(surfaces, |seen| seen.nodes_visited),
        }
    }

    /// The pixel at `at`, from (0, 0) at the top left to (1, 1).
    pub fn pixel_at(&self, at: [f32; 2]) -> Option<usize> {
        let [x, y] = [0, 1].map(|axis| (at[axis] * self.size[axis] as f32).floor());
        let inside =
            (0.0..self.size[0] as f32).contains(&x) && (0.0..self.size[1] as f32).contains(&y);
        let index = y as usize * self.size[0] as usize + x as usize;
        (inside && index < self.nodes.len()).then_some(index)
    }

    /// The node seen at `at`.
    pub fn node_at(&self, at: [f32; 2]) -> Option<usize> {
        let node = self.nodes[self.pixel_at(at)?];
        (node != u32::MAX).then_some(node as usize)
    }
}

/// A place of an eye's picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PicturePlace {
    /// 0 left, 1 right.
    pub eye: usize,
    /// From (0, 0) at the top left to (1, 1).
    pub at: [f32; 2],
}

/// What a pixel shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelRadiance {
    /// 0 left, 1 right.
    pub eye: usize,
    /// Its number, row by row from the top left.
    pub pixel: usize,
    /// Pixels of the eye, width and height.
    pub size: [u32; 2],
    /// Mean radiance over frames, W/(m² sr), linear RGB.
    pub radiance: [f32; 3],
}

/// A frame.
pub struct FrameReport {
    /// [`Wanted::number`] of what it shows.
    pub number: u64,
    /// Scenes and edits that the renderer had been given by then.
    pub changes: u64,
    /// The same for frames of the same scene, settings and views.
    pub picture: u64,
    /// Whether the scene holds no light.
    pub is_dark: bool,
    /// What it shows.
    pub view_mode: ViewMode,
    /// Number of the frame.
    pub index: u32,
    /// The eyes that were rendered.
    pub rendered: Eyes,
    /// Both eyes' pictures of that view.
    pub shown: ViewPictures,
    /// The rendered eyes as [`ViewMode::Picture`] shows them, whatever is shown.
    pub pictures: [Option<Arc<ColorImage>>; 2],
    /// At the place that was asked for last, if an eye that was rendered has it.
    pub radiance: Option<PixelRadiance>,
    /// Radius of the gather and of the caustics' gather, metres, as the renderer took them.
    pub radii_m: [f64; 2],
    /// The left eye under the other settings.
    pub other: Option<Arc<ColorImage>>,
    /// What the pixels of the rendered eyes see.
    pub seen: [Arc<Seen>; 2],
    /// The views that were rendered.
    pub views: [View; 2],
    /// Pixels per eye.
    pub size: [u32; 2],
    /// Whether `size` is what was wanted.
    pub is_full: bool,
    /// Frames that were averaged.
    pub frames: u32,
    /// Times, photons and reuse of the last frame.
    pub stats: FrameStats,
    /// Device memory in use by all renderers (another one's in a split view, the reference's), bytes, where the driver's interface tells.
    pub device_bytes: Option<u64>,
}

/// What is said of pictures without light.
const DARK: &str =
    "the scene holds no light: drop an .hdr onto the window, or add a light to a node";

impl FrameReport {
    /// The line that is said of an eye's picture, if any.
    pub fn note(&self, eye: usize) -> Option<&str> {
        let of_view = self.shown.notes[eye].as_deref();
        of_view.or(self.is_dark.then_some(DARK))
    }

    /// Whether it shows these eyes.
    pub fn has(&self, eyes: Eyes) -> bool {
        self.rendered == Eyes::Both || self.rendered == eyes
    }

    /// The eye, 0 left or 1 right, whose picture stands for `eye`: itself if it was rendered.
    pub fn stands_for(&self, eye: usize) -> usize {
        match self.rendered {
            Eyes::Both => eye,
            Eyes::Left => 0,
            Eyes::Right => 1,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_found_by_place() {
        let seen = Seen {
            size: [4, 2],
            nodes: vec![0, 1, 2, 3, u32::MAX, 5, 6, 7],
            distances_m: vec![1.0; 8],
            ..Seen::default()
        };
        assert_eq!(seen.node_at([0.0, 0.0]), Some(0));
        assert_eq!(seen.node_at([0.99, 0.99]), Some(7));
        assert_eq!(seen.node_at([0.5, 0.25]), Some(2));
        assert_eq!(seen.node_at([0.1, 0.75]), None, "no surface");
        for outside in [[1.0, 0.5], [-0.01, 0.5], [0.5, 1.0], [f32::NAN, 0.5]] {
            assert_eq!(seen.pixel_at(outside), None, "{outside:?}");
        }
    }
}
