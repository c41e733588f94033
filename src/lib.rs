//! Headset application skeleton that ray traces global illumination in stereo.
//!
//! A stereo pair of an embedded scene, as linear radiance per eye:
//!
//! ```
//! use stereolux::*;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # disable_device_select_layer();
//! let scene = Scene::builtin("cornell")?; // or Scene::load("model.glb")
//! let mut settings = RenderSettings::default();
//! settings.photon.count = 10_000;
//! let size = [32, 32]; // pixels per eye
//!
//! let gpu = GpuContext::open(None)?; // the best adapter; a software one will do
//! let shaders = ShaderLibrary::embedded();
//! let mut renderer = Renderer::new(gpu, &shaders, &scene, &settings, Eyes::Both, size)?;
//!
//! // Where both eyes are and what they see: here, a headset that looks at the scene's own viewpoint.
//! let headset = Headset::load("quest3")?;
//! let views = headset.views_from_head(&scene.start_pose());
//! let frame = renderer.render_frame(&views, 0, |_| {})?;
//!
//! println!("{:.0} % of the right eye reused", 100.0 * frame.stereo.reuse_fraction);
//! if let Some(pixels) = renderer.read_radiance(Eye::Right)? {
//!     let image = Image::new(size[0], size[1], pixels)?;
//!     let path = std::env::temp_dir().join("stereolux_right.png");
//!     write_png(&path, &tone_map(&image, 1.0))?;
//! #   assert!(image.pixels.iter().flatten().all(|channel| channel.is_finite()));
//! #   assert!(image.pixels.iter().flatten().sum::<f32>() > 0.0);
//! }
//! # assert!(frame.stereo.reuse_fraction > 0.5);
//! # Ok(())
//! # }
//! ```
//!
//! An application implements [`App`] and is run by [`run_app`], with the flags of `stereolux run`: `examples/minimal.rs` is
//! one. Who wants the renderer to himself makes a [`FrameLoop`] of a session and a scene. The session is a [`SimulatedSession`], the replay of a recording ([`ReplaySession`]) or a headset
//! ([`OpenXrSession`]), and the loop cannot tell which.
//!
//! # One frame
//!
//! The loop asks the session for the time at which the frame will be seen and for both eyes' views then. The
//! [renderer](Renderer) moves the [scene](Scene) to the head: positions are f64 on the host and f32 relative to the
//! head on the device. If the photon map is missing, photons are traced from the lights through the two-level
//! hierarchy, stored, and sorted into a grid. The left eye's rays find the surfaces, next-event estimation lights
//! them directly, photons within a radius light them indirectly. The left eye's hits are projected into the right eye;
//! those that it sees are reused, glossy ones by scattering their light anew for it; the pixels that are
//! still empty are listed and rendered by the same passes. `frame::plan()` lists all steps in order.
//!
//! # Modules
//!
//! Private, unless the feature `internals` is on, which promises nothing:
//!
//! - `commands`, `options`, `settings`: the program's commands, their checked options, every setting;
//! - `app`: an application's trait, its input, its world;
//! - `frame_loop`, `xr`, `output`, `mirror`: frames from a session to files, a headset, a window;
//! - `viewer`: a window in which a scene is walked through and edited;
//! - `renderer`, `frame`, `gpu`: images from views;
//! - `scene`, `bvh`: what is rendered;
//! - `chrome_trace`: host and device times of a run on one clock;
//! - `metrics`, `images`, `tone`, `false_color`: errors against a reference, image files, pictures of views;
//! - `bench`: speed against error.
//!
//! `settings`, `xr`, `gpu`, `scene` and `bvh` are crates of their own (`crates/`), and so are `metrics` and `images` together.
//!
//! Matrix names read target_from_source; points and vectors carry their space in their names.

#![cfg_attr(
    not(feature = "internals"),
    allow(
        dead_code,
        unused_imports,
        reason = "tests, examples and tools use more than the program does, and turn `internals` on"
    )
)]

#[cfg(not(feature = "internals"))]
mod app;
#[cfg(feature = "internals")]
pub mod app;
#[cfg(all(feature = "bench", not(feature = "internals")))]
mod bench;
#[cfg(all(feature = "bench", feature = "internals"))]
pub mod bench;
#[cfg(not(feature = "internals"))]
mod chrome_trace;
#[cfg(feature = "internals")]
pub mod chrome_trace;
#[cfg(not(feature = "internals"))]
mod commands;
#[cfg(feature = "internals")]
pub mod commands;
#[cfg(feature = "viewer")]
mod desktop;
#[cfg(not(feature = "internals"))]
mod false_color;
#[cfg(feature = "internals")]
pub mod false_color;
#[cfg(test)]
#[allow(dead_code, reason = "shared with other crates' tests")]
#[path = "../crates/base/tests/shared/folders.rs"]
mod folders;
#[cfg(not(feature = "internals"))]
mod frame;
#[cfg(feature = "internals")]
pub mod frame;
#[cfg(not(feature = "internals"))]
mod frame_loop;
#[cfg(feature = "internals")]
pub mod frame_loop;
#[cfg_attr(not(feature = "mirror"), path = "no_mirror.rs")]
#[cfg(not(feature = "internals"))]
mod mirror;
#[cfg_attr(not(feature = "mirror"), path = "no_mirror.rs")]
#[cfg(feature = "internals")]
pub mod mirror;
#[cfg(not(feature = "internals"))]
mod options;
#[cfg(feature = "internals")]
pub mod options;
#[cfg(not(feature = "internals"))]
mod output;
#[cfg(feature = "internals")]
pub mod output;
#[cfg(not(feature = "internals"))]
mod renderer;
#[cfg(feature = "internals")]
pub mod renderer;
mod scene_loading;
#[cfg(not(feature = "internals"))]
mod tone;
#[cfg(feature = "internals")]
pub mod tone;
#[cfg(all(feature = "viewer", not(feature = "internals")))]
mod viewer;
#[cfg(all(feature = "viewer", feature = "internals"))]
pub mod viewer;
#[cfg(feature = "mirror")]
mod windowing;

