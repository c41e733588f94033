//! The thread that renders.
//!
//! The window never waits for it: what is wanted is left in one place, where the latest counts, and pictures come back
//! over a channel. It has a device of its own, because commands of one queue run in order: on the window's device a click
//! would be answered only after the frame in hand. (Rejected: one device and frames cut into short submissions. A pass of a
//! large scene on a software adapter alone takes longer than a click may.)
//!
//! While the views change, frames are small enough to follow; once they stand still, frames grow to the full size and are
//! averaged there.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::frames::{FrameReport, ViewMode, Wanted};
use super::reference::Reference;
use super::render_engine::{EngineError, RenderEngine, library};
use super::screenshot;
use super::session::{DesktopSession, SharedViews};
use crate::gpu::timing::milliseconds_since;
use crate::renderer::Inspection;
use crate::scene::Scene;
use crate::scene::edit::Edit;
use crate::settings::Settings;
use crate::xr::{Headset, View};

/// A frame of a moving view should take no longer, milliseconds: ten pictures a second still follow the hand.
const PREVIEW_BUDGET_MS: f64 = 100.0;
/// The smallest preview has this many times fewer pixels along each edge.
const COARSEST: u32 = 8;
/// Frames that are averaged of a view that stands still; after them the thread sleeps.
const MOST_FRAMES: u32 = 1024;
/// What the frame in hand may still take after a signal asked the program to end.
const LAST_FRAME: Duration = Duration::from_millis(300);
/// Nice level of the render thread; at +10 the UI thread gets about ten times its CPU share.
#[cfg(target_os = "linux")]
const NICE: i32 = 10;

/// What happens once, in order.
pub enum Request {
    /// [`Wanted`] has changed.
    Wanted,
    /// Another scene, with its environment.
    Scene(Box<Scene>),
    /// A change of the scene.
    Edit(Box<Edit>),
    /// Write both eyes' images under this folder, once the frame has its full size.
    Screenshot(PathBuf),
    /// Read the shaders again.
    ReloadShaders,
    /// End.
    Quit,
}

/// What the thread tells.
pub enum Report {
    /// A picture.
    Frame(Box<FrameReport>),
    /// Something that takes a while has begun; empty when it is over.
    Busy(&'static str),
    /// Something did not work; the last picture and what made it stay.
    Failed(String),
    /// Something is done, for people.
    Done(String),
    /// The device is gone, and with it the thread.
    Lost(String),
}

/// The window's end.
pub struct Worker {
    wanted: Arc<Mutex<Wanted>>,
    requests: Sender<Request>,
    reports: Receiver<Report>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Starts the thread. `wake` is called after every report.
    pub fn start(
        scene: Box<Scene>,
        wanted: Wanted,
        headset: &Headset,
        wake: impl Fn() + Send + 'static,
    ) -> std::io::Result<Self> {
        let (requests, receiver) = channel();
        let (sender, reports) = channel();
        let views: SharedViews = Arc::new(Mutex::new(wanted.views));
        let session = DesktopSession::new(headset, Arc::clone(&views));
        let wanted = Arc::new(Mutex::new(wanted));
        let shared = Arc::clone(&wanted);
        let thread = std::thread::Builder::new()
            .name("renderer".to_owned())
            .spawn(move || {
                yield_to_window();
                let mut inner = Inner {
                    wanted: shared,
                    requests: receiver,
                    reports: Box::new(move |report| {
                        // The window may be gone already.
                        let _ = sender.send(report);
                        wake();
                    }),
                    views,
                    session,
                    engine: RenderEngine::new(*scene),
                    other: None,
                    reference: None,
                    screenshots: Vec::new(),
                    frame_index: 0,
                    divisor: COARSEST,
                    shown: None,
                    cost_ms_per_pixel: None,
                    device_bytes: 0,
                };
                inner.run();
            })?;
        Ok(Self {
            wanted,
            requests,
            reports,
            thread: Some(thread),
        })
    }

