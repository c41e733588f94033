//! A virtual screen, and what a person does to a window on it.

use std::io::{BufRead as _, BufReader};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use x11rb::connection::Connection as _;
use x11rb::protocol::xproto::{AtomEnum, ClientMessageEvent, ConnectionExt as _, EventMask};
use x11rb::rust_connection::RustConnection;
use x11rb::wrapper::ConnectionExt as _;

use super::openxr_support::PROGRAM;
use crate::suite::support::Folder;

/// A virtual screen of 1280x720; it goes when this is dropped.
pub struct Xvfb {
    process: Child,
    pub display: String,
    pub screen: PathBuf,
}

impl Xvfb {
    pub fn start(folder: &Folder) -> Self {
        let mut process = Command::new("Xvfb")
            .args(["-displayfd", "1", "-screen", "0", "1280x720x24"])
            .args(["-nolisten", "tcp", "-fbdir"])
            .arg(folder.path())
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb is needed; scripts/test.sh installs it");
        let mut number = String::new();
        BufReader::new(process.stdout.take().unwrap())
            .read_line(&mut number)
            .unwrap();
        Self {
            process,
            display: format!(":{}", number.trim()),
            screen: folder.join("Xvfb_screen0"),
        }
    }
}

impl Drop for Xvfb {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// The program where there is only `display`, or none.
pub fn program_on(display: Option<&str>) -> Command {
    let mut command = Command::new(PROGRAM);
    command
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .env_remove("WAYLAND_SOCKET");
    if let Some(display) = display {
        command.env("DISPLAY", display);
    }
    command
}

/// The program's window, as another client of the display sees it.
pub fn find_window(display: &str) -> (RustConnection, u32) {
    let (connection, screen) = x11rb::connect(Some(display)).unwrap();
    let root = connection.setup().roots[screen].root;
    let began = Instant::now();
    while began.elapsed() < Duration::from_secs(20) {
        let children = connection.query_tree(root).unwrap().reply().unwrap();
        for window in children.children {
            let name = connection
                .get_property(false, window, AtomEnum::WM_NAME, AtomEnum::ANY, 0, 64)
                .unwrap()
                .reply();
            if name.is_ok_and(|name| name.value.starts_with(b"stereolux")) {
                return (connection, window);
            }
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    panic!("no window of stereolux on {display}");
}

/// The number that a display has for a name.
pub fn atom(connection: &RustConnection, name: &str) -> u32 {
    let cookie = connection.intern_atom(false, name.as_bytes()).unwrap();
    cookie.reply().unwrap().atom
}

/// Says what a window manager says when its close button is pressed.
pub fn ask_to_close(display: &str) {
    let (connection, window) = find_window(display);
    let [protocols, close] =
        ["WM_PROTOCOLS", "WM_DELETE_WINDOW"].map(|name| atom(&connection, name));
    let message = ClientMessageEvent::new(32, window, protocols, [close, 0, 0, 0, 0]);
    connection
        .send_event(false, window, EventMask::NO_EVENT, message)
        .unwrap();
    connection.sync().unwrap();
}
