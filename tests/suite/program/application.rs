//! The library as an application has it: `examples/minimal.rs` runs, and what moves in it is seen.

use stereolux::{Headset, ImageRgb8, Motion, RenderSettings, Scene, SimulatedSession};

use super::{minimal_example, support};

/// The example's last picture of so many frames, its head held still.
fn last_picture(frames: u64) -> ImageRgb8 {
    let mut settings = RenderSettings::default();
    settings.photon.count = 4096;
    let start = Scene::builtin("cornell").unwrap().start_pose();
    // Four frames a second: a sixteenth of a turn each.
    let headset = Headset::load("symmetric")
        .unwrap()
        .with_refresh_hz(4.0)
        .unwrap();
    let session = SimulatedSession::new(headset, Motion::Still, start, Some(frames));
    minimal_example::run(support::context(), session, &settings, [48, 48]).unwrap()
}

#[test]
fn the_smallest_application_shows_what_turns() {
    let [first, second, again] = [1, 2, 2].map(last_picture);
    assert_eq!((first.width, first.height), (96, 48));
    assert_eq!(second.pixels, again.pixels);
    let changed = |rows: std::ops::Range<usize>| {
        let differs = |pixel: &usize| {
            let pairs = first.pixels[*pixel].iter().zip(second.pixels[*pixel]);
            pairs.map(|(a, b)| a.abs_diff(b)).max().unwrap() > 32
        };
        (rows.start * 96..rows.end * 96).filter(differs).count()
    };
    // The block's new edges are seen, the lamp and the ceiling stay as they are.
    assert!(changed(0..48) > 40, "{} pixels", changed(0..48));
    assert_eq!(changed(0..6), 0);
}
