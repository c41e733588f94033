//! A file manager from which a file is dragged onto the program's window: the source's side of XDND 5 (freedesktop.org,
//! "Drag-and-Drop Protocol for the X Window System").

use std::path::Path;
use std::time::{Duration, Instant};

use x11rb::connection::Connection as _;
use x11rb::protocol::Event;
use x11rb::protocol::xproto::{
    ClientMessageEvent, ConnectionExt as _, CreateWindowAux, EventMask, PropMode,
    SELECTION_NOTIFY_EVENT, SelectionNotifyEvent, WindowClass,
};
use x11rb::wrapper::ConnectionExt as _;

use super::virtual_screen::{atom, find_window};

/// Drags `path` to a place on the screen of `display` and lets go there.
pub fn drag_file(display: &str, path: &Path, x: i16, y: i16) {
    let (connection, target) = find_window(display);
    let atom = |name: &str| atom(&connection, name);
    let screen = &connection.setup().roots[0];
    let source = connection.generate_id().unwrap();
    let (class, visual) = (WindowClass::INPUT_ONLY, x11rb::COPY_FROM_PARENT);
    let (root, more) = (screen.root, CreateWindowAux::new());
    let made = connection.create_window(0, source, root, 0, 0, 1, 1, 0, class, visual, &more);
    made.unwrap();
    connection
        .set_selection_owner(source, atom("XdndSelection"), x11rb::CURRENT_TIME)
        .unwrap();
    let send = |kind: &str, data: [u32; 5]| {
        let message = ClientMessageEvent::new(32, target, atom(kind), data);
        connection
            .send_event(false, target, EventMask::NO_EVENT, message)
            .unwrap();
        connection.flush().unwrap();
    };
    let list = atom("text/uri-list");
    send("XdndEnter", [source, 5 << 24, list, 0, 0]);
    let place = ((x as u32) << 16) | y as u32;
    let copy = atom("XdndActionCopy");
    send("XdndPosition", [source, 0, place, 0, copy]);

    let (status, finished) = (atom("XdndStatus"), atom("XdndFinished"));
    let uri = format!(
        "file://{}\r\n",
        path.to_string_lossy()
            .replace('%', "%25")
            .replace(' ', "%20")
    );
    let (mut is_welcome, mut is_told) = (false, false);
    let began = Instant::now();
    loop {
        assert!(
            began.elapsed() < Duration::from_secs(60),
            "welcome {is_welcome}, told {is_told}"
        );
        let Some(event) = connection.poll_for_event().unwrap() else {
            std::thread::sleep(Duration::from_millis(10));
            continue;
        };
        let was_ready = is_welcome && is_told;
        match event {
            Event::ClientMessage(message) if message.type_ == status => {
                is_welcome = message.data.as_data32()[1] & 1 == 1;
                assert!(is_welcome, "the window wants no file");
            }
            Event::ClientMessage(message) if message.type_ == finished => return,
            Event::SelectionRequest(request) => {
                assert_eq!(request.target, list);
                connection
                    .change_property8(
                        PropMode::REPLACE,
                        request.requestor,
                        request.property,
                        list,
                        uri.as_bytes(),
                    )
                    .unwrap();
                let answer = SelectionNotifyEvent {
                    response_type: SELECTION_NOTIFY_EVENT,
                    sequence: 0,
                    time: request.time,
                    requestor: request.requestor,
                    selection: request.selection,
                    target: request.target,
                    property: request.property,
                };
                connection
                    .send_event(false, request.requestor, EventMask::NO_EVENT, answer)
                    .unwrap();
                is_told = true;
            }
            _ => {}
        }
        if is_welcome && is_told && !was_ready {
            send("XdndDrop", [source, 0, 0, 0, 0]);
        }
    }
}
