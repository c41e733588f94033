//! Every setting, stated once.
//!
//! [`table`] has a row for each: type, default, range, unit and one sentence. The structs with their defaults and
//! documentation come from it, and the [`registry`] from which `--set`, config files, `--help`, `info --settings`,
//! `config/example.toml` and the viewer's panel work. A [`Choice`] does the same for settings with a few named values. Nothing
//! here depends on a command line, a file or a device.

pub mod choices;
pub mod kinds;
pub mod quality;
pub mod registry;
pub mod table;
pub mod user_pass;

pub use choices::{
    Aov, AtrousPasses, Choice, DirectLight, ExrLayout, ExrPrecision, Eyes, Force, FramesInFlight,
    ImageFormat, Kept, Kernel, Light, Loads, Method, Mips, Motion, PhotonEstimate, Reuse, Sampler,
    Schedule, Search, Space, Switch, Technique, Timestamps, Tone, Turn, WriteImages,
};
pub use quality::Quality;
pub use registry::{Kind, Setting};
pub use table::{
    AnimationSettings, EnvironmentSettings, ForceSettings, GpuSettings, InputSettings,
    LimitsSettings, OpenXrSettings, OutputSettings, PathSettings, PhotonSettings, PictureSettings,
    ReconstructSettings, RenderSettings, Settings, SimulatedSettings, StereoSettings,
    SurroundingsSettings, TextureSettings, TimingSettings,
};
pub use user_pass::{UserDomain, UserPass};
