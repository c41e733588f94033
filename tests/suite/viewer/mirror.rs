//! The desktop mirror: its pass against the PNG path, and its window on a virtual screen.

use std::process::{Command, Stdio};

use stereolux::gpu::ShaderLibrary;
use stereolux::images::{Image, aces_filmic, tone_map};
use stereolux::settings::{Method, Reuse};
use stereolux::xr::view::Fov;
use x11rb::protocol::xproto::{ConfigureWindowAux, ConnectionExt as _};
use x11rb::wrapper::ConnectionExt as _;

use super::openxr_picture::{Screen, block_scene, fault, shows};
use super::openxr_runtime::{VALIDATION, complaints};
use super::openxr_support::{
    PROGRAM, all_output, assert_status, frames_so_far, interrupt, monado, stderr, wait_until,
};
use super::textures::{bytes, target_texture};
use super::virtual_screen::{Xvfb, ask_to_close, find_window, program_on};
use crate::suite::support::{
    Folder, assert_begins, assert_says, bits, both, builtin, frame, method, parallel_views,
    renderer, stereolux, words,
};

const IMAGE: [u32; 2] = [32, 24];

/// IEC 61966-2-1, 8 bits.
fn srgb_step(linear: f64) -> f64 {
    let encoded = if linear <= 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    };
    encoded * 255.0
}

#[test]
fn the_window_holds_what_the_png_shows_left_and_right_about_its_middle() {
    let scene = builtin("cornell");
    let mut settings = method(Method::Photon, Reuse::Scatter);
    settings.output.exposure = 1.5;
    settings.spp = 2;
    let mut renderer = renderer(&scene, &settings, IMAGE);
    let fov = Fov::from_degrees(-32.0, 28.0, 25.0, -20.0);
    frame(
        &mut renderer,
        &parallel_views(scene.start_pose(), 0.07, fov),
    );
    let library = ShaderLibrary::embedded();
    let images = both(&renderer).map(|eye| Image::new(IMAGE[0], IMAGE[1], eye).unwrap());
    assert_ne!(bits(&images[0].pixels), bits(&images[1].pixels));
    let pngs = images.each_ref().map(|image| tone_map(image, 1.5));

    // One window pixel per image pixel; black above and below. The window's own encoding, and the pass's.
    for format in [
        wgpu::TextureFormat::Bgra8UnormSrgb,
        wgpu::TextureFormat::Bgra8Unorm,
    ] {
        let window = [2 * IMAGE[0], IMAGE[1] + 10];
        let view = target_texture(renderer.context(), window, format);
        renderer.mirror_to(&library, &view).unwrap();
        let found = bytes(renderer.context(), &view, 4);
        let mut exchanged = 0;
        for (index, texel) in found.chunks_exact(4).enumerate() {
            let (x, y) = (index as u32 % window[0], index as u32 / window[0]);
            if y < 5 || y >= 5 + IMAGE[1] {
                assert_eq!(texel[..3], [0; 3], "{x}, {y}");
                continue;
            }
            let pixel = ((y - 5) * IMAGE[0] + x % IMAGE[0]) as usize;
            let eye = (x / IMAGE[0]) as usize;
            for (channel, expected) in [2, 1, 0].iter().zip(&pngs[eye].pixels[pixel]) {
                // An 8-bit store may round to the neighbour, as in `openxr_submit`.
                let off = texel[*channel].abs_diff(*expected);
                assert!(off <= 1, "{format:?} {x}, {y}: {texel:?}, {expected}");
            }
            let other = &pngs[1 - eye].pixels[pixel];
            let is_off = |channel: usize| texel[2 - channel].abs_diff(other[channel]) > 1;
            exchanged += u32::from((0..3).any(is_off));
        }
        // The comparison would notice an exchange of the eyes.
        assert!(exchanged > 100, "{exchanged}");
    }

    // Half as large: the mean of four pixels' display light.
    let (half, format) = (
        [IMAGE[0], IMAGE[1] / 2],
        wgpu::TextureFormat::Rgba8UnormSrgb,
    );
    let view = target_texture(renderer.context(), half, format);
    renderer.mirror_to(&library, &view).unwrap();
    let found = bytes(renderer.context(), &view, 4);
    for (index, texel) in found.chunks_exact(4).enumerate() {
        let (x, y) = (index as u32 % IMAGE[0], index as u32 / IMAGE[0]);
        let (eye, x) = ((2 * x / IMAGE[0]) as usize, x % (IMAGE[0] / 2));
        for (channel, value) in texel[..3].iter().enumerate() {
            let tap = |tap: u32| {
                let pixel = (2 * y + tap / 2) * IMAGE[0] + 2 * x + tap % 2;
                let linear = images[eye].pixels[pixel as usize][channel];
                f64::from(aces_filmic(linear * 1.5)) / 4.0
            };
            let mean = (0..4).map(tap).sum();
            // 0.6 of a step for the store, the rest for f32 sums and the device's own curve.
            let off = (f64::from(*value) - srgb_step(mean)).abs();
            assert!(off < 1.1, "{x}, {y}: {value} for {}", srgb_step(mean));
        }
    }
}

