//! Everything that talks to wgpu: the device, shaders, kernels, buffers, timing and read-back.
//!
//! - [`context`]: adapter choice, device, errors;
//! - [`shaders`]: WESL sources, specialised by features, to WGSL;
//! - [`kernel`]: one compute pipeline whose bindings are found by name;
//! - [`spirv`]: what a kernel is to a Vulkan driver;
//! - `pipeline_cache`: what the driver made of it, for the next run;
//! - [`raster`]: one render pipeline over a triangle, likewise;
//! - [`buffers`]: labelled buffers, uploads and read-back;
//! - [`texels`]: copies of buffers in textures, for adapters that read those faster;
//! - [`timing`]: timestamp queries per pass;
//! - [`vulkan_interop`]: the one place where `unsafe` is allowed.
//!
//! Nothing here knows scenes, passes or what buffers hold.

pub mod buffers;
pub mod context;

pub mod kernel;
mod pipeline_cache;
pub mod raster;
pub mod shaders;
pub mod spirv;
pub mod texels;
pub mod timing;
pub mod vulkan_interop;

pub use buffers::{
    ArrayBuffer, GrowingBuffer, storage_buffer, storage_buffer_with_data, uniform_buffer,
};
pub use context::{Gate, GpuContext, GpuError, QueueTurn};
pub use kernel::{Kernel, Resources};
pub use shaders::{CompiledShader, ShaderLibrary};
pub use stereolux_base::features::{self, ShaderFeatures};
pub use timing::{FrameRecorder, HostSpan, PassTimes, Submission, Ticket, Workgroups};