    /// Replaces what is wanted.
    pub fn want(&self, wanted: Wanted) {
        *self.wanted.lock().unwrap_or_else(PoisonError::into_inner) = wanted;
        self.ask(Request::Wanted);
    }

    /// Asks for something.
    pub fn ask(&self, request: Request) {
        // A thread that has ended has said why.
        let _ = self.requests.send(request);
    }

    /// The next report, if there is one.
    pub fn poll(&self) -> Option<Report> {
        self.reports.try_recv().ok()
    }
}

impl Worker {
    /// Ends the process if the frame in hand takes longer than [`LAST_FRAME`]. Returning from `main` beside a driver that
    /// computes would end in the driver; files are whole, for they are written beside and renamed.
    fn end_at_once(&self) {
        let asked = Instant::now();
        let computes = || {
            self.thread
                .as_ref()
                .is_some_and(|thread| !thread.is_finished())
        };
        while computes() && asked.elapsed() < LAST_FRAME {
            std::thread::sleep(Duration::from_millis(10));
        }
        #[cfg(target_os = "linux")]
        if computes() {
            log::warn!("asked to end while a frame was computed: it is given up");
            let own = rustix::process::getpid();
            if let Err(error) = rustix::process::kill_process(own, rustix::process::Signal::KILL) {
                log::debug!("waits for the frame: {error}");
            }
        }
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        self.ask(Request::Quit);
        if crate::interrupt::requested() {
            self.end_at_once();
        }
        if let Some(thread) = self.thread.take()
            && thread.join().is_err()
        {
            log::error!("the rendering thread ended by a fault");
        }
    }
}

/// Lets the window's thread come first where both compute on the same cores. A software adapter's threads are started by
/// this one and inherit its rank.
fn yield_to_window() {
    // Elsewhere a rank belongs to the whole program.
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(NICE) {
        log::debug!("the rendering thread keeps its rank: {error}");
    }
}

/// What the last picture was made of: anything else begins a new one.
#[derive(PartialEq)]
struct Shown {
    views: [View; 2],
    scene_time_ns: Option<i64>,
    size: [u32; 2],
    view_mode: ViewMode,
}

/// The thread's end.
struct Inner {
    wanted: Arc<Mutex<Wanted>>,
    requests: Receiver<Request>,
    reports: Box<dyn Fn(Report) + Send>,
    views: SharedViews,
    session: DesktopSession,
    engine: RenderEngine,
    other: Option<RenderEngine>,
    reference: Option<Reference>,
    screenshots: Vec<PathBuf>,
    frame_index: u32,
    /// How many times smaller than wanted the next frame is, along each edge.
    divisor: u32,
    shown: Option<Shown>,
    cost_ms_per_pixel: Option<f64>,
    /// As last said in the log.
    device_bytes: u64,
}

/// What to do next.
enum Turn {
    /// There is something to render.
    Go,
    /// Sleep until the next request.
    Rest,
    /// End.
    End,
}

impl Inner {
    fn report(&self, report: Report) {
        (self.reports)(report);
    }

    fn run(&mut self) {
        let mut turn = Turn::Go;
        loop {
            let mut request = match turn {
                Turn::End => return,
                Turn::Rest => match self.requests.recv() {
                    Ok(request) => Some(request),
                    Err(_) => return,
                },
                Turn::Go => self.requests.try_recv().ok(),
            };
            // Read before the other requests: whatever was asked for before it is then served before it is shown.
            let wanted = self.wanted();
            while let Some(next) = request {
                if matches!(next, Request::Quit) {
                    return;
                }
                self.serve(next);
                request = self.requests.try_recv().ok();
            }
            turn = self.turn(&wanted);
        }
    }

