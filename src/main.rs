//! The `stereolux` program: flags to checked options to a command; errors to an exit status.

use std::io::Write as _;
use std::process::ExitCode;

use stereolux::commands::execute;
use stereolux::gpu::vulkan_interop::{disable_device_select_layer, quiet_openxr_loader};
use stereolux::options::parse;

fn main() -> ExitCode {
    disable_device_select_layer();
    quiet_openxr_loader();
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or(
        // wgpu reports each adapter quirk as a warning; what matters to a user comes back as an error.
        "warn,wgpu=error,wgpu_core=error,wgpu_hal=error,naga=error",
    ))
    .format_target(false)
    .format_timestamp(None)
    .init();
    let options = match parse(std::env::args_os()) {
        Ok(options) => options,
        Err(exit) => {
            if exit.status == 0 {
                // A closed pipe is the reader's choice.
                let _ = write!(std::io::stdout(), "{}", exit.text);
                return ExitCode::SUCCESS;
            }
            eprintln!("{}", exit.text.trim_end());
            return ExitCode::from(exit.status);
        }
    };
    match execute(options) {
        Ok(status) => ExitCode::from(status),
        Err(failure) => {
            eprintln!("error: {}", failure.message);
            ExitCode::from(failure.status)
        }
    }
}
