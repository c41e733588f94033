//! Dealings with Vulkan that wgpu does not cover, or calls unsafe; `unsafe` lives here and nowhere else.
#![allow(unsafe_code)]

#[cfg(not(target_vendor = "apple"))]
pub mod openxr;

use std::borrow::Cow;

use crate::context::{GpuContext, GpuError};
use crate::kernel::Binding;
use crate::shaders::CompiledShader;
use crate::spirv::module_words;

/// Switches off Mesa's implicit device-selection layer for this process, unless the user has set its variable.
///
/// The layer reorders devices, which the choice of an adapter does by rules of its own, and it complains on stderr where
/// there is no display (`XDG_RUNTIME_DIR is invalid`), in the middle of messages that promise to be one line.
///
/// Call first thing in `main`: once there is another thread, it does nothing.
pub fn disable_device_select_layer() {
    set_if_unset("NODEVICE_SELECT", "1");
}

/// Keeps the OpenXR loader from printing its own report of every library that it tries, unless the user has set its
/// variable: what matters of it comes back as one line of ours.
///
/// Call first thing in `main`: once there is another thread, it does nothing.
pub fn quiet_openxr_loader() {
    set_if_unset("XR_LOADER_DEBUG", "none");
}

/// Whether a device takes a kernel's words as [`crate::spirv`] writes them: Vulkan 1.3, and the driver checks bounds itself.
#[cfg(not(target_vendor = "apple"))]
pub(crate) fn takes_spirv(device: &wgpu::Device) -> bool {
    use ash::{ext, vk};
    if !device
        .features()
        .contains(wgpu::Features::PASSTHROUGH_SHADERS)
    {
        return false;
    }
    // SAFETY: the guard lives until this function returns, and the device is not destroyed through it.
    let Some(open) = (unsafe { device.as_hal::<wgpu::hal::api::Vulkan>() }) else {
        return false;
    };
    // wgpu leaves the extension out where a driver's is broken, and asks for all of what is there otherwise.
    if !open
        .enabled_device_extensions()
        .contains(&ext::robustness2::NAME)
    {
        return false;
    }
    let instance = open.shared_instance().raw_instance();
    let physical = open.raw_physical_device();
    let mut bounds = vk::PhysicalDeviceRobustness2FeaturesEXT::default();
    let mut features = vk::PhysicalDeviceFeatures2::default().push_next(&mut bounds);
    // SAFETY: plain queries on a live instance; the second is part of Vulkan 1.1.
    let version = unsafe {
        let version = instance
            .get_physical_device_properties(physical)
            .api_version;
        if version >= vk::API_VERSION_1_3 {
            instance.get_physical_device_features2(physical, &mut features);
        }
        version
    };
    version >= vk::API_VERSION_1_3
        && bounds.robust_buffer_access2 == vk::TRUE
        && bounds.robust_image_access2 == vk::TRUE
}

/// Metal takes none.
#[cfg(target_vendor = "apple")]
pub(crate) fn takes_spirv(_device: &wgpu::Device) -> bool {
    false
}

/// A module of an embedded shader, as [`crate::spirv`] describes it or, where a device does not take that, as wgpu has naga
/// write it, but without counters of loops.
///
/// Not for what an application or a user wrote: nobody has proved that its loops end and that its arrays are written first.
pub(crate) fn module_of_embedded(
    context: &GpuContext,
    pass: &str,
    shader: &CompiledShader,
    bindings: &[Binding],
) -> Result<wgpu::ShaderModule, GpuError> {
    let device = &context.device;
    if context.takes_spirv {
        let words = module_words(shader, bindings)?;
        let entry_points = [wgpu::PassthroughShaderEntryPoint {
            name: "main".into(),
            workgroup_size: (1, 1, 1), // Metal's
        }];
        let descriptor = wgpu::ShaderModuleDescriptorPassthrough {
            label: Some(pass),
            entry_points: Cow::Borrowed(&entry_points),
            spirv: Some(Cow::Owned(words)),
            ..Default::default()
        };
        // SAFETY: naga validated the module and wrote the words; `takes_spirv` says that their version and what they leave to
        // the driver's checks of bounds are the device's. The layout that the pipeline gets is reflected from the same module.
        // Loops end as said below; private arrays are stacks and heaps, of which nothing is read that was not put there.
        return Ok(unsafe { device.create_shader_module_passthrough(descriptor) });
    }
    let checks = wgpu::ShaderRuntimeChecks {
        force_loop_bounding: false,
        ..wgpu::ShaderRuntimeChecks::checked()
    };
    // SAFETY: what is asked for is that all loops end. Those of embedded shaders count up to a bound that does not change
    // meanwhile, but for these: rays and refits follow hierarchies, whose builders make trees; the kd-tree's walk goes round
    // a tree of numbers (Wald 2022); paths and batches of photons end at a depth or at the list's end.
    Ok(unsafe { device.create_shader_module_trusted(shader.descriptor(pass), checks) })
}

/// A driver's store of compiled pipelines, holding what `known` does, on a device with [`wgpu::Features::PIPELINE_CACHE`].
pub(crate) fn pipelines_from(device: &wgpu::Device, known: Option<&[u8]>) -> wgpu::PipelineCache {
    let descriptor = wgpu::PipelineCacheDescriptor {
        label: Some("pipelines"),
        data: known,
        fallback: true,
    };
    // SAFETY: `known` is what wgpu wrote for this device: it comes from a file named after it with a checksum that is right, and
    // wgpu compares the driver's identity.
    unsafe { device.create_pipeline_cache(&descriptor) }
}

/// Sets a variable of this process that has no value, if that is safe.
fn set_if_unset(name: &str, value: &str) {
    if std::env::var_os(name).is_none() && may_set_variables() {
        // SAFETY: nobody else can read the environment while it changes, as was just found out.
        unsafe { std::env::set_var(name, value) };
    }
}

/// Whether the environment can be changed without another thread reading it: always on Windows, which locks it; elsewhere
/// while this thread is the only one, which can start no other meanwhile. Where the system does not say, no.
fn may_set_variables() -> bool {
    if cfg!(windows) {
        return true;
    }
    let threads = std::fs::read_dir("/proc/self/task");
    threads.is_ok_and(|threads| threads.count() == 1)
}

#[cfg(test)]
mod tests {
    #[cfg(unix)]
    #[test]
    fn with_other_threads_about_the_environment_stays_as_it_is() {
        let (stop, wait) = std::sync::mpsc::channel::<()>();
        let other = std::thread::spawn(move || wait.recv());
        super::set_if_unset("STEREOLUX_TEST_VARIABLE", "1");
        assert_eq!(std::env::var_os("STEREOLUX_TEST_VARIABLE"), None);
        drop(stop);
        assert!(other.join().unwrap().is_err());
    }
}
