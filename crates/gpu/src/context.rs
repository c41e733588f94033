//! Adapter choice and the headless device.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use thiserror::Error;

use super::pipeline_cache::PipelineCache;
use super::vulkan_interop::takes_spirv;
use stereolux_base::foreign_errors::{caught, one_line};

/// Storage buffers that the largest kernel binds by default; a device with fewer is not used.
const STORAGE_BUFFERS_PER_STAGE: u32 = 24;
/// Threads of the largest workgroup that a shader declares.
const WORKGROUP_INVOCATIONS: u32 = 256;

/// What can go wrong between the host and the device.
#[derive(Debug, Error)]
pub enum GpuError {
    /// No Vulkan, Metal or DirectX 12 adapter answered.
    #[error(
        "no GPU adapter found: install a Vulkan driver (on Debian: apt-get install mesa-vulkan-drivers, a software driver)"
    )]
    NoAdapter,
    /// `--adapter` named none of the adapters that are there.
    #[error("--adapter {wanted:?} matches no adapter; there are: {available}")]
    NoMatchingAdapter {
        /// The substring asked for.
        wanted: String,
        /// The names that exist, comma separated.
        available: String,
    },
    /// The adapter lacks features or limits that the renderer uses.
    #[error(
        "adapter {adapter:?} lacks what the renderer needs: {missing}; choose another with --adapter"
    )]
    Missing {
        /// Adapter name.
        adapter: String,
        /// Every missing feature and limit, comma separated.
        missing: String,
    },
    /// The driver refused to create a device.
    #[error("adapter {adapter:?} could not be opened: {reason}")]
    Device {
        /// Adapter name.
        adapter: String,
        /// The driver's words.
        reason: String,
    },
    /// A shader did not compile.
    #[error("shader {shader}: {reason}")]
    Shader {
        /// Shader name, such as `passes/gather`.
        shader: String,
        /// The compiler's words.
        reason: String,
    },
    /// A pass of the user's does not fit into the frame.
    #[error("{0}")]
    UserPass(String),
    /// A kernel was given no resource under a name that its shader declares.
    #[error("pass {pass}: no resource is bound to {binding:?}")]
    Unbound {
        /// Pass name.
        pass: String,
        /// Binding name in the shader.
        binding: String,
    },
    /// The API rejected a call.
    #[error("pass {pass}: {reason}")]
    Validation {
        /// The pass, or the stage of the frame, in which it happened.
        pass: String,
        /// The API's words.
        reason: String,
    },
    /// A buffer is larger than the adapter binds.
    #[error("{what} needs {bytes} bytes, but the adapter binds at most {limit}; {mend}")]
    TooLarge {
        /// What the buffer holds.
        what: String,
        /// Bytes needed.
        bytes: u64,
        /// Bytes allowed.
        limit: u64,
        /// What the user can do.
        mend: &'static str,
    },
    /// A pass, specialised for a scene, has more buffers than a stage may.
    #[error(
        "pass {pass} has {count} buffers in this scene, and {limit} are possible; set photon.schedule = \"split\" if \
         it is \"fused\", or leave something out with force.KEY = \"off\""
    )]
    TooManyBuffers {
        /// Pass name.
        pass: String,
        /// Buffers that its shader declares.
        count: usize,
        /// Buffers that the device allows.
        limit: u32,
    },
    /// The device is gone.
    #[error(
        "the device was lost in {pass} ({reason}); files written so far are complete; if it happens again, give a frame less work (--size, --spp, --photons)"
    )]
    Lost {
        /// The stage of the frame in which it was noticed.
        pass: String,
        /// The driver's words.
        reason: String,
    },
}

/// One adapter as `info` lists it.
#[derive(Debug, Clone, serde::Serialize)]
pub struct AdapterSummary {
    /// The driver's name for the adapter; `--adapter` takes any part of it.
    pub name: String,
    /// `discrete`, `integrated`, `virtual`, `software` or `other`.
    pub kind: &'static str,
    /// `vulkan`, `metal`, `dx12`.
    pub backend: String,
    /// Driver name.
    pub driver: String,
    /// Driver version text.
    pub driver_info: String,
}

impl AdapterSummary {
    /// Summary of what wgpu says of an adapter.
    pub fn of(info: &wgpu::AdapterInfo) -> Self {
        Self {
            name: info.name.clone(),
            kind: kind_name(info.device_type),
            backend: info.backend.to_string(),
            driver: info.driver.clone(),
            driver_info: info.driver_info.clone(),
        }
    }