fn halves(columns: usize) -> [std::ops::Range<usize>; 2] {
    [0..columns / 2, columns / 2..columns]
}

fn resize(display: &str, width: u32, height: u32) {
    let (connection, window) = find_window(display);
    let size = ConfigureWindowAux::new().width(width).height(height);
    connection.configure_window(window, &size).unwrap();
    connection.sync().unwrap();
}

#[test]
fn the_window_shows_the_scene_follows_its_size_and_may_be_closed() {
    let folder = Folder::new("mirror-window");
    let xvfb = Xvfb::start(&folder);
    let scene = block_scene(&folder);
    let out = folder.join("out");
    let run = "run --session simulated --motion still --headset symmetric --frames 100000 --mirror --size 256x256 \
               --photons 0 --method path --set output.images=false";
    let mut child = program_on(Some(&xvfb.display))
        .args(words(run))
        .args(["--scene", &scene])
        .args(["--out", out.to_str().unwrap()])
        .env("WINIT_X11_SCALE_FACTOR", "1")
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    wait_until(&mut child, "five frames", || frames_so_far(&out) >= 5);
    let whole = shows(&xvfb.screen, halves(1280), 720);
    // The judge would notice an exchange.
    let exchanged = whole.map(|screen| {
        let [left, right] = halves(1280);
        fault(&screen, [right, left], 720)
    });
    resize(&xvfb.display, 600, 400);
    let smaller = shows(&xvfb.screen, halves(600), 400).map(|_| ());
    ask_to_close(&xvfb.display);
    let closed_at = frames_so_far(&out);
    let goes_on = || frames_so_far(&out) >= closed_at + 20;
    wait_until(&mut child, "twenty more frames", goes_on);
    let after = fault(&Screen::read(&xvfb.screen), halves(600), 400);
    let output = interrupt(child);
    let text = stderr(&output);
    assert_begins(&exchanged.unwrap().unwrap(), "eyes exchanged");
    smaller.unwrap();
    // Closed: nothing of it is on the screen, and the run went on.
    assert_begins(&after.unwrap(), "a block is missing");
    assert_says(
        &text,
        &["the mirror was closed", "error: interrupted after "],
    );
    assert_status(&output, 1);
}

#[test]
fn the_window_shows_what_an_openxr_session_renders() {
    let folder = Folder::new("mirror-openxr");
    let xvfb = Xvfb::start(&folder);
    let scene = block_scene(&folder);
    let out = folder.join("out");
    let mut child = monado(&[])
        .args(["bash", "-c"])
        .arg(format!(
            "$MONADO_RUN {PROGRAM} run --session openxr --mirror --frames 4000 --size 256x256 --photons 0 --method path \
             --scene {scene} --set output.images=false --out {} & echo $! > {}; wait $!",
            out.display(),
            folder.join("pid").display(),
        ))
        .env("DISPLAY", &xvfb.display)
        .env("WINIT_X11_SCALE_FACTOR", "1")
        .env_remove("WAYLAND_DISPLAY")
        .envs(VALIDATION)
        .stderr(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    wait_until(&mut child, "five frames", || frames_so_far(&out) >= 5);
    let screen = shows(&xvfb.screen, halves(1280), 720).map(|_| ());
    let pid = std::fs::read_to_string(folder.join("pid")).unwrap();
    Command::new("kill").arg(pid.trim()).status().unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(screen, Ok(()), "{}", stderr(&output));
    assert_status(&output, 1);
    assert_says(&stderr(&output), &["error: interrupted after "]);
    // The window's images too are used as Vulkan wants it.
    assert_eq!(complaints(&all_output(&output)), Vec::<&str>::new());
}

#[test]
fn without_a_display_the_mirror_is_refused_in_one_line() {
    let folder = Folder::new("mirror-none");
    let out = folder.join("out");
    let no_display = "neither DISPLAY nor WAYLAND_DISPLAY names a display";
    for (display, asked, says) in [
        (None, "--session simulated --mirror", no_display),
        (None, "--session desktop", no_display),
        (
            Some(":4077"),
            "--session simulated --mirror",
            "Failed to open connection to X server",
        ),
    ] {
        let output = program_on(display)
            .args(words(&format!("run {asked} --out")))
            .arg(&out)
            .output()
            .unwrap();
        assert_status(&output, 2);
        let text = stderr(&output);
        assert_eq!(text.lines().count(), 1, "{text}");
        assert_begins(&text, &format!("error: no window can be opened ({says}"));
        assert_says(&text, &["the run works without it"]);
        assert!(!out.exists(), "a refused run leaves no files");
    }
    // `render` has no such flag.
    assert_eq!(stereolux(&["render", "--mirror"]).status.code(), Some(2));
}
