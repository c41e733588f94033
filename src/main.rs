//! The `stereolux` program: flags to checked options to a command; errors to an exit status.

use std::io::Write as _;
use std::process::ExitCode;

use stereolux::commands::{execute, start_log};
use stereolux::gpu::vulkan_interop::{disable_device_select_layer, quiet_openxr_loader};
use stereolux::options::parse;

fn main() -> ExitCode {
    disable_device_select_layer();
    quiet_openxr_loader();
    start_log();
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
