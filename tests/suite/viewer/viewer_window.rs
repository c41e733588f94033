//! The viewer's window on a virtual screen, driven by real X events.

use std::ffi::OsString;
use std::io::IoSlice;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitCode, Stdio};
use std::time::{Duration, Instant};

use stereolux::images::{ImageRgb, read_image, write_exr};
use stereolux::run_app_with;
use stereolux_base::random;
use x11rb::connection::{Connection as _, RequestConnection as _};
use x11rb::protocol::xproto::{
    BUTTON_PRESS_EVENT, BUTTON_RELEASE_EVENT, ConnectionExt as _, InputFocus, KEY_PRESS_EVENT,
    KEY_RELEASE_EVENT, MOTION_NOTIFY_EVENT,
};
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

use super::drag::drag_file;
use super::openxr_picture::Screen;
use super::openxr_runtime::{VALIDATION, complaints};
use super::openxr_support::PROGRAM;
use super::virtual_screen::{Xvfb, ask_to_close, find_window, program_on};
use crate::suite::program::{
    application::{run_well, with_trace},
    panels::Counter,
};
use crate::suite::support::{
    Folder, adapter_name, assert_says, resident_kb, stderr, stereolux, words,
};

/// Long enough for a loaded machine; reached only by a fault.
const PATIENCE: Duration = Duration::from_secs(120);

/// The program in its window, and a person's hands.
struct Desk {
    child: Child,
    connection: RustConnection,
    keys: Vec<(u32, u8)>,
    /// Number of the extension by which events are made.
    xtest: u8,
    screen: PathBuf,
    display: String,
    log: PathBuf,
}

impl Desk {
    /// The program with [`SCENE`], once its picture is seen.
    fn open(folder: &Folder, xvfb: &Xvfb) -> Self {
        let mut command = Command::new(PROGRAM);
        command.arg("view").args(words(SCENE));
        command.args(["--adapter", adapter_name()]);
        Self::of(command.arg("--out").arg(folder.join("out")), folder, xvfb)
    }