use stereolux_base::{files, foreign_errors, pose, printable};

/// Crates under the names that modules here go by.
macro_rules! rooms {
    ($visibility:vis) => {
        $visibility use {
            stereolux_base::{interrupt, limits},
            stereolux_bvh as bvh, stereolux_gpu as gpu,
            stereolux_images::{exr_file, images, metrics},
            stereolux_scene as scene, stereolux_settings as settings, stereolux_xr as xr,
        };
    };
}

#[cfg(not(feature = "internals"))]
rooms!(pub(crate));
#[cfg(feature = "internals")]
rooms!(pub);

// Scenes.
pub use bvh::BvhError;
pub use limits::{LoadBudget, LoadLimits, OverBudget};
pub use scene::animation::{Interpolation, NodeTracks, Track};
pub use scene::edit::{
    Document, Edit, EditError, MaterialPreset, NewContent, NewNode, Original, Placement, Tail,
};
pub use scene::{
    AlphaMode, Animation, Bounds, Camera, Deformation, Environment, Filter, Image as TextureImage,
    Instance, LeftOut, LightInstance, LightKind, Material, Mesh, MeshTriangle, MorphTarget,
    Motion as SceneMotion, Needs, Node, PunctualLight, Scene, SceneError, ScenePart, ScenePose,
    Skin, SourceFacts, Texture, TextureRef, Trs, VertexJoints, Wrap, load_environment,
};

// Settings.
pub use settings::{
    AnimationSettings, DirectLight, Eyes, Force, ForceSettings, ImageFormat, Kernel, Loads, Method,
    Mips, Motion, OpenXrSettings, PathSettings, PhotonEstimate, PhotonSettings, PictureSettings,
    Quality, ReconstructSettings, RenderSettings, Reuse, Sampler, Schedule, Search, Space,
    StereoSettings, Switch, Technique, TextureSettings, TimingSettings, Turn, UserDomain, UserPass,
};

// Devices and images.
pub use gpu::context::AdapterSummary;
pub use gpu::vulkan_interop::disable_device_select_layer;
pub use gpu::{GpuContext, GpuError, HostSpan, PassTimes, ShaderLibrary, Submission};
pub use images::{
    Image, ImageError, ImageRgb, ImageRgb8, read_image, tone_map, write_exr, write_png,
};
pub use output::OutputError;
pub use renderer::packing::{PackError, UserBsdf, install_user_bsdfs};
pub use renderer::{
    Applied, CpuTimes, Eye, FilledBecause, Flight, FrameResult, InPlace, Inspected,
    InspectedValues, Inspection, InstanceId, MapStats, PartPreparation, PhotonStats, PreparedPart,
    Provenance, RadianceParts, RayHit, Rebuild, RenderError, Renderer, SeenSurface, StereoStats,
};

// Applications. `glam` as in the interfaces here.
pub use glam;

pub use app::{App, AppError, FrameInput, PartLoading, World, WorldError, run_app, run_app_with};
#[cfg(feature = "panels")]
pub use app::{Panel, PanelSpec};
/// The crate that panels are made with.
#[cfg(feature = "panels")]
pub use egui;

// Sessions and their frames.
pub use frame::user_passes::shader_library;
pub use frame_loop::{CpuMs, FrameLoop, FrameStats, GpuSums, LoopError};
pub use xr::headset::HeadsetEye;
#[cfg(not(target_vendor = "apple"))]
pub use xr::openxr::{
    OpenXrSession, Runtime as OpenXrRuntime, RuntimeError as OpenXrError,
    SessionOptions as OpenXrOptions,
};
pub use xr::validation::Fault;
pub use xr::{
    Action, ActionError, ActionKind, ActionValue, ActionValues, Actions, ArgumentError, Button,
    Buttons, ControllerModel, Fov, FrameState, FrameSubmission, Hand, HandScript, Headset,
    HiddenArea, Input, InputError, Joint, LocatedViews, Pacing, Pose, Pulse, PulseOf, QualityFrom,
    RayInWorld, Recorder, RenderTargets, ReplayOptions, ReplaySession, RuntimeTargets, SessionInfo,
    Side, SimulatedSession, Tangents, TraceBody, TraceUp, Tracked, Validated, View, ViewFlags,
    XrError, XrSession,
};

#[doc(hidden)]
pub use commands::main;
