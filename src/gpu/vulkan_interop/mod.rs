//! Dealings with the Vulkan loader that wgpu does not cover; `unsafe` lives here and nowhere else.
#![allow(unsafe_code)]

#[cfg(not(target_vendor = "apple"))]
pub mod openxr;

/// Switches off Mesa's implicit device-selection layer for this process, unless the user has set its variable.
///
/// The layer reorders devices, which [`super::context`] does by rules of its own, and it complains on stderr where
/// there is no display (`XDG_RUNTIME_DIR is invalid`), in the middle of messages that promise to be one line.
///
/// Call first thing in `main`.
pub fn disable_device_select_layer() {
    const SWITCH: &str = "NODEVICE_SELECT";
    if std::env::var_os(SWITCH).is_none() {
        // SAFETY: no other thread exists yet, so nobody reads the environment while it changes.
        unsafe { std::env::set_var(SWITCH, "1") };
    }
}

/// Keeps the OpenXR loader from printing its own report of every library that it tries, unless the user has set its
/// variable: what matters of it comes back as one line of ours.
///
/// Call first thing in `main`.
pub fn quiet_openxr_loader() {
    const LEVEL: &str = "XR_LOADER_DEBUG";
    if std::env::var_os(LEVEL).is_none() {
        // SAFETY: no other thread exists yet, so nobody reads the environment while it changes.
        unsafe { std::env::set_var(LEVEL, "none") };
    }
}
