//! What GPU tests share: one device, said aloud.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use stereolux::gpu::context::{GpuContext, adapters};
use stereolux::options::{Eyes, Settings};
use stereolux::renderer::Renderer;
use stereolux::scene::Scene;
use stereolux::xr::{Fov, View};

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
            panic!("no adapter for the tests (wanted {wanted:?}, found {found:?}): install mesa-vulkan-drivers or set STEREOLUX_TEST_ADAPTER");
        };
        // Past the harness's capture, so that it is seen.
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), "GPU tests run on: {} ({})", chosen.name, chosen.driver_info);
        chosen.name.clone()
    })
}

/// A device of its own; at most two tests hold one at a time, because a software device takes all cores anyway.
pub fn context() -> GpuContext {
    GpuContext::open(Some(adapter_name())).expect("the adapter opens")
}

/// Holds others back while a test fills memory or measures ratios.
pub fn alone() -> MutexGuard<'static, ()> {
    static LOCK: Mutex<()> = Mutex::new(());
    LOCK.lock().unwrap_or_else(PoisonError::into_inner)
}
