//! The viewer's window: events in, egui out, on a device of its own (see [`super::worker`] for why).

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use egui::{Context, ViewportId};
use winit::application::ApplicationHandler;
use winit::dpi::LogicalSize;
use winit::event::{StartCause, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoopProxy};
use winit::window::{Fullscreen, Window, WindowId};

use super::app::{App, Start, WindowCommand};
use super::painter::{Painter, Target};
use super::picture::sketch_texture;
use super::sketch::Sketcher;
use super::theme;
use super::window_state::WindowState;
use crate::foreign_errors::caught;
use crate::gpu::{GpuContext, GpuError};
use crate::windowing::{Acquired, WindowSurface, event_loop, plain, present};

/// How often the loop looks whether a signal asked the program to end.
const SIGNAL_POLL: Duration = Duration::from_millis(250);

/// Why there is no window; one line each.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// No display, or none that takes a window.
    #[error(
        "view: no window can be opened ({0}); start from a desktop, or use `run` or `render`, which write pictures to --out without one"
    )]
    NoWindow(String),
    /// The adapter cannot show images in the window.
    #[error(
        "view: adapter {adapter:?} cannot show images on this display ({reason}); choose another with --adapter, or use `run` or `render`, which need no display"
    )]
    CannotShow {
        /// Name of the adapter.
        adapter: String,
        /// The driver's words, or ours.
        reason: String,
    },
    /// The device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The window broke while it was open.
    #[error("view: the window closed ({0}); saved files are complete")]
    Ended(String),
}

/// Opens the window and answers it until it is closed. Call on the main thread, at most once in a program. The size and
/// layout of the window are kept at `state_path`.
///
/// # Errors
/// [`ViewError`].
pub fn show(start: Start, adapter: &str, state_path: Option<PathBuf>) -> Result<(), ViewError> {
    let event_loop = event_loop::<()>().map_err(ViewError::NoWindow)?;
    let mut state = State {
        start: Some(start),
        adapter: adapter.to_owned(),
        state_path,
        proxy: event_loop.create_proxy(),
        open: None,
        is_left: false,
        error: None,
    };
    let ran = caught(|| {
        event_loop
            .run_app(&mut state)
            .map_err(|error| error.to_string())
    });
    if let Some(open) = &mut state.open {
        open.remember(state.state_path.as_deref());
        if !state.is_left {
            open.rescue();
        }
    }
    if let Some(error) = state.error.take() {
        return Err(error);
    }
    // Threads and devices end before the window does.
    drop(state.open.take());
    match ran.and_then(|ran| ran) {
        Ok(()) => Ok(()),
        Err(reason) => Err(ViewError::Ended(plain(&reason))),
    }
}

struct State {
    /// Taken when the window opens.
    start: Option<Start>,
    adapter: String,
    state_path: Option<PathBuf>,
    proxy: EventLoopProxy<()>,
    open: Option<Open>,
    /// Whether who sits before it closed it, and knows what is not saved.
    is_left: bool,
    error: Option<ViewError>,
}

impl State {
    fn fail(&mut self, event_loop: &ActiveEventLoop, error: ViewError) {
        self.error.get_or_insert(error);
        event_loop.exit();
    }
}

impl ApplicationHandler<()> for State {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        let Some(start) = self.start.take() else {
            return;
        };
        match Open::new(event_loop, start, &self.adapter, self.proxy.clone()) {
            Ok(open) => self.open = Some(open),
            Err(error) => self.fail(event_loop, error),
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, cause: StartCause) {
        if let (StartCause::ResumeTimeReached { .. }, Some(open)) = (cause, &self.open)
            && open.repaint_at.is_some_and(|at| at <= Instant::now())
        {
            open.window.request_redraw();
        }
    }

