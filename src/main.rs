//! The `stereolux` program: flags to checked options to a command; errors to an exit status.

use std::io::Write as _;
use std::process::ExitCode;

use stereolux::commands::{Failure, execute, start_log};
use stereolux::gpu::vulkan_interop::{disable_device_select_layer, quiet_openxr_loader};
use stereolux::options::{parse, resolve};

fn main() -> ExitCode {
    disable_device_select_layer();
    quiet_openxr_loader();
    start_log();
    let cli = match parse(std::env::args_os()) {
        Ok(cli) => cli,
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
    let outcome = resolve(cli).map_err(Failure::from).and_then(execute);
    match outcome {
        Ok(status) => ExitCode::from(status),
        Err(failure) => {
            eprintln!("error: {}", failure.message);
            ExitCode::from(failure.status)
        }
    }
}
