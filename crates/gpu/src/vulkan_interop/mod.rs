//! Dealings with Vulkan that wgpu does not cover, or calls unsafe; `unsafe` lives here and nowhere else.
#![allow(unsafe_code)]

#[cfg(not(target_vendor = "apple"))]
pub mod openxr;

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

/// A module of an embedded shader, its loops without the counters that wgpu has naga add, which ends them by force after 2^64
/// turns. They cost an eighth of a gather's time on an H200, and drivers take loops with them for others than they are. Bounds
/// of memory are checked as everywhere.
///
/// Not for what an application or a user wrote: nobody has proved that its loops end.
pub(crate) fn module_of_embedded(
    device: &wgpu::Device,
    descriptor: wgpu::ShaderModuleDescriptor<'_>,
) -> wgpu::ShaderModule {
    let checks = wgpu::ShaderRuntimeChecks {
        force_loop_bounding: false,
        ..wgpu::ShaderRuntimeChecks::checked()
    };
    // SAFETY: what is asked for is that all loops end. Those of embedded shaders count up to a bound that does not change
    // meanwhile, but for these: rays and refits follow hierarchies, whose builders make trees; the kd-tree's walk goes round
    // a tree of numbers (Wald 2022); paths and batches of photons end at a depth or at the list's end.
    unsafe { device.create_shader_module_trusted(descriptor, checks) }
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