    /// True if the adapter computes on the CPU, so that its timings must be labelled.
    pub fn is_software(&self) -> bool {
        self.kind == "software"
    }
}

fn kind_name(kind: wgpu::DeviceType) -> &'static str {
    match kind {
        wgpu::DeviceType::DiscreteGpu => "discrete",
        wgpu::DeviceType::IntegratedGpu => "integrated",
        wgpu::DeviceType::VirtualGpu => "virtual",
        wgpu::DeviceType::Cpu => "software",
        wgpu::DeviceType::Other => "other",
    }
}

/// Order of preference without `--adapter`: discrete, integrated, then software.
fn rank(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// Asked before every pass, by its label, whether it is still wanted.
pub type Gate = Arc<dyn Fn(&str) -> bool + Send + Sync>;

/// The device, its queue, and what was learnt about the adapter. Clones share it.
#[derive(Clone)]
pub struct GpuContext {
    /// The logical device.
    pub device: wgpu::Device,
    /// Its only queue.
    pub queue: wgpu::Queue,
    /// Name, kind and driver of the adapter.
    pub adapter: AdapterSummary,
    /// Whether passes can be timed by the device.
    pub has_timestamps: bool,
    /// Whether copies between passes can be timed too.
    pub times_copies: bool,
    /// Largest storage buffer binding in bytes.
    pub max_binding_bytes: u64,
    /// Whether embedded kernels go to the driver as [`crate::spirv`] writes them.
    pub(crate) takes_spirv: bool,
    instance: wgpu::Instance,
    opened: wgpu::Adapter,
    lost: Arc<Mutex<Option<String>>>,
    uncaptured: Arc<Mutex<Option<String>>>,
    queue_turn: QueueTurn,
    host_waits: Arc<AtomicU64>,
    made: Arc<AtomicU64>,
    gate: Option<Gate>,
    pub(super) pipelines: Option<Arc<PipelineCache>>,
    /// Read-back buffers that no submission uses now.
    pub(super) free_staging: Arc<Mutex<Vec<wgpu::Buffer>>>,
}

/// Who uses the device's queue: an OpenXR runtime may not while another thread submits work ([`super::vulkan_interop`]).
#[derive(Clone, Debug, Default)]
pub struct QueueTurn(Arc<Mutex<()>>);

impl QueueTurn {
    /// Waits for the turn, and has it until the guard is dropped.
    pub fn take(&self) -> MutexGuard<'_, ()> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// What instances are made with, unless the environment asks for other things (`WGPU_VALIDATION=1`: validation layers).
///
/// Without wgpu's check of indirect dispatches, which is a dispatch more before each of them (on llvmpipe up to a third of
/// the right eye's time at 64x64 pixels): the passes that write their sizes keep them to rows of `ROW_GROUPS` workgroups.
/// `WGPU_VALIDATION_INDIRECT_CALL=1` brings it back.
pub fn instance_flags() -> wgpu::InstanceFlags {
    wgpu::InstanceFlags::default()
        .difference(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL)
        .with_env()
}

/// What the first of `candidates` opens as that can be opened.
///
/// # Errors
/// Why the first cannot be, if none can.
fn first_usable<A, T>(
    candidates: impl IntoIterator<Item = A>,
    mut open: impl FnMut(A) -> Result<T, GpuError>,
) -> Result<T, GpuError> {
    let mut fault = None;
    for candidate in candidates {
        match open(candidate) {
            Ok(opened) => {
                if let Some(fault) = fault {
                    log::warn!("{fault}; the next adapter is used");
                }
                return Ok(opened);
            }
            Err(error) => {
                fault.get_or_insert(error);
            }
        }
    }
    Err(fault.unwrap_or(GpuError::NoAdapter))
}

fn instance() -> wgpu::Instance {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::PRIMARY;
    descriptor.flags = instance_flags();
    wgpu::Instance::new(descriptor)
}

/// Every adapter of this machine in the order of preference.
pub fn adapters() -> Vec<AdapterSummary> {
    let mut found = pollster::block_on(instance().enumerate_adapters(wgpu::Backends::PRIMARY));
    found.sort_by_key(|adapter| rank(adapter.get_info().device_type));
    found
        .iter()
        .map(|adapter| AdapterSummary::of(&adapter.get_info()))
        .collect()
}

/// Whether an adapter's name holds `wanted`, in any case.
fn is_wanted(name: &str, wanted: &str) -> bool {
    name.to_lowercase().contains(&wanted.to_lowercase())
}

/// The first of `adapters` whose name holds `wanted` (any case).
///
/// # Errors
/// [`GpuError::NoMatchingAdapter`].
pub fn first_wanted<'a>(
    adapters: &'a [AdapterSummary],
    wanted: &str,
) -> Result<&'a AdapterSummary, GpuError> {
    let mut known = adapters.iter();
    known
        .find(|adapter| is_wanted(&adapter.name, wanted))
        .ok_or_else(|| GpuError::NoMatchingAdapter {
            wanted: wanted.to_owned(),
            available: adapters
                .iter()
                .map(|adapter| &*adapter.name)
                .collect::<Vec<_>>()
                .join(", "),
        })
}

