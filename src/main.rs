//! The `stereolux` program.

fn main() -> std::process::ExitCode {
    stereolux::main()
}
