//! The runtime before a session: loader, instance, headset, and the adapter that it dictates.

use openxr as xr;
use serde_json::{Value, json};

use stereolux_base::printable;
use stereolux_gpu::vulkan_interop::openxr as interop;
use stereolux_gpu::{GpuContext, GpuError};
use stereolux_settings::registry::MAX_SIZE;

/// The one view configuration that this program drives.
pub(super) const STEREO: xr::ViewConfigurationType = xr::ViewConfigurationType::PRIMARY_STEREO;

/// Why there is no runtime to render to; one line each.
#[derive(Debug, thiserror::Error)]
pub enum RuntimeError {
    /// No loader library.
    #[error(
        "no OpenXR loader was found ({0}); install a runtime and its loader (on Debian: libopenxr-loader1), or use --session simulated"
    )]
    NoLoader(String),
    /// The loader finds or reaches no runtime.
    #[error(
        "no OpenXR runtime answers ({0}); start one, or point XR_RUNTIME_JSON to its manifest, or use --session simulated"
    )]
    NoRuntime(String),
    /// The runtime cannot work with Vulkan.
    #[error(
        "the OpenXR runtime offers no Vulkan (XR_KHR_vulkan_enable2); choose another runtime with XR_RUNTIME_JSON"
    )]
    NoVulkan,
    /// The runtime has no headset.
    #[error("OpenXR runtime {runtime:?} has no headset ({reason}); connect one and switch it on")]
    NoHeadset {
        /// Name of the runtime.
        runtime: String,
        /// The runtime's words.
        reason: xr::sys::Result,
    },
    /// The headset does not show two views.
    #[error("{system:?} offers no stereo view configuration (two views, left and right)")]
    NoStereo {
        /// Name of the headset.
        system: String,
    },
    /// `--adapter` names another adapter than the runtime.
    #[error("--adapter {wanted:?}: the OpenXR runtime requires {adapter:?}; leave --adapter out")]
    OtherAdapter {
        /// What was asked for.
        wanted: String,
        /// What the runtime dictates.
        adapter: String,
    },
    /// The runtime names no usable size.
    #[error(
        "{system:?} asks for images of {}x{} pixels per eye and takes at most {}x{}; give a size that it takes with --size, or use another runtime",
        recommended[0], recommended[1], most[0], most[1]
    )]
    NoSize {
        /// Name of the headset.
        system: String,
        /// What the runtime recommends.
        recommended: [u32; 2],
        /// The runtime's limit.
        most: [u32; 2],
    },
    /// `--size` is more than the runtime takes.
    #[error("--size {}x{}: the OpenXR runtime takes at most {}x{} pixels per eye", size[0], size[1], most[0], most[1])]
    TooLarge {
        /// What was asked for.
        size: [u32; 2],
        /// The runtime's limit.
        most: [u32; 2],
    },
    /// Vulkan through the runtime failed.
    #[error("Vulkan through the OpenXR runtime: {0}")]
    Vulkan(String),
    /// The runtime does not take a binding of the application's.
    #[error(
        "action '{action}': the OpenXR runtime does not take {source_path} of {profile} ({reason}); suggest a source that the profile has"
    )]
    Binding {
        /// The action's name.
        action: String,
        /// What should drive it.
        source_path: String,
        /// With which controller.
        profile: &'static str,
        /// The runtime's words.
        reason: String,
    },
    /// For a new session in the place of a lost one the runtime has something else than before.
    #[error("the OpenXR runtime now has {0}; start the run again")]
    Changed(&'static str),
    /// Any other call.
    #[error("{call}: {reason}")]
    Call {
        /// The function.
        call: &'static str,
        /// The runtime's words.
        reason: xr::sys::Result,
    },
    /// The device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

impl RuntimeError {
    /// True for unusable arguments (exit status 2).
    #[must_use]
    pub fn is_unusable_input(&self) -> bool {
        matches!(
            self,
            Self::OtherAdapter { .. } | Self::TooLarge { .. } | Self::Binding { .. }
        )
    }

    /// Whether the same may go well a little later.
    pub(super) fn may_pass(&self) -> bool {
        match self {
            Self::NoHeadset { reason, .. } | Self::Call { reason, .. } => !is_gone(*reason),
            _ => false,
        }
    }
}

/// For `map_err`: an error of `call`.
pub(super) fn failed(call: &'static str) -> impl FnOnce(xr::sys::Result) -> RuntimeError {
    move |reason| RuntimeError::Call { call, reason }
}

/// Whether the runtime itself is gone, and takes no more calls.
pub(super) fn is_gone(result: xr::sys::Result) -> bool {
    use xr::sys::Result as R;
    matches!(result, R::ERROR_INSTANCE_LOST | R::ERROR_RUNTIME_FAILURE)
}

/// What the headset itself cannot do is not used.
fn take_over(used: &mut xr::ExtensionSet, supports: interop::Supports) {
    used.ext_hand_tracking = supports.hand_joints;
    used.ext_eye_gaze_interaction = supports.gaze;
    used.fb_passthrough = supports.passthrough;
}

/// A headset as the runtime describes it.
pub(super) struct System {
    pub(super) id: xr::SystemId,
    /// Ways to blend with the room, the preferred first; one at least.
    pub(super) modes: Vec<xr::EnvironmentBlendMode>,
    name: String,
    views: [xr::ViewConfigurationView; 2],
    supports: interop::Supports,
}

impl System {
    /// The headset of the runtime that is called `runtime`.
    fn find(instance: &xr::Instance, runtime: &str) -> Result<Self, RuntimeError> {
        let id = instance
            .system(xr::FormFactor::HEAD_MOUNTED_DISPLAY)
            .map_err(|reason| RuntimeError::NoHeadset {
                runtime: runtime.to_owned(),
                reason,
            })?;
        let name = one_line(
            &instance
                .system_properties(id)
                .map_err(failed("xrGetSystemProperties"))?
                .system_name,
        );
        // A runtime that knows how may stand before a headset that cannot.
        let supports = interop::supports(instance, id).map_err(failed("xrGetSystemProperties"))?;
        let no_stereo = || RuntimeError::NoStereo {
            system: name.clone(),
        };
        let configurations = instance
            .enumerate_view_configurations(id)
            .map_err(failed("xrEnumerateViewConfigurations"))?;
        if !configurations.contains(&STEREO) {
            return Err(no_stereo());
        }
        let views = instance
            .enumerate_view_configuration_views(id, STEREO)
            .map_err(failed("xrEnumerateViewConfigurationViews"))?;
        let views = <[_; 2]>::try_from(views).map_err(|_| no_stereo())?;
        let mut modes = instance
            .enumerate_environment_blend_modes(id, STEREO)
            .map_err(failed("xrEnumerateEnvironmentBlendModes"))?;
        if modes.is_empty() {
            modes.push(xr::EnvironmentBlendMode::OPAQUE);
        }
        Ok(Self {
            id,
            modes,
            name,
            views,
            supports,
        })
    }

    /// See [`Runtime::recommended_size`].
    fn recommended_size(&self) -> [u32; 2] {
        let [left, right] = &self.views;
        let most = self.largest_size();
        [
            left.recommended_image_rect_width
                .max(right.recommended_image_rect_width)
                .min(most[0]),
            left.recommended_image_rect_height
                .max(right.recommended_image_rect_height)
                .min(most[1]),
        ]
    }

    /// Pixels per eye that it takes at most.
    fn largest_size(&self) -> [u32; 2] {
        let [left, right] = &self.views;
        [
            left.max_image_rect_width.min(right.max_image_rect_width),
            left.max_image_rect_height.min(right.max_image_rect_height),
        ]
    }
}

/// A runtime with a headset, ready for a session.
pub struct Runtime {
    pub(super) instance: xr::Instance,
    pub(super) system: System,
    /// Extensions in use.
    pub(super) used: xr::ExtensionSet,
    name: String,
    version: String,
    extensions: Vec<String>,
}

impl Runtime {
    /// Finds loader, runtime and headset.
    ///
    /// # Errors
    /// [`RuntimeError`], saying which of them is missing.
    pub fn find() -> Result<Self, RuntimeError> {
        let entry =
            interop::load_entry().map_err(|error| RuntimeError::NoLoader(one_line(&error)))?;
        let no_runtime = |error: xr::sys::Result| RuntimeError::NoRuntime(error.to_string());
        let available = entry.enumerate_extensions().map_err(no_runtime)?;
        if !available.khr_vulkan_enable2 {
            return Err(RuntimeError::NoVulkan);
        }
        let mut used = xr::ExtensionSet::default();
        used.khr_vulkan_enable2 = true;
        used.khr_composition_layer_depth = available.khr_composition_layer_depth;
        used.khr_visibility_mask = available.khr_visibility_mask;
        used.fb_display_refresh_rate = available.fb_display_refresh_rate;
        used.fb_passthrough = available.fb_passthrough;
        used.ext_hand_tracking = available.ext_hand_tracking;
        used.ext_eye_gaze_interaction = available.ext_eye_gaze_interaction;
        used.msft_controller_model = available.msft_controller_model;
        used.meta_touch_controller_plus = available.meta_touch_controller_plus;
        used.ext_hand_interaction = available.ext_hand_interaction;
        let application = xr::ApplicationInfo {
            application_name: "stereolux",
            application_version: 1,
            engine_name: "stereolux",
            engine_version: 1,
            // 1.0: nothing newer is used, and older runtimes refuse 1.1.
            api_version: xr::Version::new(1, 0, 0),
        };
        let instance = entry
            .create_instance(&application, &used, &[], &())
            .map_err(no_runtime)?;
        let properties = instance
            .properties()
            .map_err(failed("xrGetInstanceProperties"))?;
        let name = one_line(&properties.runtime_name);
        let system = System::find(&instance, &name)?;
        take_over(&mut used, system.supports);
        Ok(Self {
            system,
            used,
            version: properties.runtime_version.to_string(),
            name,
            extensions: names(&available),
            instance,
        })
    }

    /// Looks for the headset again, before another session is made on `device`. What a run keeps must be as it was.
    ///
    /// # Errors
    /// [`RuntimeError::Changed`], and those of [`Runtime::find`].
    pub(super) fn find_again(&mut self, device: &wgpu::Device) -> Result<(), RuntimeError> {
        let again = System::find(&self.instance, &self.name)?;
        if again.name != self.system.name {
            return Err(RuntimeError::Changed("another headset"));
        }
        let sizes = |system: &System| [system.recommended_size(), system.largest_size()];
        if sizes(&again) != sizes(&self.system) {
            return Err(RuntimeError::Changed("images of another size"));
        }
        self.ask_requirements(again.id)?;
        let is_same = interop::dictates_adapter_of(&self.instance, again.id, device)
            .map_err(failed("xrGetVulkanGraphicsDevice2KHR"))?;
        if !is_same {
            return Err(RuntimeError::Changed("another adapter"));
        }
        take_over(&mut self.used, again.supports);
        self.system = again;
        Ok(())
    }

    /// The specification wants this asked before a session is made.
    fn ask_requirements(&self, system: xr::SystemId) -> Result<(), RuntimeError> {
        self.instance
            .graphics_requirements::<xr::Vulkan>(system)
            .map_err(failed("xrGetVulkanGraphicsRequirements2KHR"))?;
        Ok(())
    }

    /// Name and version.
    #[must_use]
    pub fn name(&self) -> String {
        format!("{} {}", self.name, self.version)
    }

    /// The headset's name.
    #[must_use]
    pub fn headset(&self) -> &str {
        &self.system.name
    }

    /// Pixels per eye that the runtime recommends, within what it takes. Both eyes get the same, as everywhere in this
    /// program: the larger. [`Runtime::size`] refuses what makes no sense.
    #[must_use]
    pub fn recommended_size(&self) -> [u32; 2] {
        self.system.recommended_size()
    }

    /// The size to render: `wanted`, or what the runtime recommends.
    ///
    /// # Errors
    /// [`RuntimeError::TooLarge`], [`RuntimeError::NoSize`].
    pub fn size(&self, wanted: Option<[u32; 2]>) -> Result<[u32; 2], RuntimeError> {
        let most = self.system.largest_size();
        let size = wanted.unwrap_or_else(|| self.recommended_size());
        if size.iter().chain(&most).any(|side| *side == 0)
            || size.iter().any(|side| *side > MAX_SIZE)
        {
            return Err(RuntimeError::NoSize {
                system: self.system.name.clone(),
                recommended: self.recommended_size(),
                most,
            });
        }
        if size[0] > most[0] || size[1] > most[1] {
            return Err(RuntimeError::TooLarge { size, most });
        }
        Ok(size)
    }

    /// The device on the adapter that the runtime dictates; `wanted` is `--adapter`.
    ///
    /// # Errors
    /// [`RuntimeError::OtherAdapter`], [`RuntimeError::Vulkan`] or [`RuntimeError::Gpu`].
    pub fn open_device(&self, wanted: Option<&str>) -> Result<GpuContext, RuntimeError> {
        let system = self.system.id;
        self.ask_requirements(system)?;
        let (instance, adapter) =
            interop::adapter_of_runtime(&self.instance, system).map_err(RuntimeError::Vulkan)?;
        let info = adapter.get_info();
        if let Some(wanted) = wanted
            && !info.name.to_lowercase().contains(&wanted.to_lowercase())
        {
            return Err(RuntimeError::OtherAdapter {
                wanted: wanted.to_owned(),
                adapter: info.name,
            });
        }
        let descriptor = GpuContext::device_descriptor(&adapter)?;
        let (device, queue) = interop::open_device(&self.instance, system, &adapter, &descriptor)
            .map_err(RuntimeError::Vulkan)?;
        Ok(GpuContext::from_device(instance, adapter, device, queue))
    }

    /// For `info`.
    #[must_use]
    pub fn report(&self) -> Value {
        json!({
            "runtime": self.name,
            "version": self.version,
            "system": self.headset(),
            "views": self.system.views.iter().map(|view| json!({
                "recommended_size": [view.recommended_image_rect_width, view.recommended_image_rect_height],
                "largest_size": [view.max_image_rect_width, view.max_image_rect_height],
            })).collect::<Vec<_>>(),
            "extensions": self.extensions,
            "used_extensions": names(&self.used),
            "not_offered": self.not_offered(),
        })
    }

    /// What runtime and headset may lack without harm, and do.
    fn not_offered(&self) -> Vec<&'static str> {
        let may_lack = [
            ("bare_hands", self.used.ext_hand_interaction),
            ("hand_joints", self.used.ext_hand_tracking),
            ("gaze", self.used.ext_eye_gaze_interaction),
            ("controller_models", self.used.msft_controller_model),
            ("passthrough", self.passthrough().is_some()),
        ];
        let missing = may_lack.into_iter().filter(|(_, is_there)| !is_there);
        missing.map(|(what, _)| what).collect()
    }
}

/// The extensions of a set.
pub(super) fn names(set: &xr::ExtensionSet) -> Vec<String> {
    let names = set.names().into_iter().map(String::from_utf8_lossy);
    names
        .map(|name| name.trim_end_matches('\0').to_owned())
        .collect()
}

/// A runtime's or a linker's words as one line, fit for a terminal.
fn one_line(text: &impl ToString) -> String {
    printable::line(&stereolux_base::foreign_errors::one_line(&text.to_string()))
}
