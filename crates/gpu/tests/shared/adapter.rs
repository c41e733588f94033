//! The one adapter that tests run on, said aloud.

use std::sync::OnceLock;

use stereolux_gpu::context::{GpuContext, adapters};

/// Name of the adapter that tests run on: a software one, unless `STEREOLUX_TEST_ADAPTER` says otherwise.
/// Fails where there is none: a test that needs a driver does not pass by skipping.
pub fn adapter_name() -> &'static str {
    static NAME: OnceLock<String> = OnceLock::new();
    NAME.get_or_init(|| {
        let found = adapters();
        let wanted = std::env::var("STEREOLUX_TEST_ADAPTER").unwrap_or_default();
        let chosen = match wanted.as_str() {
            "" => found.iter().find(|adapter| adapter.is_software()),
            "any" => found.first(),
            part => found.iter().find(|adapter| adapter.name.to_lowercase().contains(&part.to_lowercase())),
        };
        let Some(chosen) = chosen else {
            panic!(
                "no adapter for the tests (wanted {wanted:?}, found {found:?}): install mesa-vulkan-drivers or set \
                 STEREOLUX_TEST_ADAPTER"
            );
        };
        // Past the harness's capture, so that it is seen.
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), "GPU tests run on: {} ({})", chosen.name, chosen.driver_info);
        chosen.name.clone()
    })
}

/// A device of its own.
pub fn context() -> GpuContext {
    GpuContext::open(Some(adapter_name())).expect("the adapter opens")
}
