//! A desktop window that shows both eyes side by side.
//!
//! It never delays the run: everything happens on the frame loop's thread between frames, images go from
//! the renderer's buffers into the window's texture on the device, and frames for which there is no time are not shown.
//! Closing the window, or losing it, ends the mirror and not the run.

use std::sync::Arc;
use std::time::{Duration, Instant};

use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, EventLoop};
use winit::platform::pump_events::EventLoopExtPumpEvents as _;
use winit::window::{Window, WindowId};

use crate::foreign_errors::caught;
use crate::gpu::{GpuContext, GpuError, ShaderLibrary};
#[cfg(feature = "viewer")]
use crate::renderer::mirror::rectangles;
use crate::renderer::{RenderError, Renderer};
use crate::windowing::{WindowSurface, event_loop, plain, present};

/// The window's size at the start, logical pixels.
const SIZE: LogicalSize<u32> = LogicalSize::new(1280, 720);
/// Images that wait for the display's refresh (FIFO) are presented at most this often: a queue that never fills never
/// blocks, on displays of 30 Hz and more.
const FIFO_PERIOD: Duration = Duration::from_millis(50);
/// The mirror rests this many times as long as showing the last frame took, so it costs the loop at most a fifth of its time:
/// with a software adapter, which draws the window while the loop waits, or a display that hands out no images.
const REST: u32 = 4;

/// Why there is no mirror; one line each.
#[derive(Debug, thiserror::Error)]
pub enum MirrorError {
    /// No display, or none that takes a window.
    #[error(
        "no window can be opened ({0}); start from a desktop, or leave --mirror or --session desktop out: the run works without it"
    )]
    NoWindow(String),
    /// The adapter of this run cannot show images in the window.
    #[error(
        "adapter {adapter:?} cannot show images on this display ({reason}); leave --mirror or --session desktop out: the run works without it"
    )]
    CannotShow {
        /// Name of the adapter.
        adapter: String,
        /// The driver's words, or ours.
        reason: String,
    },
}

/// What the window system tells.
#[derive(Default)]
struct Events {
    window: Option<Arc<Window>>,
    refused: Option<String>,
    is_closed: bool,
    #[cfg(feature = "viewer")]
    desk: Option<crate::desktop::SharedDesk>,
}

impl Events {
    /// Whether the session goes with the window.
    fn ends_the_run(&self) -> bool {
        #[cfg(feature = "viewer")]
        return self.desk.is_some();
        #[cfg(not(feature = "viewer"))]
        false
    }

    /// Tells the session on the desktop, if that is what runs.
    fn tell(&self, event: &WindowEvent) {
        #[cfg(feature = "viewer")]
        if let Some(desk) = &self.desk {
            let desk = desk.lock();
            desk.unwrap_or_else(std::sync::PoisonError::into_inner)
                .take(event);
        }
        #[cfg(not(feature = "viewer"))]
        let _ = event;
    }
}

impl ApplicationHandler for Events {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        if self.window.is_some() {
            return;
        }
        let attributes = Window::default_attributes()
            .with_title("stereolux: left and right eye")
            .with_inner_size(SIZE);
        match event_loop.create_window(attributes) {
            Ok(window) => self.window = Some(Arc::new(window)),
            Err(error) => self.refused = Some(error.to_string()),
        }
    }

    fn window_event(&mut self, _: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        self.tell(&event);
        // The size is asked for with every frame.
        if matches!(event, WindowEvent::CloseRequested | WindowEvent::Destroyed) {
            self.is_closed = true;
        }
    }
}

/// A window that shows nothing yet.
pub struct MirrorWindow {
    events: Events,
    event_loop: EventLoop<()>,
    window: Arc<Window>,
}

impl MirrorWindow {
    /// Opens the window. Call as [`event_loop`], at most once in a program.
    ///
    /// # Errors
    /// [`MirrorError::NoWindow`].
    pub fn open() -> Result<Self, MirrorError> {
        let no_window = |reason: String| MirrorError::NoWindow(plain(&reason));
        let mut event_loop = event_loop().map_err(MirrorError::NoWindow)?;
        let mut events = Events::default();
        caught(|| event_loop.pump_app_events(Some(Duration::ZERO), &mut events))
            .map_err(no_window)?;
        let Some(window) = events.window.clone() else {
            let reason = events.refused.take();
            return Err(no_window(
                reason.unwrap_or_else(|| "the window system does not answer".to_owned()),
            ));
        };
        Ok(Self {
            events,
            event_loop,
            window,
        })
    }

    /// Pixels of an eye's picture in the window, for images of these proportions.
    #[cfg(feature = "viewer")]
    pub fn eye_size(&self, image: [u32; 2]) -> [u32; 2] {
        let shown = rectangles(self.window.inner_size().into(), image);
        shown.map_or(image, |[eye, _]| [eye.width, eye.height])
    }