impl GpuContext {
    /// Opens the preferred adapter, or the first whose name holds `wanted` (any case). One that cannot be used is passed over
    /// with a warning, if another can.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`], [`GpuError::NoMatchingAdapter`]; of the first adapter, if none can be used,
    /// [`GpuError::Missing`] (one line that names all that is missing) or [`GpuError::Device`].
    pub fn open(wanted: Option<&str>) -> Result<Self, GpuError> {
        let instance = instance();
        let mut found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
        if found.is_empty() {
            return Err(GpuError::NoAdapter);
        }
        found.sort_by_key(|adapter| rank(adapter.get_info().device_type));
        if let Some(wanted) = wanted.filter(|name| !name.is_empty()) {
            let summary = |adapter: &wgpu::Adapter| AdapterSummary::of(&adapter.get_info());
            first_wanted(&found.iter().map(summary).collect::<Vec<_>>(), wanted)?;
            found.retain(|adapter| is_wanted(&adapter.get_info().name, wanted));
        }
        first_usable(found, |adapter| {
            Self::from_adapter(instance.clone(), adapter)
        })
    }

    fn from_adapter(instance: wgpu::Instance, adapter: wgpu::Adapter) -> Result<Self, GpuError> {
        let descriptor = Self::device_descriptor(&adapter)?;
        let (device, queue) =
            pollster::block_on(adapter.request_device(&descriptor)).map_err(|error| {
                GpuError::Device {
                    adapter: adapter.get_info().name,
                    reason: error.to_string(),
                }
            })?;
        Ok(Self::from_device(instance, adapter, device, queue))
    }