    /// What `command` starts, once its picture is seen.
    fn of(command: &mut Command, folder: &Folder, xvfb: &Xvfb) -> Self {
        let log = folder.join("log");
        let mut child = command
            .env("DISPLAY", &xvfb.display)
            .env("WINIT_X11_SCALE_FACTOR", "1")
            .env("XDG_CONFIG_HOME", folder.join("config"))
            .env_remove("WAYLAND_DISPLAY")
            // glibc gives threads heaps of their own and keeps what is freed there: resident memory would grow with every
            // renderer that is made and then no more, which hides a leak and looks like one.
            .env("MALLOC_ARENA_MAX", "1")
            .env("RUST_LOG", "warn,stereolux::viewer::worker=debug")
            .envs(VALIDATION)
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(&log).unwrap())
            .spawn()
            .unwrap();
        let (connection, window) = find_window(&xvfb.display);
        assert!(child.try_wait().unwrap().is_none(), "{}", read(&log));
        // No window manager gives it the keyboard.
        connection
            .set_input_focus(InputFocus::PARENT, window, x11rb::CURRENT_TIME)
            .unwrap();
        connection.sync().unwrap();
        let setup = connection.setup();
        let (first, count) = (setup.min_keycode, setup.max_keycode - setup.min_keycode + 1);
        let map = connection.get_keyboard_mapping(first, count).unwrap();
        let map = map.reply().unwrap();
        let per_key = usize::from(map.keysyms_per_keycode);
        let keys = map.keysyms.chunks(per_key).zip(first..);
        let keys = keys.map(|(symbols, code)| (symbols[0], code)).collect();
        let extension = connection.query_extension(b"XTEST").unwrap();
        let extension = extension.reply().unwrap();
        assert!(extension.present);
        let mut desk = Self {
            child,
            connection,
            keys,
            xtest: extension.major_opcode,
            screen: xvfb.screen.clone(),
            display: xvfb.display.clone(),
            log,
        };
        desk.until("a picture", |desk| lit(&desk.look()) > PICTURE);
        desk
    }

    fn send(&self, kind: u8, detail: u8, x: i16, y: i16) {
        let root = self.connection.setup().roots[0].root;
        // XTEST 2.2, FakeInput. Written out: the crate's feature for it would have winit compiled a second time for tests.
        let mut request = [0; 36];
        request[0] = self.xtest;
        request[1] = 2;
        request[2..4].copy_from_slice(&9_u16.to_ne_bytes());
        request[4] = kind;
        request[5] = detail;
        request[12..16].copy_from_slice(&root.to_ne_bytes());
        request[24..26].copy_from_slice(&x.to_ne_bytes());
        request[26..28].copy_from_slice(&y.to_ne_bytes());
        let request = [IoSlice::new(&request)];
        let sent = self
            .connection
            .send_request_without_reply(&request, Vec::new());
        sent.unwrap();
        self.connection.sync().unwrap();
    }

    /// Presses or releases the key of an X keysym.
    fn key(&self, keysym: u32, pressed: bool) {
        let (_, code) = self.keys.iter().find(|key| key.0 == keysym).unwrap();
        let kind = [KEY_RELEASE_EVENT, KEY_PRESS_EVENT][usize::from(pressed)];
        self.send(kind, *code, 0, 0);
    }

    /// Presses a key while Ctrl is down.
    fn command(&self, keysym: u32) {
        self.key(keysym::CONTROL, true);
        self.press(keysym);
        self.key(keysym::CONTROL, false);
    }

    fn press(&self, keysym: u32) {
        self.key(keysym, true);
        std::thread::sleep(Duration::from_millis(30));
        self.key(keysym, false);
    }

    fn point(&self, x: i16, y: i16) {
        self.send(MOTION_NOTIFY_EVENT, 0, x, y);
    }

    fn button(&self, number: u8, pressed: bool) {
        let kind = [BUTTON_RELEASE_EVENT, BUTTON_PRESS_EVENT][usize::from(pressed)];
        self.send(kind, number, 0, 0);
    }

    fn click(&self, x: i16, y: i16) {
        self.point(x, y);
        std::thread::sleep(Duration::from_millis(100));
        self.button(1, true);
        std::thread::sleep(Duration::from_millis(60));
        self.button(1, false);
    }

    fn until(&mut self, what: &str, mut done: impl FnMut(&Self) -> bool) {
        let began = Instant::now();
        while !done(self) {
            let ended = self.child.try_wait().unwrap();
            let is_in_vain = ended.is_some() || began.elapsed() > PATIENCE;
            assert!(!is_in_vain, "{what}: {ended:?}\n{}", read(&self.log));
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    fn look(&self) -> Screen {
        Screen::read(&self.screen)
    }

    /// Kilobytes of memory that the process has in use besides its renderers' device memory, which on a software adapter
    /// is the host's.
    fn own_kb(&self) -> u64 {
        let said = read(&self.log);
        let device = said
            .lines()
            .rev()
            .find_map(|line| line.split_once("device memory: ")?.1.strip_suffix(" bytes"));
        let device_kb = device.map_or(0, |bytes| bytes.parse::<u64>().unwrap() / 1024);
        let resident_kb = resident_kb(&self.child.id().to_string());
        // What a device has given out and nobody has written yet is not resident.
        (resident_kb as u64).saturating_sub(device_kb)
    }

    /// Waits until the program has ended well.
    fn ends(&mut self) {
        let began = Instant::now();
        while self.child.try_wait().unwrap().is_none() {
            assert!(began.elapsed() < PATIENCE, "{}", read(&self.log));
            std::thread::sleep(Duration::from_millis(50));
        }
        let status = self.child.wait().unwrap();
        assert_eq!(status.code(), Some(0), "{}", read(&self.log));
    }

    /// Closes the window, and checks how the program ended.
    fn close(mut self) -> String {
        ask_to_close(&self.display);
        self.ends();
        let said = read(&self.log);
        assert_eq!(complaints(&said), Vec::<&str>::new());
        assert!(!said.contains("panicked"), "{said}");
        said
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

/// X keysyms.
mod keysym {
    pub const ESCAPE: u32 = 0xff1b;
    pub const F1: u32 = 0xffbe;
    pub const F12: u32 = 0xffc9;
    pub const RETURN: u32 = 0xff0d;
    pub const Q: u32 = 0x71;
    pub const W: u32 = 0x77;
    pub const D: u32 = 0x64;
    pub const A: u32 = 0x61;
    pub const Z: u32 = 0x7a;
    pub const CONTROL: u32 = 0xffe3;
    pub const DELETE: u32 = 0xffff;
    pub const HOME: u32 = 0xff50;
}

/// Bright pixels in the middle of the screen, where the pictures are: the scene is lit, the panels around are dark.
fn lit(screen: &Screen) -> usize {
    let places = (150..600).flat_map(|y| (220..890).map(move |x| (x, y)));
    let is_lit = |(x, y): &(usize, usize)| screen.pixel(*x, *y).into_iter().any(|c| c > 100);
    places.filter(is_lit).count()
}

/// More bright pixels than this are a picture of the room; without one there are none.
const PICTURE: usize = 500;

const SCENE: &str = "--scene builtin:cornell --size 96x96 --method path --set path.max_depth=3";

#[test]
fn a_window_opens_answers_keys_and_mouse_takes_screenshots_and_closes() {
    let folder = Folder::new("viewer-window");
    let xvfb = Xvfb::start(&folder);
    let mut desk = Desk::open(&folder, &xvfb);
    let at_start = lit(&desk.look());

    // Walking towards the room makes it larger.
    desk.point(500, 300);
    desk.key(keysym::W, true);
    let grows = |desk: &Desk| lit(&desk.look()) > at_start * 5 / 4;
    desk.until("the room to grow", grows);
    desk.key(keysym::W, false);

    // F1 lists the keys, bright letters beyond the pictures too, and Esc takes them away: a click would fall on them.
    let letters = |desk: &Desk| {
        let now = desk.look();
        let below = (515..615).flat_map(|y| (400..900).map(move |x| (x, y)));
        below.filter(|(x, y)| now.pixel(*x, *y)[1] > 150).count()
    };
    assert_eq!(letters(&desk), 0);
    desk.press(keysym::F1);
    desk.until("the help", |desk| letters(desk) > 100);
    desk.press(keysym::ESCAPE);
    desk.until("the help to go", |desk| letters(desk) == 0);

    // A click on the middle of the left picture selects what is there: its outline is drawn, the inspector fills.
    let before = desk.look();
    desk.click(390, 360);
    let inspector = |screen: &Screen| {
        let text = (60..400).flat_map(|y| (920..1270).map(move |x| (x, y)));
        text.filter(|(x, y)| screen.pixel(*x, *y)[0] > 150).count()
    };
    let empty = inspector(&before);
    desk.until("the inspector", |desk| {
        inspector(&desk.look()) > empty + 200
    });

    desk.press(keysym::F12);
    let png = folder.join("out").join("view_0000.png");
    desk.until("a screenshot", |_| png.exists());
    let picture = read_image(&png).unwrap();
    assert_eq!([picture.width, picture.height], [192, 96]);
    for eye in ["left", "right"] {
        assert!(folder.join(&format!("out/view_0000_{eye}.exr")).exists());
    }

    // It keeps its size for the next time.
    let said = desk.close();
    assert!(!said.contains("[ERROR"), "{said}");
    let memory = read(&folder.join("config").join("stereolux").join("viewer.toml"));
    assert_says(&memory, &["size = [1280.0, ", "layout = \"side-by-side\""]);
}

#[test]
fn a_path_is_typed_into_its_window_escape_closes_menus_and_ctrl_q_quits() {
    let folder = Folder::new("viewer-path");
    let xvfb = Xvfb::start(&folder);
    let mut desk = Desk::open(&folder, &xvfb);
    let pause = || std::thread::sleep(Duration::from_millis(500));
    // File, and its first entry.
    desk.click(22, 12);
    pause();
    desk.click(40, 36);
    pause();
    // Of these, `t` alone takes a screenshot, and `e` and `s` walk.
    for letter in "test.glb".bytes() {
        desk.press(u32::from(letter));
    }
    desk.press(keysym::RETURN);
    desk.until("an error", |desk| read(&desk.log).contains("test.glb"));
    assert!(!folder.join("out").join("view_0000.png").exists());
    // Esc closes the menu, and then nothing is left that it could close.
    desk.click(22, 12);
    for _ in 0..3 {
        pause();
        desk.press(keysym::ESCAPE);
    }
    pause();
    assert!(desk.child.try_wait().unwrap().is_none(), "Esc has quit");
    desk.command(keysym::Q);
    desk.ends();
}

#[test]
fn without_a_display_view_is_refused_in_one_line_that_names_run() {
    let folder = Folder::new("viewer-none");
    for (display, says) in [
        (None, "neither DISPLAY nor WAYLAND_DISPLAY names a display"),
        (Some(":4078"), "no window can be opened"),
    ] {
        let output = program_on(display)
            .args(["view", "--out"])
            .arg(folder.join("out"))
            .output()
            .unwrap();
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert_says(&said, &[says, "`run`"]);
        assert_eq!(said.lines().count(), 1, "{said}");
    }
    // What cannot be shown is said before a window is looked for.
    let output = stereolux(&["view", "--scene", "builtin:nowhere"]);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn a_file_that_is_dragged_onto_the_window_opens_and_a_broken_one_is_refused() {
    let folder = Folder::new("viewer-drag");
    let xvfb = Xvfb::start(&folder);
    let mut desk = Desk::open(&folder, &xvfb);
    let room_alone = lit(&desk.look());

    // A path that has to be written otherwise in a list of addresses.
    let broken = folder.write("100 % broken.glb", b"glTF\x02\0\0\0 this is no scene");
    drag_file(&xvfb.display, &broken, 500, 300);
    let says = |desk: &Desk, name: &str| {
        let said = read(&desk.log);
        said.lines()
            .any(|line| line.contains("[ERROR") && line.contains(name))
    };
    desk.until("an error", |desk| says(desk, "100 % broken.glb"));
    // Waited for, since the first frames of single samples may have half as many bright pixels as one another.
    desk.until("the old scene", |desk| lit(&desk.look()) > room_alone / 2);

    // A bright sky is seen wherever the room is not.
    let sky = folder.join("sky.exr");
    write_exr(&sky, &ImageRgb::filled(8, 4, [4.0; 3]).unwrap()).unwrap();
    drag_file(&xvfb.display, &sky, 500, 300);
    desk.until("the sky", |desk| lit(&desk.look()) > 2 * room_alone);
    desk.close();
}

/// Minutes of random use. `STEREOLUX_SOAK_S` says how many seconds; without it this is a short rehearsal.
#[test]
fn random_use_breaks_nothing() {
    let seconds = std::env::var("STEREOLUX_SOAK_S")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(15);
    let folder = Folder::new("viewer-soak");
    let xvfb = Xvfb::start(&folder);
    let mut desk = Desk::open(&folder, &xvfb);
    let mut dice = 7;
    let mut roll = |sides: u64| random::bits(&mut dice) % sides;
    let began = Instant::now();
    let mut memory = Vec::new();
    // Keys that change nothing on disk and end nothing: w a s d q e f 1 2 3, Home, F1, Space.
    let keys = [
        0x77, 0x61, 0x73, 0x64, 0x71, 0x65, 0x66, 0x31, 0x32, 0x33, 0xff50, 0xffbe, 0x20,
    ];
    while began.elapsed() < Duration::from_secs(seconds) {
        if memory.len() % 40 == 39 {
            // Somebody who has searched for nonsense and walked into the dark starts over.
            desk.click(100, 60);
            desk.command(keysym::A);
            desk.press(keysym::DELETE);
            desk.click(560, 500);
            desk.press(keysym::HOME);
        }
        match roll(8) {
            0..=2 => {
                let key = keys[roll(keys.len() as u64) as usize];
                desk.key(key, true);
                std::thread::sleep(Duration::from_millis(20 + roll(200)));
                desk.key(key, false);
            }
            3..=4 => {
                // Anywhere but the File menu, which quits.
                let (x, y) = (90 + roll(1190) as i16, 4 + roll(690) as i16);
                desk.click(x, y);
            }
            5..=6 => {
                desk.point(230 + roll(700) as i16, 140 + roll(400) as i16);
                desk.button(1, true);
                for _ in 0..8 {
                    desk.point(230 + roll(700) as i16, 140 + roll(400) as i16);
                    std::thread::sleep(Duration::from_millis(16));
                }
                desk.button(1, false);
            }
            // Undo.
            _ => desk.command(keysym::Z),
        }
        let ended = desk.child.try_wait().unwrap();
        assert!(ended.is_none(), "{ended:?}\n{}", read(&desk.log));
        memory.push(desk.own_kb());
    }
    let (actions, first, last) = (memory.len(), memory[0], memory[memory.len() - 1]);
    let most = memory.iter().max().unwrap();
    println!(
        "{actions} actions in {seconds} s; besides device memory {first} kB, {most} kB at most, {last} kB at last"
    );
    if seconds >= 120 {
        // Caches fill in the first fifth; what leaks goes on growing. A fifth of room for the code of shaders, which differs
        // from one renderer to the next.
        let fifth = memory.len() / 5;
        let most = |part: &[u64]| *part.iter().max().unwrap() as f64;
        let (early, late) = (most(&memory[fifth..2 * fifth]), most(&memory[4 * fifth..]));
        assert!(late < 1.2 * early, "{early} kB grew to {late} kB");
    }
    let said = {
        // Edits are lost on purpose.
        desk.key(keysym::D, false);
        let _ = desk.child.kill();
        let _ = desk.child.wait();
        read(&desk.log)
    };
    assert_eq!(complaints(&said), Vec::<&str>::new());
    assert!(!said.contains("panicked"), "{said}");
}

/// An application in a window. `DESK_OUT` has the folder of its recording.
#[test]
#[ignore = "run by the test below on a virtual screen"]
fn an_application_in_its_window() {
    let out = PathBuf::from(std::env::var("DESK_OUT").unwrap());
    let mut app = Counter::default();
    let mut args = words("application view --size 64x64 --photons 2048 --headset symmetric");
    let trace = with_trace("record", &out.join("trace.jsonl"));
    let out = out.join("out");
    let out = out.to_str().unwrap();
    args.extend(["--adapter", adapter_name(), &trace, "--out", out]);
    let args = args.into_iter().map(OsString::from);
    let ended = run_app_with(&mut app, &["--scene=builtin:gallery"], args);
    assert_eq!((ended, app.clicked_in.len()), (ExitCode::SUCCESS, 1));
}

#[test]
fn a_panel_is_clicked_by_the_mouse_and_the_recording_clicks_it_again() {
    let folder = Folder::new("desktop");
    let xvfb = Xvfb::start(&folder);
    let test = "suite::viewer::viewer_window::an_application_in_its_window";
    let mut command = Command::new(std::env::current_exe().unwrap());
    command.args(["--exact", test, "--ignored"]);
    command.env("DESK_OUT", folder.path());
    let mut desk = Desk::of(&mut command, &folder, &xvfb);
    let trace = folder.join("trace.jsonl");
    // Beside the panel, then on it, as the left eye sees it.
    for (clicks, [x, y]) in [(1, [30, 60]), (2, [320, 360])] {
        desk.click(x, y);
        desk.until("a click", |_| {
            let text = read(&trace);
            let mut held: Vec<bool> = text.lines().map(|line| line.contains("pressed")).collect();
            held.dedup();
            held.iter().filter(|held| **held).count() == clicks && held.last() == Some(&false)
        });
    }
    desk.close();
    let mut app = Counter::default();
    let (replay, out) = (with_trace("trace", &trace), folder.join("again"));
    run_well(&mut app, &["--scene=builtin:gallery"], &out, &[&replay]);
    assert_eq!(app.clicked_in.len(), 1);
}