    fn user_event(&mut self, _: &ActiveEventLoop, (): ()) {
        if let Some(open) = &self.open {
            open.window.request_redraw();
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(open) = &mut self.open else {
            return;
        };
        let result = open.event(event_loop, event);
        match result {
            Ok(true) => {}
            Ok(false) => {
                self.is_left = true;
                event_loop.exit();
            }
            Err(error) => self.fail(event_loop, error),
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        if crate::interrupt::requested() {
            event_loop.exit();
        }
        if let Some(open) = &self.open {
            // A signal does not wake the loop: it is looked for.
            let look = Instant::now() + SIGNAL_POLL;
            let until = open.repaint_at.map_or(look, |at| at.min(look));
            event_loop.set_control_flow(ControlFlow::WaitUntil(until));
        }
    }
}

/// Everything of an open window. Fields drop in order: the surface before the window.
struct Open {
    app: App,
    painter: Painter,
    sketcher: Sketcher,
    surface: WindowSurface,
    input: egui_winit::State,
    egui: Context,
    gpu: GpuContext,
    window: Arc<Window>,
    title: String,
    repaint_at: Option<Instant>,
    /// When the oldest input came that no frame has answered yet.
    unanswered: Option<Instant>,
}

impl Open {
    fn new(
        event_loop: &ActiveEventLoop,
        start: Start,
        adapter: &str,
        proxy: EventLoopProxy<()>,
    ) -> Result<Self, ViewError> {
        let [width, height] = start.window_state.size;
        let attributes = Window::default_attributes()
            .with_title("stereolux")
            .with_inner_size(LogicalSize::new(width, height));
        let window = caught(|| {
            event_loop
                .create_window(attributes)
                .map_err(|e| e.to_string())
        })
        .and_then(|made| made)
        .map_err(|reason| ViewError::NoWindow(plain(&reason)))?;
        let window = Arc::new(window);
        let gpu = GpuContext::open(Some(adapter))?;
        let cannot = |reason: String| ViewError::CannotShow {
            adapter: gpu.adapter.name.clone(),
            reason,
        };
        let surface = WindowSurface::new(&gpu, Arc::clone(&window), &FORMATS).map_err(cannot)?;
        log::debug!(
            "window: {:?}, {:?}, {}",
            surface.format,
            surface.present_mode,
            gpu.adapter.name
        );
        let egui = Context::default();
        // On a slow adapter a second may pass between the passes that see a button go down and up.
        egui.options_mut(|options| options.input_options.max_click_duration = f64::INFINITY);
        theme::apply(&egui);
        let input = egui_winit::State::new(
            egui.clone(),
            ViewportId::ROOT,
            &window,
            Some(window.scale_factor() as f32),
            window.theme(),
            Some(gpu.device.limits().max_texture_dimension_2d as usize),
        );
        let painter = Painter::new(&gpu, surface.format)?;
        let sketcher = Sketcher::new(&gpu)?;
        let app = App::new(start, move || {
            // The loop may have ended.
            let _ = proxy.send_event(());
        })
        .map_err(|error| ViewError::Ended(error.to_string()))?;
        window.request_redraw();
        Ok(Self {
            app,
            painter,
            sketcher,
            surface,
            input,
            egui,
            gpu,
            window,
            title: String::new(),
            repaint_at: None,
            unanswered: None,
        })
    }

    /// Answers an event; false to end.
    fn event(
        &mut self,
        event_loop: &ActiveEventLoop,
        event: WindowEvent,
    ) -> Result<bool, ViewError> {
        match &event {
            WindowEvent::CloseRequested => {
                self.app.request_quit();
                self.window.request_redraw();
            }
            WindowEvent::RedrawRequested => {
                self.paint(event_loop)?;
                return Ok(self.obey());
            }
            _ => {}
        }
        let response = self.input.on_window_event(&self.window, &event);
        if response.repaint {
            if matches!(
                event,
                WindowEvent::MouseInput { .. } | WindowEvent::KeyboardInput { .. }
            ) {
                self.unanswered.get_or_insert_with(Instant::now);
            }
            self.window.request_redraw();
        }
        Ok(true)
    }

    /// Does what the app asks of the window; false to end.
    fn obey(&mut self) -> bool {
        for command in self.app.take_commands() {
            match command {
                WindowCommand::Quit => return false,
                WindowCommand::ToggleFullScreen => {
                    let other = match self.window.fullscreen() {
                        Some(_) => None,
                        None => Some(Fullscreen::Borderless(None)),
                    };
                    self.window.set_fullscreen(other);
                }
            }
        }
        true
    }

    fn rescue(&mut self) {
        match self.app.rescue() {
            Some(Ok(path)) => log::warn!("edits that were not saved are in {}", path.display()),
            Some(Err(error)) => log::error!("edits that were not saved are lost: {error}"),
            None => {}
        }
    }

    fn remember(&mut self, path: Option<&std::path::Path>) {
        if self.window.fullscreen().is_none() {
            let size = self
                .window
                .inner_size()
                .to_logical::<f32>(self.window.scale_factor());
            if size.width > 0.0 && size.height > 0.0 {
                self.app.window_state.size = [size.width, size.height];
            }
        }
        if let Some(path) = path
            && let Err(reason) = WindowState::save(&self.app.window_state, path)
        {
            log::warn!("the window's size and layout are not kept: {reason}");
        }
        // What is being computed may take a while to end.
        if let Err(panicked) = caught(|| self.window.set_visible(false)) {
            log::debug!("hiding the window: {panicked}");
        }
    }

    fn paint(&mut self, event_loop: &ActiveEventLoop) -> Result<(), ViewError> {
        let size = <[u32; 2]>::from(self.window.inner_size());
        if size.contains(&0) {
            return Ok(());
        }
        let began = Instant::now();
        let input = self.input.take_egui_input(&self.window);
        let app = &mut self.app;
        let output = self.egui.run_ui(input, |ui| app.ui(ui));
        let title = app.title();
        if self.title != title {
            self.window.set_title(&title);
            self.title = title;
        }
        self.input.handle_platform_output_with_event_loop(
            &self.window,
            event_loop,
            output.platform_output,
        );
        self.repaint_at = output
            .viewport_output
            .get(&ViewportId::ROOT)
            .and_then(|viewport| Instant::now().checked_add(viewport.repaint_delay))
            // A delay without end is the end of time on some systems.
            .filter(|at| at.saturating_duration_since(began) < Duration::from_secs(3600));
        let laid_out = began.elapsed();
        let jobs = self.egui.tessellate(output.shapes, output.pixels_per_point);
        let Self {
            painter,
            sketcher,
            surface,
            gpu,
            app,
            ..
        } = self;
        let Some(Acquired { image, is_stale }) = surface.acquire(gpu, size)? else {
            return Err(ViewError::Ended("its surface was lost".to_owned()));
        };
        // Textures change whether the frame is shown or not.
        let view = image
            .as_ref()
            .map(|image| image.texture.create_view(&Default::default()));
        let target = view.as_ref().map(|view| Target {
            view,
            size,
            pixels_per_point: output.pixels_per_point,
        });
        let is_sketched = match app.sketch() {
            Some(wish) => {
                let views = sketcher.draw(gpu, &wish)?;
                for (eye, view) in views.iter().enumerate() {
                    painter.bind_view(&gpu.device, sketch_texture(eye), view);
                }
                true
            }
            None => false,
        };
        painter.paint(gpu, &output.textures_delta, &jobs, target.as_ref())?;
        if let Some(image) = image {
            present(gpu, image)?;
        }
        if is_stale {
            self.window.request_redraw();
        }
        if let Some(since) = self.unanswered.take() {
            log::debug!(
                "input answered in {:.1} ms (layout {:.1} ms{})",
                since.elapsed().as_secs_f64() * 1e3,
                laid_out.as_secs_f64() * 1e3,
                if is_sketched { ", sketched" } else { "" }
            );
        }
        Ok(())
    }
}

/// Formats with 8 bits, first those that encode nothing themselves: egui paints in display values.
const FORMATS: [wgpu::TextureFormat; 4] = [
    wgpu::TextureFormat::Bgra8Unorm,
    wgpu::TextureFormat::Rgba8Unorm,
    wgpu::TextureFormat::Bgra8UnormSrgb,
    wgpu::TextureFormat::Rgba8UnormSrgb,
];
