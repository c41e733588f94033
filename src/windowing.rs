//! What every window of the desktop needs: a way to the display, or one line on why there is none, and a surface there.

use std::sync::Arc;

use winit::event_loop::EventLoop;
use winit::window::Window;

use crate::foreign_errors::caught;
use crate::gpu::{GpuContext, GpuError};

/// An event loop on the display. Call at most once in a program, on Apple's and Microsoft's systems on the main thread.
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
        let mut builder = EventLoop::<T>::with_user_event();
        #[cfg(all(unix, not(target_vendor = "apple")))]
        {
            use winit::platform::wayland::EventLoopBuilderExtWayland;
            use winit::platform::x11::EventLoopBuilderExtX11;
            // The system does not mind; an application may have its main thread for itself.
            EventLoopBuilderExtX11::with_any_thread(&mut builder, true);
            EventLoopBuilderExtWayland::with_any_thread(&mut builder, true);
        }
        builder.build().map_err(|error| error.to_string())
    })
    .and_then(|opened| opened)
    .map_err(|reason| plain(&reason))
}

/// One line without a full stop, for brackets. winit's errors begin with the place in its sources.
pub(crate) fn plain(reason: &str) -> String {
    let line = crate::foreign_errors::one_line(reason);
    let words = line
        .strip_prefix("os error at ")
        .and_then(|rest| rest.split_once(".rs:")?.1.split_once(": "))
        .map_or(line.as_str(), |(_, words)| words);
    words.trim_end_matches('.').to_owned()
}

/// The first of `wanted` that is among `offered`.
fn first_of<T: Copy + PartialEq>(wanted: &[T], offered: &[T]) -> Option<T> {
    let mut wanted = wanted.iter().copied();
    wanted.find(|wanted| offered.contains(wanted))
}

/// Which of `offered` is presented in: one that never waits for the display, if there is one.
fn choose_mode(offered: &[wgpu::PresentMode]) -> wgpu::PresentMode {
    use wgpu::PresentMode as P;
    first_of(&[P::Mailbox, P::Immediate], offered).unwrap_or(P::Fifo)
}

/// A window's surface, which images of one device are shown on.
pub(crate) struct WindowSurface {
    surface: wgpu::Surface<'static>,
    pub(crate) format: wgpu::TextureFormat,
    pub(crate) present_mode: wgpu::PresentMode,
    alpha_mode: wgpu::CompositeAlphaMode,
    /// Size for which the surface is configured.
    configured: Option<[u32; 2]>,
}

/// What a surface has for the next frame.
pub(crate) struct Acquired {
    /// Where to draw; none if the display has none for now.
    pub(crate) image: Option<wgpu::SurfaceTexture>,
    /// The window has changed: the next frame finds it in its new state.
    pub(crate) is_stale: bool,
}

impl WindowSurface {
    /// The surface of `window` for images of `context`'s device, in the first of the formats `wanted` that is on offer.
    ///
    /// # Errors
    /// The reason, for brackets: the adapter cannot show images there.
    pub(crate) fn new(
        context: &GpuContext,
        window: Arc<Window>,
        wanted: &[wgpu::TextureFormat],
    ) -> Result<Self, String> {
        let (surface, offered) = context.surface(window).map_err(|reason| plain(&reason))?;
        let format = first_of(wanted, &offered.formats);
        let format = format.ok_or_else(|| match offered.formats.as_slice() {
            [] => "it does not drive the display".to_owned(),
            others => format!("the display takes only {others:?}"),
        })?;
        Ok(Self {
            surface,
            format,
            present_mode: choose_mode(&offered.present_modes),
            alpha_mode: offered.alpha_modes.first().copied().unwrap_or_default(),
            configured: None,
        })
    }

    /// The next image of `size`; `None` if the window is lost.
    ///
    /// # Errors
    /// [`GpuError`] of the device.
    pub(crate) fn acquire(
        &mut self,
        context: &GpuContext,
        size: [u32; 2],
    ) -> Result<Option<Acquired>, GpuError> {
        if self.configured != Some(size) {
            let configuration = wgpu::SurfaceConfiguration {
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT,
                format: self.format,
                color_space: wgpu::SurfaceColorSpace::Auto,
                width: size[0],
                height: size[1],
                present_mode: self.present_mode,
                desired_maximum_frame_latency: 2,
                alpha_mode: self.alpha_mode,
                view_formats: Vec::new(),
            };
            context.guarded("window", || {
                self.surface.configure(&context.device, &configuration);
                Ok(())
            })?;
            self.configured = Some(size);
        }
        use wgpu::CurrentSurfaceTexture as Current;
        let current = context.guarded("window", || Ok(self.surface.get_current_texture()))?;
        let (image, is_stale) = match current {
            Current::Success(image) => (Some(image), false),
            Current::Suboptimal(image) => (Some(image), true),
            Current::Outdated => (None, true),
            Current::Timeout | Current::Occluded => (None, false),
            Current::Lost | Current::Validation => return Ok(None),
        };
        if is_stale {
            self.configured = None;
        }
        Ok(Some(Acquired { image, is_stale }))
    }
}

/// Shows an image that was drawn on.
///
/// # Errors
/// [`GpuError`] of the device.
pub(crate) fn present(context: &GpuContext, image: wgpu::SurfaceTexture) -> Result<(), GpuError> {
    context.guarded("window", || {
        context.queue.present(image);
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use wgpu::{PresentMode as P, TextureFormat as F};

    #[test]
    fn reasons_are_plain() {
        let said = "os error at /home/x/winit/src/mod.rs:788: Failed: no server.";
        assert_eq!(plain(said), "Failed: no server");
        assert_eq!(plain("two\nlines."), "two lines");
    }

    #[test]
    fn a_format_that_is_wanted_more_comes_first() {
        let wanted = [F::Rgba8UnormSrgb, F::Bgra8Unorm];
        let offered = [F::Rgba16Float, F::Bgra8Unorm, F::Rgba8UnormSrgb];
        assert_eq!(first_of(&wanted, &offered), Some(F::Rgba8UnormSrgb));
        assert_eq!(first_of(&wanted, &offered[..2]), Some(F::Bgra8Unorm));
        assert_eq!(first_of(&wanted, &offered[..1]), None);
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