    fn serve(&mut self, request: Request) {
        match request {
            Request::Wanted | Request::Quit => {}
            Request::Scene(scene) => {
                self.engine = RenderEngine::new(*scene);
                self.other = None;
                self.restart();
            }
            Request::Edit(edit) => {
                if let Err(error) = self.engine.edit(&edit) {
                    self.report(Report::Failed(error.to_string()));
                }
                if let Some(other) = &mut self.other {
                    // The same edit of the same scene: said once already.
                    let _ = other.edit(&edit);
                }
                self.restart();
            }
            Request::Screenshot(folder) => self.screenshots.push(folder),
            Request::ReloadShaders => {
                let settings = Arc::clone(&self.wanted().settings);
                match library(&settings).and_then(|library| self.engine.reload(library)) {
                    Ok(()) => {
                        self.other = None;
                        self.report(Report::Done(match settings.gpu.shader_folder.as_str() {
                            "" => "shaders built into the program compiled again; set gpu.shader_folder to edit them"
                                .to_owned(),
                            folder => format!("shaders of {folder} read again"),
                        }));
                    }
                    Err(error) => self.report(Report::Failed(error.to_string())),
                }
                self.restart();
            }
        }
    }

    /// The next picture begins anew.
    fn restart(&mut self) {
        self.shown = None;
        self.reference = None;
    }

    fn wanted(&self) -> Wanted {
        self.wanted
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .clone()
    }

    /// One turn: makes what is missing, renders a frame, says so.
    fn turn(&mut self, wanted: &Wanted) -> Turn {
        let settings = Arc::new(effective(&wanted.settings, wanted.view_mode));
        let tried = self
            .prepare(&settings, wanted)
            .and_then(|()| self.frame(wanted));
        match tried {
            Ok(turn) => turn,
            Err(error) if error.is_lost() => {
                self.report(Report::Lost(error.to_string()));
                Turn::End
            }
            Err(error) => {
                self.report(Report::Busy(""));
                self.report(Report::Failed(error.to_string()));
                Turn::Rest
            }
        }
    }

    /// Makes the renderers fit what is wanted.
    fn prepare(&mut self, settings: &Arc<Settings>, wanted: &Wanted) -> Result<(), EngineError> {
        // An edit may ask for a new renderer: first the edits.
        if self.engine.take_changes()? {
            self.restart();
        }
        if self.engine.needs_renderer(settings) {
            self.report(Report::Busy("compiling"));
            self.engine.prepare(settings, wanted.size)?;
            self.restart();
        }
        match &wanted.other {
            None => self.other = None,
            Some(other) => {
                let own = self
                    .other
                    .get_or_insert_with(|| RenderEngine::new(self.engine.scene().clone()));
                if own.take_changes()? {
                    self.shown = None;
                }
                if own.needs_renderer(other) {
                    (self.reports)(Report::Busy("compiling the other settings"));
                    own.prepare(other, wanted.size)?;
                    self.shown = None;
                }
            }
        }
        self.report(Report::Busy(""));
        Ok(())
    }

    /// Pixels per eye of the next frame, which begins a new picture where what is shown or its size is another; `None` once
    /// the picture is finished.
    fn next_size(&mut self, wanted: &Wanted) -> Option<[u32; 2]> {
        let now = Shown {
            views: wanted.views,
            scene_time_ns: wanted.scene_time_ns,
            size: wanted.size,
            view_mode: wanted.view_mode,
        };
        if self.shown.as_ref() != Some(&now) {
            self.divisor = self.preview_divisor(wanted.size);
            // Its renderer stays, unless the size is another.
            let kept = self.reference.take();
            self.reference = kept.filter(|kept| kept.size() == wanted.size);
            if let Some(reference) = &mut self.reference {
                reference.clear();
            }
            self.shown = Some(now);
        } else if self.divisor > 1 {
            self.divisor /= 2;
        } else {
            return (!self.is_finished(wanted)).then_some(wanted.size);
        }
        self.engine.clear();
        if let Some(other) = &mut self.other {
            other.clear();
        }
        Some(wanted.size.map(|edge| (edge / self.divisor).max(1)))
    }