    /// Features and limits that the renderer asks of every device, however it is opened.
    ///
    /// # Errors
    /// [`GpuError::Missing`]: the adapter lacks some of them.
    #[doc(hidden)]
    pub fn device_descriptor(
        adapter: &wgpu::Adapter,
    ) -> Result<wgpu::DeviceDescriptor<'static>, GpuError> {
        let info = adapter.get_info();
        let offered = adapter.limits();
        let least = wgpu::Limits {
            max_storage_buffers_per_shader_stage: STORAGE_BUFFERS_PER_STAGE,
            max_compute_invocations_per_workgroup: WORKGROUP_INVOCATIONS,
            max_compute_workgroup_size_x: WORKGROUP_INVOCATIONS,
            ..wgpu::Limits::downlevel_defaults()
        };
        let mut missing = Vec::new();
        least.check_limits_with_fail_fn(&offered, false, |name, needed, allowed| {
            missing.push(format!("limit {name} of {needed} (has {allowed})"));
        });
        if !missing.is_empty() {
            return Err(GpuError::Missing {
                adapter: info.name,
                missing: missing.join(", "),
            });
        }
        // What a scene, a photon map or a kernel may hold depends on these, so take what there is.
        let required_limits = wgpu::Limits {
            max_storage_buffers_per_shader_stage: offered.max_storage_buffers_per_shader_stage,
            max_buffers_and_acceleration_structures_per_shader_stage: offered
                .max_buffers_and_acceleration_structures_per_shader_stage,
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            max_buffer_size: offered.max_buffer_size,
            max_texture_dimension_2d: offered.max_texture_dimension_2d,
            max_storage_textures_per_shader_stage: offered.max_storage_textures_per_shader_stage,
            ..least
        };
        // Timing is a diagnostic: without the features the renderer runs and says that it cannot time.
        let timing =
            wgpu::Features::TIMESTAMP_QUERY | wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS;
        // Embedded kernels go to the driver as crate::spirv writes them, where Vulkan takes that.
        let wanted = timing | wgpu::Features::PASSTHROUGH_SHADERS | wgpu::Features::PIPELINE_CACHE;
        let required_features = adapter.features() & wanted;
        Ok(wgpu::DeviceDescriptor {
            label: Some("stereolux"),
            required_features,
            required_limits,
            experimental_features: wgpu::ExperimentalFeatures::disabled(),
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            trace: wgpu::Trace::Off,
        })
    }

    /// A context around a device that is open already, with the features and limits of
    /// [`GpuContext::device_descriptor`].
    pub fn from_device(
        instance: wgpu::Instance,
        adapter: wgpu::Adapter,
        device: wgpu::Device,
        queue: wgpu::Queue,
    ) -> Self {
        let summary = AdapterSummary::of(&adapter.get_info());
        let lost = Arc::new(Mutex::new(None));
        let uncaptured = Arc::new(Mutex::new(None));
        let lost_in_callback = Arc::clone(&lost);
        device.set_device_lost_callback(move |reason, message| {
            if reason != wgpu::DeviceLostReason::Destroyed {
                set_once(&lost_in_callback, one_line(&message));
            }
        });
        let uncaptured_in_callback = Arc::clone(&uncaptured);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            set_once(&uncaptured_in_callback, one_line(&error.to_string()));
        }));
        log::debug!("adapter {} ({})", summary.name, summary.driver_info);
        Self {
            has_timestamps: device.features().contains(wgpu::Features::TIMESTAMP_QUERY),
            times_copies: device
                .features()
                .contains(wgpu::Features::TIMESTAMP_QUERY_INSIDE_ENCODERS),
            max_binding_bytes: device.limits().max_storage_buffer_binding_size,
            takes_spirv: takes_spirv(&device),
            device,
            queue,
            adapter: summary,
            instance,
            opened: adapter,
            lost,
            uncaptured,
            queue_turn: QueueTurn::default(),
            host_waits: Arc::default(),
            made: Arc::default(),
            gate: None,
            pipelines: None,
            free_staging: Arc::default(),
        }
    }

    /// A surface of a window for this device, and what the adapter can show on it: no formats if it cannot.
    ///
    /// # Errors
    /// One line: the instance knows no way to such windows.
    #[doc(hidden)]
    pub fn surface(
        &self,
        window: impl Into<wgpu::SurfaceTarget<'static>>,
    ) -> Result<(wgpu::Surface<'static>, wgpu::SurfaceCapabilities), String> {
        let surface = self
            .instance
            .create_surface(window)
            .map_err(|error| one_line(&error.to_string()))?;
        let capabilities = surface.get_capabilities(&self.opened);
        Ok((surface, capabilities))
    }

    /// Runs `work` under error scopes, so that what the API rejects comes back as an error that names `pass`.
    ///
    /// # Errors
    /// [`GpuError::Validation`] or [`GpuError::Lost`] beside whatever `work` returns.
    #[doc(hidden)]
    pub fn guarded<T>(
        &self,
        pass: &str,
        work: impl FnOnce() -> Result<T, GpuError>,
    ) -> Result<T, GpuError> {
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let result = work();
        let memory = pollster::block_on(memory.pop());
        let validation = pollster::block_on(validation.pop());
        self.check(pass)?;
        if let Some(error) = memory.or(validation) {
            return Err(GpuError::Validation {
                pass: pass.to_owned(),
                reason: one_line(&error.to_string()),
            });
        }
        result
    }

    /// Memory that the device has given out, bytes, where the driver's interface tells.
    pub fn allocated_bytes(&self) -> Option<u64> {
        let report = self.device.generate_allocator_report()?;
        Some(report.total_allocated_bytes)
    }

    /// Waits until the device has finished all that was submitted.
    ///
    /// # Errors
    /// [`GpuError::Lost`] if the device went away, [`GpuError::Validation`] for an error outside every scope.
    pub fn wait(&self, pass: &str) -> Result<(), GpuError> {
        self.count_wait();
        self.poll(pass, wgpu::PollType::wait_indefinitely())
    }

    /// Waits for one submission and those before it. For the end of a frame in flight, which counts as no wait of the
    /// frame that is made meanwhile.
    ///
    /// # Errors
    /// As [`GpuContext::wait`].
    pub(super) fn retire(&self, pass: &str, index: wgpu::SubmissionIndex) -> Result<(), GpuError> {
        let until = wgpu::PollType::Wait {
            submission_index: Some(index),
            timeout: None,
        };
        self.poll(pass, until)
    }

    fn poll(&self, pass: &str, until: wgpu::PollType) -> Result<(), GpuError> {
        let polled = polled(&self.device, until);
        self.check(pass)?;
        polled.map_err(|reason| GpuError::Lost {
            pass: pass.to_owned(),
            reason,
        })
    }

    /// From now on every pass is submitted by itself and waited for, if `gate` admits it, so that a frame can be given up
    /// between its passes. What a frame holds of which a pass was left out means nothing.
    pub fn set_gate(&mut self, gate: Gate) {
        self.gate = Some(gate);
    }

    /// Whether a pass is still wanted; `None` where none is ever given up.
    pub(super) fn admits(&self, label: &str) -> Option<bool> {
        self.gate.as_ref().map(|gate| gate(label))
    }

    pub(super) fn adapter_info(&self) -> wgpu::AdapterInfo {
        self.opened.get_info()
    }

    /// What pipelines are compiled with.
    pub(super) fn pipeline_cache(&self) -> Option<&wgpu::PipelineCache> {
        self.pipelines.as_ref().map(|kept| &kept.pipelines)
    }

    /// Writes what has been compiled to where it is kept, if anywhere: to be called when a set of kernels is ready.
    pub fn store_pipelines(&self) {
        if let Some(kept) = &self.pipelines {
            kept.store();
        }
    }

    /// An empty list of work.
    #[must_use]
    pub fn encoder(&self, label: &str) -> wgpu::CommandEncoder {
        let label = Some(label);
        self.device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor { label })
    }

    /// Gives work to the queue, in its turn.
    pub fn submit(&self, commands: wgpu::CommandBuffer) -> wgpu::SubmissionIndex {
        let _turn = self.queue_turn.take();
        self.queue.submit([commands])
    }

    /// The turn of whoever else uses the queue.
    pub fn queue_turn(&self) -> QueueTurn {
        self.queue_turn.clone()
    }

    /// The same device for another thread, whose waits are not those of frames.
    #[must_use]
    pub fn for_another_thread(&self) -> Self {
        Self {
            host_waits: Arc::default(),
            ..self.clone()
        }
    }

    /// Counts a wait within a frame.
    pub fn count_wait(&self) {
        self.host_waits.fetch_add(1, Ordering::Relaxed);
    }

    /// How often the host has waited for the device so far, but for ends of frames.
    pub fn host_waits(&self) -> u64 {
        self.host_waits.load(Ordering::Relaxed)
    }

    /// Counts a buffer, a texture or a pipeline that is made.
    pub fn count_made(&self) {
        self.made.fetch_add(1, Ordering::Relaxed);
    }

    /// Buffers, textures and pipelines that were made on this device so far, those of runtimes and windows aside.
    pub fn resources_made(&self) -> u64 {
        self.made.load(Ordering::Relaxed)
    }

    fn check(&self, pass: &str) -> Result<(), GpuError> {
        if let Some(reason) = take(&self.lost) {
            // Kept, so that every later call says the same.
            set_once(&self.lost, reason.clone());
            return Err(GpuError::Lost {
                pass: pass.to_owned(),
                reason,
            });
        }
        if let Some(reason) = take(&self.uncaptured) {
            return Err(GpuError::Validation {
                pass: pass.to_owned(),
                reason,
            });
        }
        Ok(())
    }
}

