//! What the OpenXR tests share: Monado through `scripts/monado.sh`, its remote driver, statistics of a run.

use std::io::Write as _;
use std::net::TcpStream;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use crate::suite::support::{Folder, exrs, lines, words};
pub use crate::suite::support::{interrupt, stats, stderr, wait_until};

/// The program under test.
pub const PROGRAM: &str = env!("CARGO_BIN_EXE_stereolux");

/// `scripts/monado.sh` with its own options; add the command to run.
pub fn monado(options: &[&str]) -> Command {
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/monado.sh");
    let mut command = Command::new(script);
    command.args(options);
    command.stdin(Stdio::null());
    command
}

/// Runs `stereolux` against Monado; `options` are the script's.
pub fn stereolux_on_monado(options: &[&str], args: &[&str]) -> Output {
    output_on_monado(monado(options).arg(PROGRAM).args(args))
}

/// Holds the recording of a live session, `trace.jsonl` beside its folder `live`, against its replay: how many images
/// are the same. Both were given the arguments `common`.
pub fn replayed_images(folder: &Folder, common: &[&str]) -> usize {
    let [live, replayed, trace] = ["live", "replayed", "trace.jsonl"].map(|name| folder.join(name));
    let mut args = vec!["run", "--trace", trace.to_str().unwrap()];
    args.extend(["--out", replayed.to_str().unwrap()]);
    args.extend(common);
    args.extend(FILES_AS_IN_A_REPLAY);
    assert_status(&stereolux_on_monado(&["--no-service"], &args), 0);
    assert_same_images(&live, &replayed)
}

/// Arguments of a session whose recording [`replayed_images`] takes: `command` and `common`.
pub fn recorded_session(folder: &Folder, command: &str, common: &[&str]) -> Vec<String> {
    let out = folder.join("live").display().to_string();
    let trace = folder.join("trace.jsonl").display().to_string();
    let files = ["--out", &out, "--record", &trace];
    let all = [&words(command)[..], &files, common, &FILES_AS_IN_A_REPLAY].concat();
    all.into_iter().map(str::to_owned).collect()
}

/// The script's exit status where Monado's service crashed by itself.
pub const SERVICE_CRASHED: i32 = 75;

/// What `command` (of [`monado`]) printed; run again, and said so, where Monado's service crashed by itself.
pub fn output_on_monado(command: &mut Command) -> Output {
    let mut output = command.output().unwrap();
    for _ in 0..2 {
        if output.status.code() != Some(SERVICE_CRASHED) {
            break;
        }
        eprintln!("AGAIN: {}", stderr(&output));
        output = command.output().unwrap();
    }
    output
}

/// What a program printed, on either stream.
pub fn all_output(output: &Output) -> String {
    let stdout = String::from_utf8_lossy(&output.stdout);
    format!("{stdout}\n{}", stderr(output))
}

/// Fails with what was printed unless the exit status is `status`.
pub fn assert_status(output: &Output, status: i32) {
    assert_eq!(output.status.code(), Some(status), "{}", all_output(output));
}

/// Lines of `stats.jsonl` so far.
pub fn frames_so_far(out: &Path) -> usize {
    lines(&out.join("stats.jsonl"))
}

/// Every `.exr` of two folders is there in both and equal byte for byte; the number of files.
pub fn assert_same_images(a: &Path, b: &Path) -> usize {
    let [a, b] = [a, b].map(exrs);
    assert!(a.keys().eq(b.keys()), "{:?}, {:?}", a.keys(), b.keys());
    for (name, bytes) in &a {
        assert!(*bytes == b[name], "{name} differs");
    }
    a.len()
}

/// One eye as the remote driver takes it: pose relative to the head, f32 as sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RemoteEye {
    /// Left, right, up, down, radians.
    pub fov: [f32; 4],
    /// x, y, z, w.
    pub orientation: [f32; 4],
    /// Metres.
    pub position: [f32; 3],
}

/// What the remote driver is sent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Remote {
    /// Left, right.
    pub eyes: [RemoteEye; 2],
    /// Head: x, y, z, w.
    pub head_orientation: [f32; 4],
    /// Head, metres; the floor is at 0.
    pub head_position: [f32; 3],
    /// Left and right stick.
    pub sticks: [[f32; 2]; 2],
    /// A and B of the left controller.
    pub a: bool,
    /// See `a`.
    pub b: bool,
}

impl Remote {
    /// The packet of Monado's remote driver, protocol `mndrmt3` (its source: `drivers/remote/r_interface.h`).
    pub fn packet(&self) -> Vec<u8> {
        let mut bytes = b"mndrmt3\0".to_vec();
        let floats = |bytes: &mut Vec<u8>, values: &[f32]| {
            bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
        };
        for eye in &self.eyes {
            floats(&mut bytes, &eye.fov);
            floats(&mut bytes, &eye.orientation);
            floats(&mut bytes, &eye.position);
            bytes.extend_from_slice(&[0; 4]);
        }
        floats(&mut bytes, &self.head_orientation);
        floats(&mut bytes, &self.head_position);
        // Per-eye data are valid.
        bytes.extend_from_slice(&[1, 0, 0, 0]);
        for (hand, stick) in self.sticks.iter().enumerate() {
            // Pose, velocities, five fingers, trigger, squeeze and its force.
            floats(&mut bytes, &[0.0, 0.0, 0.0, 1.0, 0.0, 1.2, -0.3]);
            floats(&mut bytes, &[0.0; 6 + 5 + 3]);
            floats(&mut bytes, stick);
            floats(&mut bytes, &[0.0; 3]);
            let left = hand == 0;
            let mut flags = [0_u8; 16];
            flags[1] = 1; // active
            flags[4] = u8::from(left && self.a);
            flags[6] = u8::from(left && self.b);
            bytes.extend_from_slice(&flags);
        }
        assert_eq!(bytes.len(), 376);
        bytes
    }
}

/// The remote driver's port is fixed: one test at a time.
pub fn remote_port() -> MutexGuard<'static, ()> {
    static PORT: Mutex<()> = Mutex::new(());
    PORT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Sends what `script` says for each frame number (counted by `out`'s statistics), to one service after the other: one
/// that crashed is started again ([`output_on_monado`]), and the last test's may still be on its way out. Ends when what is
/// returned, all that was sent, is dropped.
pub fn drive(
    out: &Path,
    script: impl Fn(usize) -> Remote + Send + 'static,
) -> Arc<Mutex<Vec<Remote>>> {
    let sent = Arc::new(Mutex::new(Vec::new()));
    let log = Arc::downgrade(&sent);
    let out = out.to_owned();
    std::thread::spawn(move || {
        let mut service = None;
        while let Some(log) = log.upgrade() {
            let remote = script(frames_so_far(&out));
            let stream = service
                .take()
                .or_else(|| TcpStream::connect(("127.0.0.1", 4242)).ok());
            service = stream.filter(|mut stream| stream.write_all(&remote.packet()).is_ok());
            if service.is_some() {
                log.lock().unwrap().push(remote);
            }
            std::thread::sleep(Duration::from_millis(10));
        }
    });
    sent
}

/// What a headset session leaves to its own defaults, as a replay of it must have it.
pub const FILES_AS_IN_A_REPLAY: [&str; 4] = ["--reuse", "scatter", "--set", "output.images=true"];