    fn frame(&mut self, wanted: &Wanted) -> Result<Turn, EngineError> {
        let Some(size) = self.next_size(wanted) else {
            return Ok(Turn::Rest);
        };
        *self.views.lock().unwrap_or_else(PoisonError::into_inner) = wanted.views;
        let began = Instant::now();
        let index = self.frame_index;
        self.frame_index = self.frame_index.wrapping_add(1);
        let (session, time) = (&mut self.session, wanted.scene_time_ns);
        let Some(stats) = self.engine.frame(session, index, time, size)? else {
            return Ok(Turn::Rest);
        };
        let cost = milliseconds_since(began) / (f64::from(size[0]) * f64::from(size[1]));
        // Frames that traced photons cost more than those that follow; the estimate forgets them soon.
        self.cost_ms_per_pixel = Some(
            self.cost_ms_per_pixel
                .map_or(cost, |old| 0.5 * (old + cost)),
        );
        let other = match &mut self.other {
            None => None,
            Some(other) => {
                other.frame(session, index, time, size)?;
                Some(other.picture(wanted.exposure, size)?)
            }
        };
        if wanted.view_mode == ViewMode::Error && self.divisor == 1 {
            let reference = match &mut self.reference {
                Some(reference) => reference,
                none => {
                    (self.reports)(Report::Busy("compiling the reference"));
                    none.insert(Reference::new(self.engine.scene(), &wanted.settings, size)?)
                }
            };
            reference.add(session, index, time)?;
        }
        let reference = self.reference.as_ref().map(Reference::averaged);
        let mut report = self
            .engine
            .report(wanted, size, wanted.views, stats, reference)?;
        report.other = other;
        report.is_full = self.divisor == 1;
        let others = [
            self.other.as_ref().and_then(RenderEngine::device_bytes),
            self.reference.as_ref().and_then(Reference::device_bytes),
        ];
        if let Some(bytes) = &mut report.device_bytes {
            *bytes += others.into_iter().flatten().sum::<u64>();
            if self.device_bytes != *bytes {
                self.device_bytes = *bytes;
                log::debug!("device memory: {bytes} bytes");
            }
        }
        self.report(Report::Frame(Box::new(report)));
        if self.divisor == 1 {
            self.write_screenshots(wanted, size);
        }
        Ok(Turn::Go)
    }

    fn write_screenshots(&mut self, wanted: &Wanted, size: [u32; 2]) {
        for folder in std::mem::take(&mut self.screenshots) {
            let written = screenshot::write(&folder, &self.engine, wanted, size);
            self.report(match written {
                Ok(paths) => Report::Done(paths),
                Err(error) => Report::Failed(error.to_string()),
            });
        }
    }

    /// How much smaller frames have to be for the view to follow the hand.
    fn preview_divisor(&self, size: [u32; 2]) -> u32 {
        let Some(cost) = self.cost_ms_per_pixel else {
            return COARSEST;
        };
        let pixels = f64::from(size[0]) * f64::from(size[1]);
        let mut divisor = 1;
        while divisor < COARSEST && pixels / f64::from(divisor * divisor) * cost > PREVIEW_BUDGET_MS
        {
            divisor *= 2;
        }
        divisor
    }

    fn is_finished(&self, wanted: &Wanted) -> bool {
        let reference_done = wanted.view_mode != ViewMode::Error
            || self
                .reference
                .as_ref()
                .is_some_and(|reference| reference.frames() >= MOST_FRAMES);
        self.engine.frames() >= MOST_FRAMES && reference_done && self.screenshots.is_empty()
    }
}

/// The settings under which a view mode has something to show, or nearly those that were asked for.
fn effective(settings: &Settings, mode: ViewMode) -> Settings {
    match mode {
        // The averaged frames have a variance of their own.
        ViewMode::Picture | ViewMode::Error | ViewMode::Inspection(Inspection::Variance) => {
            settings.clone()
        }
        ViewMode::Inspection(inspection) => Settings {
            render: inspection.settings_for(&settings.render),
            ..settings.clone()
        },
    }
}
