//! The library as an application has it: `examples/minimal.rs` runs, and what moves in it is seen.

use stereolux::{Fov, Headset, ImageRgb8, Motion, RenderSettings, Scene, SimulatedSession};

use super::{minimal_example, support};

/// The example's last picture of so many frames, its head held still.
fn last_picture(frames: u64) -> ImageRgb8 {
    let mut settings = RenderSettings::default();
    settings.photon.count = 4096;
    let start = Scene::builtin("cornell").unwrap().start_pose();
    // Two frames a second, an eighth of a turn each, and no more to be seen than the box.
    let fov = Fov::from_degrees(-19.0, 19.0, 19.0, -19.0);
    let headset = Headset::load("symmetric").unwrap().with_refresh_hz(2.0);
    let headset = headset.unwrap().with_fov(fov).unwrap();
    let session = SimulatedSession::new(headset, Motion::Still, start, Some(frames));
    minimal_example::run(support::context(), session, &settings, [48, 48]).unwrap()
}

#[test]
fn the_smallest_application_shows_what_turns() {
    let [first, second, again] = [1, 2, 2].map(last_picture);
    assert_eq!((first.width, first.height), (96, 48));
    assert_eq!(second.pixels, again.pixels);
    // The block's edges are elsewhere; the box around it stays.
    let differs =
        |(a, b): (&[u8; 3], &[u8; 3])| (0..3).any(|channel| a[channel].abs_diff(b[channel]) > 48);
    let pairs = first.pixels.iter().zip(&second.pixels);
    let changed = pairs.filter(|pair| differs(*pair)).count();
    assert!((40..96 * 48 / 4).contains(&changed), "{changed} pixels");
}
