//! What a scene's frames are planned for: shader features and photon maps.

use super::editing::shines;
use super::photon_map::PhotonMap;
use super::quality::plans_of_qualities;
use super::{SceneBuffers, caustic_paths, photon_paths_per_thread, reuses_glossy, shader_features};
use crate::frame::{
    AdapterLimits, FrameSpec, GatherSlices, MapConfig, MapKind, MapLayout, PlannedStage,
    ShapeCounts, plan,
};
use crate::gpu::{GpuContext, GpuError, ShaderFeatures};
use crate::scene::{Needs, Scene};
use crate::settings::{Loads, Method, Quality, RenderSettings, Reuse, Search};

/// A scene's frames.
pub struct PlannedScene {
    /// Stages of the first frame.
    pub stages: Vec<PlannedStage>,
    /// Stages of frames of lower quality, for which memory is held too.
    pub lower: Vec<Vec<PlannedStage>>,
    /// What their shaders are specialised by.
    pub features: ShaderFeatures,
    /// Its photon maps.
    pub maps: Vec<MapLayout>,
}

/// The stages of a scene's frames on a hardware or a software adapter, and what their shaders are specialised by. No
/// device is needed to know. Of shapes that change, boxes are refitted once per level of the deepest hierarchy, which is
/// named once here.
///
/// # Errors
/// As [`MapLayout::new`].
pub fn plan_of_scene(
    scene: &Scene,
    settings: &RenderSettings,
    is_software: bool,
) -> Result<PlannedScene, GpuError> {
    let needs = Needs::of(scene);
    let features = frame_features(&needs, settings, true, is_software);
    let shapes = scene
        .instances()
        .iter()
        .any(|placed| scene.deforms(placed.node));
    let layout = |config| MapLayout::new(config, &AdapterLimits::NONE);
    let has_lights = shines(&needs);
    let maps = map_configs(settings, &features, has_lights, 0);
    let reconstruct = &settings.reconstruct;
    let maps: Vec<MapLayout> = maps.into_iter().map(layout).collect::<Result<_, _>>()?;
    let planned = |settings: &RenderSettings, reuse| {
        plan(&FrameSpec {
            settings,
            features,
            both: true,
            reuse,
            paths_per_thread: 1,
            maps: maps.clone(),
            slices: GatherSlices::ONE,
            shapes: shapes.then(|| ShapeCounts {
                levels: vec![[0, 0]],
                ..ShapeCounts::default()
            }),
            keeps_previous: reconstruct.follows_motion() || settings.output.motion,
        })
    };
    Ok(PlannedScene {
        stages: planned(settings, settings.reuse),
        lower: plans_of_qualities(settings, Quality::of(settings), planned),
        features,
        maps,
    })
}

/// What the shaders of a renderer's frames are specialised by; who sees hidden areas adds that.
pub(super) fn frame_features(
    needs: &Needs,
    settings: &RenderSettings,
    both: bool,
    is_software: bool,
) -> ShaderFeatures {
    let features = shader_features(needs, settings);
    let reuse_glossy = both && reuses_glossy(settings, &features);
    ShaderFeatures {
        record_texels: settings.force.record_texels.apply(is_software),
        wide_machine: settings.force.wide_machine.apply(!is_software),
        scatters: both && settings.reuse == Reuse::Scatter,
        reuse_glossy,
        reuse_paths: reuse_glossy && settings.method == Method::Path,
        reuse_shadow_rays: reuse_glossy && settings.stereo.shadow_rays,
        one_sample: settings.spp == 1,
        carries_light: both && settings.reuse != Reuse::Off,
        shares_light: both && settings.reconstruct.svgf.is_on() && settings.reconstruct.stereo,
        ..features
    }
}

/// The photon map, and that of caustics where `features` say so; none with the path method.
pub(super) fn photon_maps(
    context: &GpuContext,
    settings: &RenderSettings,
    features: &ShaderFeatures,
    scene: &SceneBuffers,
) -> Result<Vec<PhotonMap>, GpuError> {
    let limits = adapter_limits(context);
    map_configs_of(settings, features, scene)
        .into_iter()
        .map(|config| MapLayout::new(config, &limits).map(PhotonMap::new))
        .collect()
}

/// What the maps of [`photon_maps`] are made for.
pub(super) fn map_configs_of(
    settings: &RenderSettings,
    features: &ShaderFeatures,
    scene: &SceneBuffers,
) -> Vec<MapConfig> {
    let has_lights = scene.light_count() > 0;
    map_configs(settings, features, has_lights, scene.hierarchy_depth())
}

pub(super) fn adapter_limits(context: &GpuContext) -> AdapterLimits {
    AdapterLimits {
        binding_bytes: context.max_binding_bytes,
        texture_rows: u64::from(context.device.limits().max_texture_dimension_2d),
    }
}

/// What the photon maps of a frame are made for. Without lights there is nothing to emit, and no path may be traced for it.
fn map_configs(
    settings: &RenderSettings,
    features: &ShaderFeatures,
    has_lights: bool,
    hierarchy_depth: u32,
) -> Vec<MapConfig> {
    if settings.method != Method::Photon {
        return Vec::new();
    }
    let photon = &settings.photon;
    let config = |kind, paths, search, loads| MapConfig {
        kind,
        paths: if has_lights { paths } else { 0 },
        shares: photon.shares,
        max_depth: photon.max_depth,
        paths_per_thread: photon_paths_per_thread(features, photon.max_depth, hierarchy_depth),
        capacity: photon.capacity,
        cells: photon.grid_cells_max,
        texels: features.record_texels,
        guided: features.guided_photons,
        wide_machine: features.wide_machine,
        search,
        loads,
    };
    let mut maps = vec![config(
        MapKind::Photons,
        photon.count,
        photon.search,
        photon.loads,
    )];
    if features.caustics {
        let paths = caustic_paths(settings);
        maps.push(config(
            MapKind::Caustics,
            paths,
            Search::Grid,
            Loads::Direct,
        ));
    }
    maps
}
