//! What every window of the desktop needs: a way to the display, or one line on why there is none.

use winit::event_loop::EventLoop;

use crate::foreign_errors::{caught, one_line};

/// An event loop on the display. Call on the main thread, at most once in a program.
///
/// # Errors
/// The reason, without a full stop: there is no display, or winit cannot use it.
pub(crate) fn event_loop<T: 'static>() -> Result<EventLoop<T>, String> {
    #[cfg(all(unix, not(target_vendor = "apple")))]
    {
        let names_one =
            |variable: &str| std::env::var_os(variable).is_some_and(|display| !display.is_empty());
        if !names_one("DISPLAY") && !names_one("WAYLAND_DISPLAY") && !names_one("WAYLAND_SOCKET") {
            return Err("neither DISPLAY nor WAYLAND_DISPLAY names a display".to_owned());
        }
    }
    // winit panics where the display lacks an extension or the machine a library.
    caught(|| {
        EventLoop::<T>::with_user_event()
            .build()
            .map_err(|error| error.to_string())
    })
    .and_then(|opened| opened)
    .map_err(|reason| plain(&reason))
}

/// One line without a full stop, for brackets. winit's errors begin with the place in its sources.
pub(crate) fn plain(reason: &str) -> String {
    let line = one_line(reason);
    let words = line
        .strip_prefix("os error at ")
        .and_then(|rest| rest.split_once(".rs:")?.1.split_once(": "))
        .map_or(line.as_str(), |(_, words)| words);
    words.trim_end_matches('.').to_owned()
}

/// Which of `offered` is presented in: one that never waits for the display, if there is one.
pub(crate) fn choose_mode(offered: &[wgpu::PresentMode]) -> wgpu::PresentMode {
    [wgpu::PresentMode::Mailbox, wgpu::PresentMode::Immediate]
        .into_iter()
        .find(|mode| offered.contains(mode))
        .unwrap_or(wgpu::PresentMode::Fifo)
}

/// How a window's surface is set up for frames of `size`.
pub(crate) fn surface_configuration(
    format: wgpu::TextureFormat,
    present_mode: wgpu::PresentMode,
    alpha_mode: wgpu::CompositeAlphaMode,
    size: [u32; 2],
) -> wgpu::SurfaceConfiguration {
    wgpu::SurfaceConfiguration {
        usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
        format,
        color_space: wgpu::SurfaceColorSpace::Auto,
        width: size[0],
        height: size[1],
        present_mode,
        desired_maximum_frame_latency: 2,
        alpha_mode,
        view_formats: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::PresentMode as P;

    #[test]
    fn reasons_are_plain() {
        let said = "os error at /home/x/winit/src/mod.rs:788: Failed: no server.";
        assert_eq!(plain(said), "Failed: no server");
        assert_eq!(plain("two\nlines."), "two lines");
    }

    #[test]
    fn a_mode_that_does_not_wait_comes_first() {
        assert_eq!(
            choose_mode(&[P::Fifo, P::Immediate, P::Mailbox]),
            P::Mailbox
        );
        assert_eq!(choose_mode(&[P::Fifo, P::Immediate]), P::Immediate);
        assert_eq!(choose_mode(&[P::FifoRelaxed, P::Fifo]), P::Fifo);
    }
}
