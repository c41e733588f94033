//! Views of intermediate results: which there are, what they ask of the settings, and what they hold. No device is needed to
//! know; [`crate::false_color`] makes pictures of them.

use crate::settings::{Force, Kept, Method, RenderSettings, Reuse, Search};

use super::{Eye, InstanceId};

stereolux_base::words! {
    /// A view of what a frame is made of.
    #[derive(Hash)]
    pub enum Inspection: name {
        /// Emission and surroundings seen, and light scattered once, W/(m² sr): [`super::RadianceParts::direct`].
        Direct = "direct",
        /// The rest of the radiance, W/(m² sr): [`super::RadianceParts::indirect`]. With [`Inspection::Direct`] it adds up
        /// to the samples' radiance.
        Indirect = "indirect",
        /// Light from the map of caustics alone, W/(m² sr), where the path of the pixel's centre ends after mirrors and
        /// glass.
        Caustic = "caustic",
        /// Base colour of the surface: factor, vertex colours, texture; linear, 0 to 1.
        Albedo = "albedo",
        /// Shading normal of the surface in world axes, on the side that is seen; unit length.
        Normal = "normal",
        /// Distance from the eye along the ray, metres.
        Depth = "depth",
        /// Number of the instance ([`InstanceId`]).
        Instance = "instance",
        /// Photons of the map (without that of caustics) within the gather radius that lie on the surface's side, over
        /// the disc's area, 1/m².
        PhotonDensity = "photon-density",
        /// Photons of both maps that the eye sees in the pixel; those behind surfaces do not count.
        PhotonDots = "photon-dots",
        /// Photons of the map (without that of caustics) in the cell of the grid in which the surface's point lies.
        GridOccupancy = "grid-occupancy",
        /// Inner nodes of the hierarchies, both levels, that the pixel's ray entered; also where it met nothing.
        BvhSteps = "bvh-steps",
        /// Where the surface was in the frame before less where it is, pixels: x to the right, y down. Surroundings move
        /// with the head alone.
        Motion = "motion",
        /// Variance of the luminance of light over albedo, direct and indirect light added, as SVGF has accumulated it,
        /// (W/(m² sr))².
        Variance = "variance",
        /// Where the right eye's pixel came from in the frame's last sample ([`super::Provenance`]).
        Provenance = "provenance",
    }
}

impl Inspection {
    /// One line for tooltips.
    #[must_use]
    pub fn doc(self) -> &'static str {
        match self {
            Self::Direct => "emission and direct light, mean of the frame's samples",
            Self::Indirect => "indirect light, mean of the frame's samples",
            Self::Caustic => "light from the caustic photon map only",
            Self::Albedo => "base colour of the surface with its textures",
            Self::Normal => "shading normal in world axes",
            Self::Depth => "distance from the eye along the ray",
            Self::Instance => "number of the instance that is seen",
            Self::PhotonDensity => "photons within the gather radius, per disc area",
            Self::PhotonDots => "photons that are seen in the pixel",
            Self::GridOccupancy => "photons in the grid's cell around the surface point",
            Self::BvhSteps => "BVH nodes that the pixel's ray entered",
            Self::Motion => "motion back to the surface's position in the previous frame",
            Self::Variance => "variance of the light's luminance over the frames so far",
            Self::Provenance => "where the right eye's pixels came from",
        }
    }

    /// Unit of the values, empty for none.
    #[must_use]
    pub fn unit(self) -> &'static str {
        match self {
            Self::Direct | Self::Indirect | Self::Caustic => "W/(m² sr)",
            Self::Depth => "m",
            Self::PhotonDensity => "photons/m²",
            Self::PhotonDots | Self::GridOccupancy => "photons",
            Self::BvhSteps => "nodes",
            Self::Motion => "pixels",
            Self::Variance => "(W/(m² sr))²",
            Self::Albedo | Self::Normal | Self::Instance | Self::Provenance => "",
        }
    }

    /// The setting that the view lacks under `settings`, as `--set` takes it; `None` if it lacks nothing.
    #[must_use]
    pub fn missing(self, settings: &RenderSettings) -> Option<&'static str> {
        let photon = settings.method == Method::Photon;
        let grid = settings.photon.search == Search::Grid;
        let reconstruct = &settings.reconstruct;
        let lacks = |has: bool, setting| (!has).then_some(setting);
        match self {
            Self::Direct | Self::Indirect => lacks(
                settings.output.parts
                    || reconstruct.svgf.is_on() && settings.output.kept == Kept::All,
                "output.parts=true",
            ),
            Self::Caustic => lacks(photon, "method=photon")
                .or_else(|| lacks(settings.force.caustics != Force::Off, "force.caustics=on")),
            Self::PhotonDots => lacks(photon, "method=photon"),
            Self::PhotonDensity | Self::GridOccupancy => {
                lacks(photon, "method=photon").or_else(|| lacks(grid, "photon.search=grid"))
            }
            Self::Motion => lacks(
                settings.output.motion || reconstruct.follows_motion(),
                "output.motion=true",
            ),
            Self::Variance => lacks(reconstruct.svgf.is_on(), "reconstruct.svgf=true"),
            Self::Provenance => lacks(settings.reuse != Reuse::Off, "reuse=lookup"),
            Self::Albedo | Self::Normal | Self::Depth | Self::Instance | Self::BvhSteps => None,
        }
    }

    /// `settings` with the least change under which the view works. [`Inspection::Direct`], [`Inspection::Indirect`] and
    /// [`Inspection::Motion`] leave the picture as it is bit for bit, photon views of a kd-tree but for rounding; the others
    /// ask for another method, reuse or reconstruction where theirs is off. [`Inspection::Caustic`] has a map made even
    /// where the scene forms no caustics.
    #[must_use]
    pub fn settings_for(self, settings: &RenderSettings) -> RenderSettings {
        let mut changed = settings.clone();
        if self == Self::Caustic {
            // The scene may form none, and then there would be no map to look at.
            changed.force.caustics = Force::On;
        }
        while let Some(missing) = self.missing(&changed) {
            match missing {
                "output.parts=true" => changed.output.parts = true,
                "output.motion=true" => changed.output.motion = true,
                "method=photon" => changed.method = Method::Photon,
                "photon.search=grid" => changed.photon.search = Search::Grid,
                "reconstruct.svgf=true" => changed.reconstruct.svgf = true.into(),
                "reuse=lookup" => changed.reuse = Reuse::Lookup,
                _ => break,
            }
        }
        changed
    }
}