    /// Tells a session of the desktop what happens in the window.
    #[cfg(feature = "viewer")]
    pub fn tell(&mut self, desk: crate::desktop::SharedDesk) {
        let size = WindowEvent::Resized(self.window.inner_size());
        desk.lock()
            .unwrap_or_else(std::sync::PoisonError::into_inner)
            .take(&size);
        self.events.desk = Some(desk);
    }
}

/// The window with a surface that the run's device draws on.
pub struct Mirror {
    /// `None` once the mirror has ended. Dropped before its window.
    surface: Option<WindowSurface>,
    /// Nothing is presented before.
    not_before: Instant,
    window: MirrorWindow,
}

/// Formats that encode sRGB themselves, then those with 8 bits, which the pass encodes.
const FORMATS: [wgpu::TextureFormat; 4] = [
    wgpu::TextureFormat::Bgra8UnormSrgb,
    wgpu::TextureFormat::Rgba8UnormSrgb,
    wgpu::TextureFormat::Bgra8Unorm,
    wgpu::TextureFormat::Rgba8Unorm,
];

impl Mirror {
    /// Prepares the window for images of `context`'s device.
    ///
    /// # Errors
    /// [`MirrorError::CannotShow`].
    pub fn new(window: MirrorWindow, context: &GpuContext) -> Result<Self, MirrorError> {
        let cannot = |reason: String| MirrorError::CannotShow {
            adapter: context.adapter.name.clone(),
            reason,
        };
        let surface =
            WindowSurface::new(context, Arc::clone(&window.window), &FORMATS).map_err(cannot)?;
        log::debug!("mirror: {:?}, {:?}", surface.format, surface.present_mode);
        Ok(Self {
            surface: Some(surface),
            not_before: Instant::now(),
            window,
        })
    }

    /// Takes the window away.
    pub fn close(self) {}

    /// Answers the window system; call between frames.
    pub fn serve(&mut self) {
        if self.surface.is_none() {
            return;
        }
        let MirrorWindow {
            events, event_loop, ..
        } = &mut self.window;
        if let Err(panicked) = caught(|| event_loop.pump_app_events(Some(Duration::ZERO), events)) {
            return self.end(&panicked);
        }
        if events.is_closed {
            if !events.ends_the_run() {
                log::warn!("the mirror was closed; the run goes on (Ctrl-C ends it)");
            }
            self.surface = None;
            let window = &self.window.window;
            if let Err(panicked) = caught(|| window.set_visible(false)) {
                log::debug!("hiding the mirror: {panicked}");
            }
        }
    }

    /// Ends the mirror and says why, and with it a session of the desktop.
    fn end(&mut self, reason: &str) {
        let events = &self.window.events;
        let run = match events.ends_the_run() {
            true => "and with it the run",
            false => "the run goes on",
        };
        log::warn!("the mirror ends ({}); {run}", plain(reason));
        events.tell(&WindowEvent::CloseRequested);
        self.surface = None;
    }

    /// Shows the last frame, if the window is there and ready for another image.
    ///
    /// # Errors
    /// [`RenderError::Gpu`] if the device is lost; what concerns the window alone ends the mirror instead.
    pub fn show(
        &mut self,
        renderer: &mut Renderer,
        library: &ShaderLibrary,
    ) -> Result<(), RenderError> {
        match self.try_show(renderer, library) {
            Err(lost @ RenderError::Gpu(GpuError::Lost { .. })) => Err(lost),
            Err(error) => {
                self.end(&error.to_string());
                Ok(())
            }
            Ok(()) => Ok(()),
        }
    }

    fn try_show(
        &mut self,
        renderer: &mut Renderer,
        library: &ShaderLibrary,
    ) -> Result<(), RenderError> {
        let began = Instant::now();
        let Some(surface) = self.surface.as_mut().filter(|_| began >= self.not_before) else {
            return Ok(());
        };
        let size = <[u32; 2]>::from(self.window.window.inner_size());
        if size.contains(&0) {
            return Ok(());
        }
        let is_queued = surface.present_mode == wgpu::PresentMode::Fifo;
        let acquired = surface.acquire(renderer.context(), size)?;
        let wait = began.elapsed();
        match acquired {
            Some(acquired) => {
                if let Some(image) = acquired.image {
                    let view = image.texture.create_view(&Default::default());
                    renderer.mirror_to(library, &view)?;
                    drop(view);
                    present(renderer.context(), image)?;
                }
            }
            None => self.end("the window was lost"),
        }
        let took = began.elapsed();
        log::trace!("mirror: waited {wait:?} for an image, took {took:?} in all");
        let mut rest = took * REST;
        if is_queued {
            rest = rest.max(FIFO_PERIOD);
        }
        self.not_before = Instant::now() + rest;
        Ok(())
    }
}