/// Waits until the device has finished all that was submitted. wgpu panics if the device is lost meanwhile.
///
/// # Errors
/// One line.
pub fn finish(device: &wgpu::Device) -> Result<(), String> {
    polled(device, wgpu::PollType::wait_indefinitely())
}

fn polled(device: &wgpu::Device, until: wgpu::PollType) -> Result<(), String> {
    match caught(|| device.poll(until)) {
        Ok(Ok(_)) => Ok(()),
        Ok(Err(error)) => Err(error.to_string()),
        Err(panicked) => Err(panicked),
    }
}

fn set_once(slot: &Mutex<Option<String>>, message: String) {
    slot.lock()
        .unwrap_or_else(PoisonError::into_inner)
        .get_or_insert(message);
}

fn take(slot: &Mutex<Option<String>>) -> Option<String> {
    slot.lock().unwrap_or_else(PoisonError::into_inner).take()
}

#[cfg(test)]
mod tests {
    use super::{GpuError, first_usable};

    #[test]
    fn an_adapter_that_lacks_something_gives_way_to_the_next() {
        let open = |has_enough: bool| has_enough.then_some("device").ok_or(GpuError::NoAdapter);
        assert_eq!(first_usable([false, true], open).ok(), Some("device"));
        let missing = |adapter: &str| -> Result<(), GpuError> {
            Err(GpuError::Missing {
                adapter: adapter.to_owned(),
                missing: "all".to_owned(),
            })
        };
        let fault = first_usable(["first", "second"], missing).err();
        let said = fault.map(|fault| fault.to_string());
        assert!(said.is_some_and(|said| said.contains("first")));
    }
}