/// What the ray through a pixel's centre meets. Alpha-blended surfaces count where at least a sixteenth of the light meets
/// them: samples leave it to chance, but who points at a pane means the pane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SeenSurface {
    /// Number of the instance; `None` if the ray meets nothing. The fields from here to `albedo` mean nothing then.
    pub instance: Option<InstanceId>,
    /// Scene node that places the instance; `None` for an instance that was added without one.
    pub node: Option<u32>,
    /// Number of the material in [`crate::scene::Scene::materials`].
    pub material: u32,
    /// Number of the triangle in leaf order (`MeshHierarchies::triangles`).
    pub triangle: u32,
    /// Barycentric weights of the triangle's second and third corner.
    pub weights: [f32; 2],
    /// Distance from the eye along the ray, metres.
    pub distance_m: f32,
    /// Shading normal, world axes, unit length, on the side that is seen.
    pub normal_in_world: [f32; 3],
    /// Normal of the triangle's plane, likewise; to within 1e-4.
    pub geometric_normal_in_world: [f32; 3],
    /// Whether the side is seen from which the corners run counter-clockwise.
    pub is_front: bool,
    /// Base colour: factor, vertex colours, texture; linear, 0 to 1.
    pub albedo: [f32; 3],
    /// Inner nodes of the hierarchies, both levels, that the ray entered; also where it met nothing.
    pub nodes_visited: u32,
}

/// Values of a view, one per pixel, row 0 on top. Always finite; 0 (labels: `u32::MAX`) where there is none.
#[derive(Clone, Debug, PartialEq)]
pub enum InspectedValues {
    /// One number.
    Scalar(Vec<f32>),
    /// Linear RGB.
    Color(Vec<[f32; 3]>),
    /// A unit vector, world axes.
    Direction(Vec<[f32; 3]>),
    /// Pixels to the right and down.
    Vector2(Vec<[f32; 2]>),
    /// A number that names something.
    Labels(Vec<u32>),
}

/// A view of one eye.
#[derive(Clone, Debug, PartialEq)]
pub struct Inspected {
    /// Which.
    pub inspection: Inspection,
    /// Whose.
    pub eye: Eye,
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// The values.
    pub values: InspectedValues,
    /// False for pixels that have no value: they see no surface, or were not seen in the frame before. `None`: all have.
    pub has_value: Option<Vec<bool>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_for_a_view_lack_nothing_and_change_nothing_that_is_not_needed() {
        let mut poor = RenderSettings {
            method: Method::Path,
            reuse: Reuse::Off,
            ..RenderSettings::default()
        };
        poor.photon.search = Search::KdTree;
        poor.force.caustics = Force::Off;
        for view in Inspection::ALL {
            let changed = view.settings_for(&poor);
            assert_eq!(view.missing(&changed), None, "{view:?}");
            // What has all that it needs stays as it is.
            assert_eq!(view.settings_for(&changed), changed, "{view:?}");
            assert_eq!(
                view.missing(&poor).is_none(),
                changed == poor,
                "{view:?} {:?}",
                view.missing(&poor)
            );
        }
        // Whoever filters has parts and motion already, as long as the parts are kept.
        let mut filtered = RenderSettings::default();
        filtered.reconstruct.svgf = true.into();
        assert!(Inspection::Direct.missing(&filtered).is_some());
        filtered.output.kept = Kept::All;
        for view in [Inspection::Direct, Inspection::Motion, Inspection::Variance] {
            assert_eq!(view.settings_for(&filtered), filtered);
        }
        let parts = Inspection::Direct.settings_for(&RenderSettings::default());
        let mut expected = RenderSettings::default();
        expected.output.parts = true;
        assert_eq!(parts, expected);
    }

    #[test]
    fn names_are_distinct() {
        let mut names = Inspection::ALL.map(Inspection::name).to_vec();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), Inspection::ALL.len());
    }
}
