//! The thread that renders.
//!
//! The window never waits for it: what is wanted is left in one place, where the latest counts, and pictures come back
//! over a channel. It has a device of its own, because commands of one queue run in order: on the window's device a click
//! would be answered only after the frame in hand. (Rejected: one device and frames cut into short submissions. A pass of a
//! large scene on a software adapter alone takes longer than a click may.)
//!
//! While the views change, frames are small enough to follow; once they stand still, frames grow to the full size and are
//! averaged there. A frame is given up between its passes once something else is asked for ([`super::pressure`]); what is
//! seen at once is the window's own ([`super::sketch`]).

use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use super::frames::{FrameReport, PicturePlace, PixelRadiance, Seen, ViewMode, Wanted};
use super::pressure::{Asked, Pressure};
use super::reference::{self, FIRST_FRAME};
use super::render_engine::{EngineError, RenderEngine, library};
use super::screenshot;
use super::view_pictures::ViewPictures;
use crate::gpu::Gate;
use crate::gpu::timing::milliseconds_since;
use crate::renderer::Inspection;
use crate::scene::Scene;
use crate::scene::edit::Edit;
use crate::settings::{Eyes, Kept, Settings};
use crate::xr::View;

/// A frame of a moving view should take no longer, milliseconds: ten pictures a second still follow the hand.
const PREVIEW_BUDGET_MS: f64 = 100.0;
/// The first preview, of unknown cost, has this many times fewer pixels along each edge.
const FIRST_DIVISOR: u32 = 8;
/// The smallest preview has about so many pixels along its shorter edge: less shows nothing.
const FEWEST_PIXELS: u32 = 12;
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
    /// Say the radiance at this place of what is shown, and of frames to come.
    Radiance(PicturePlace),
    /// Read the shaders again.
    ReloadShaders,
    /// Stop refining what is shown, until something else is wanted.
    Stop,
    /// End.
    Quit,
}

/// What the thread tells.
pub enum Report {
    /// A picture.
    Frame(Box<FrameReport>),
    /// Another view of frames that were reported with this [`FrameReport::picture`].
    View(Box<(u64, ViewMode, ViewPictures)>),
    /// What was asked for of the last frame.
    Radiance(PixelRadiance),
    /// Something that takes a while has begun; empty when it is over.
    Busy(&'static str),
    /// Something did not work; the last picture and what made it stay.
    Failed(String),
    /// What is wanted makes no frame, which is not tried again until something changes.
    Refused(String),
    /// Something is done, for people.
    Done(String),
    /// The device is gone, and with it the thread.
    Lost(String),
}

/// The window's end.
pub struct Worker {
    wanted: Arc<Mutex<Wanted>>,
    pressure: Arc<Pressure>,
    requests: Sender<Request>,
    reports: Receiver<Report>,
    thread: Option<JoinHandle<()>>,
}

impl Worker {
    /// Starts the thread. `wake` is called after every report.
    pub fn start(
        scene: Box<Scene>,
        wanted: Wanted,
        wake: impl Fn() + Send + 'static,
    ) -> std::io::Result<Self> {
        let (requests, receiver) = channel();
        let (sender, reports) = channel();
        let wanted = Arc::new(Mutex::new(wanted));
        let shared = Arc::clone(&wanted);
        let pressure = Arc::new(Pressure::default());
        let asked = Arc::clone(&pressure);
        let thread = std::thread::Builder::new()
            .name("renderer".to_owned())
            .spawn(move || {
                yield_to_window();
                let pressure = Arc::clone(&asked);
                let gate: Gate = Arc::new(move |pass: &str| pressure.admits(pass));
                let mut inner = Inner {
                    wanted: shared,
                    pressure: asked,
                    requests: receiver,
                    reports: Box::new(move |report| {
                        // The window may be gone already.
                        let _ = sender.send(report);
                        wake();
                    }),
                    engine: RenderEngine::new(*scene, gate),
                    other: None,
                    reference: None,
                    screenshots: Vec::new(),
                    pointed: None,
                    frame_index: 0,
                    divisor: FIRST_DIVISOR,
                    is_preview: false,
                    shown: None,
                    picture: 0,
                    reported: ViewMode::Picture,
                    answered: 0,
                    full_frames: 0,
                    stocked: Vec::new(),
                    costs: HashMap::new(),
                    changes: 0,
                    is_stopped: false,
                    device_bytes: 0,
                };
                inner.run();
            })?;
        Ok(Self {
            wanted,
            pressure,
            requests,
            reports,
            thread: Some(thread),
        })
    }

    /// Replaces what is wanted.
    pub fn want(&self, wanted: Wanted) {
        let mut kept = self.wanted.lock().unwrap_or_else(PoisonError::into_inner);
        let is_shown = wanted.stands || wanted.view_mode == kept.view_mode;
        let asked = if is_shown && wanted.is_of_frames_of(&kept) {
            // The frame in hand will do.
            Asked::Nothing
        } else if Arc::ptr_eq(&kept.settings, &wanted.settings) {
            Asked::View
        } else {
            Asked::Scene
        };
        *kept = wanted;
        drop(kept);
        self.send(Request::Wanted);
        self.pressure.ask(asked);
    }

    /// Asks for something.
    pub fn ask(&self, request: Request) {
        let asked = match &request {
            // Of the frame in hand.
            Request::Screenshot(_) | Request::Radiance(_) => Asked::Nothing,
            Request::Wanted => Asked::View,
            Request::Edit(_) | Request::ReloadShaders => Asked::Scene,
            Request::Scene(_) | Request::Stop | Request::Quit => Asked::Stop,
        };
        self.send(request);
        self.pressure.ask(asked);
    }

    fn send(&self, request: Request) {
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
}

impl Shown {
    fn of(wanted: &Wanted) -> Self {
        Self {
            views: wanted.views,
            scene_time_ns: wanted.scene_time_ns,
            size: wanted.size,
        }
    }
}

/// The thread's end.
struct Inner {
    wanted: Arc<Mutex<Wanted>>,
    requests: Receiver<Request>,
    reports: Box<dyn Fn(Report) + Send>,
    pressure: Arc<Pressure>,
    engine: RenderEngine,
    other: Option<RenderEngine>,
    /// What the error view compares with.
    reference: Option<RenderEngine>,
    screenshots: Vec<PathBuf>,
    /// Where the radiance was asked for last.
    pointed: Option<PicturePlace>,
    frame_index: u32,
    /// How many times smaller than wanted the next frame is, along each edge.
    divisor: u32,
    /// The frame in hand is the first of its view.
    is_preview: bool,
    shown: Option<Shown>,
    /// Counts what was shown.
    picture: u64,
    /// What the last frame showed.
    reported: ViewMode,
    /// [`Wanted::number`] of it.
    answered: u64,
    /// Frames of the full size of what is shown.
    full_frames: u32,
    /// Views of what is shown that the window has been given, or that there are none of.
    stocked: Vec<Inspection>,
    /// Milliseconds per pixel of frames without tracing photons, by view and whether there are other settings.
    costs: HashMap<(ViewMode, bool), f64>,
    /// Scenes and edits so far.
    changes: u64,
    /// Asked to stop, and nothing has changed since.
    is_stopped: bool,
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
            self.pressure.serve();
            // Read before the other requests: whatever was asked for before it is then served before it is shown.
            let wanted = self.wanted();
            // Who only looks changes nothing.
            let mut is_at_rest = matches!(turn, Turn::Rest);
            while let Some(next) = request {
                match &next {
                    Request::Quit => return,
                    Request::Radiance(_) => {}
                    Request::Screenshot(_) if self.is_stopped && self.stands() => {}
                    other => {
                        is_at_rest = false;
                        self.is_stopped = matches!(other, Request::Stop);
                    }
                }
                self.serve(next);
                request = self.requests.try_recv().ok();
            }
            turn = if self.is_stopped || is_at_rest {
                Turn::Rest
            } else {
                self.turn(&wanted)
            };
        }
    }

    fn serve(&mut self, request: Request) {
        match request {
            Request::Wanted | Request::Quit => {}
            Request::Stop => self.drop_screenshots("the view was stopped before it was whole"),
            Request::Scene(scene) => {
                self.drop_screenshots("another scene came before it was whole");
                self.changes += 1;
                self.engine = self.engine.beside(*scene);
                self.other = None;
                self.restart();
            }
            Request::Edit(edit) => {
                self.changes += 1;
                if let Err(error) = self.engine.edit(&edit) {
                    self.report(Report::Failed(error.to_string()));
                }
                if let Some(other) = &mut self.other {
                    // The same edit of the same scene: said once already.
                    let _ = other.edit(&edit);
                }
                self.restart();
            }
            Request::Screenshot(folder) => {
                self.screenshots.push(folder);
                if self.is_stopped {
                    let wanted = self.wanted();
                    let frames = self.engine.frames().max(self.full_frames);
                    self.write_screenshots(&wanted, wanted.size, frames);
                }
            }
            Request::Radiance(place) => {
                self.pointed = Some(place);
                match self.engine.radiance_at(place) {
                    Ok(Some(radiance)) => self.report(Report::Radiance(radiance)),
                    Ok(None) => {}
                    // The next frame says what is wrong.
                    Err(error) => log::debug!("radiance under the pointer: {error}"),
                }
            }
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

    /// Whether what is shown is what is wanted, in full size.
    fn stands(&self) -> bool {
        let wanted = self.wanted();
        let is_whole = self.full_frames > 0 && self.engine.frames() > 0;
        is_whole
            && self.answered == wanted.number
            && self.shown.as_ref() == Some(&Shown::of(&wanted))
    }

    /// The next picture begins anew.
    fn restart(&mut self) {
        self.shown = None;
        self.reference = None;
    }

    fn wanted(&self) -> Wanted {
        let wanted = self.wanted.lock();
        wanted.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// One turn: makes what is missing, renders a frame, says so.
    fn turn(&mut self, wanted: &Wanted) -> Turn {
        let settings = Arc::new(self.effective(wanted));
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
                self.report(Report::Refused(error.to_string()));
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
        if self.engine.needs_renderer(settings, wanted.rendered) {
            self.report(Report::Busy("compiling"));
            self.costs.clear();
            self.engine
                .prepare(settings, wanted.rendered, wanted.size)?;
            self.restart();
        }
        match &wanted.other {
            None => self.other = None,
            Some(other) => {
                let other = &Arc::new(decided(other));
                let engine = &self.engine;
                let beside = || engine.beside(engine.scene().clone());
                let own = self.other.get_or_insert_with(beside);
                if own.take_changes()? {
                    self.shown = None;
                }
                if own.needs_renderer(other, wanted.rendered) {
                    (self.reports)(Report::Busy("compiling the other settings"));
                    own.prepare(other, wanted.rendered, wanted.size)?;
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
        let now = Shown::of(wanted);
        let is_new = self.shown.as_ref() != Some(&now);
        if is_new {
            self.picture += 1;
            self.full_frames = 0;
            self.stocked.clear();
        }
        let is_other_view = self.reported != wanted.view_mode;
        self.is_preview = is_new || (is_other_view && !wanted.stands);
        if self.is_preview {
            self.divisor = self.preview_divisor(wanted);
            if let Some(reference) = &mut self.reference {
                reference.clear();
            }
            self.shown = Some(now);
        } else if self.divisor > 1 {
            self.divisor /= 2;
        } else {
            let goes_on = self.answered != wanted.number || !self.is_finished(wanted);
            return goes_on.then_some(wanted.size);
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
        self.pressure.begin();
        let began = Instant::now();
        let other = self.other.as_ref().map_or(0, RenderEngine::frames);
        let mean_frames = [self.engine.frames(), other];
        let index = self.frame_index;
        self.frame_index = self.frame_index.wrapping_add(1);
        let stats = self.engine.frame(index, wanted, size)?;
        if self.pressure.gave_up().is_some() {
            self.give_up(wanted, size, began, mean_frames);
            return Ok(Turn::Go);
        }
        let photons_ms = stats.gpu_ms.photons;
        // Another view may be wanted by now that the frame can show as well. Edits that were asked for before it are not in
        // the frame: its number stays.
        let latest = Wanted {
            number: wanted.number,
            ..self.wanted()
        };
        let is_at_hand = latest.is_of_frames_of(wanted)
            && !self
                .engine
                .needs_renderer(&self.effective(&latest), latest.rendered);
        let wanted = if is_at_hand { &latest } else { wanted };
        let other = match &mut self.other {
            None => None,
            Some(other) => {
                other.frame(index, wanted, size)?;
                other.picture()
            }
        };
        if wanted.view_mode == ViewMode::Error && self.divisor == 1 {
            let reference = match &mut self.reference {
                Some(reference) => reference,
                none => {
                    (self.reports)(Report::Busy("compiling the reference"));
                    let mut made = self.engine.beside(self.engine.scene().clone());
                    let settings = Arc::new(reference::settings(&wanted.settings));
                    made.prepare(&settings, Eyes::Both, size)?;
                    none.insert(made)
                }
            };
            reference.frame(FIRST_FRAME.wrapping_add(index), wanted, size)?;
        }
        let reference = self.reference.as_ref();
        let mut report = self.engine.report(wanted, size, stats, reference)?;
        if self.pressure.gave_up().is_some() {
            self.give_up(wanted, size, began, mean_frames);
            return Ok(Turn::Go);
        }
        self.note_cost(
            wanted,
            (milliseconds_since(began) - photons_ms).max(0.0) / pixels_of(size),
        );
        self.reported = wanted.view_mode;
        self.answered = wanted.number;
        report.picture = self.picture;
        if let Some(place) = self.pointed {
            report.radiance = self.engine.radiance_at(place)?;
        }
        report.other = other;
        report.changes = self.changes;
        report.is_full = self.divisor == 1;
        if report.is_full {
            // A reconstructed picture is a mean already, and counts as one frame in the device's.
            report.frames = report.frames.max(self.full_frames + 1);
        }
        if let Some(bytes) = &mut report.device_bytes {
            let others = [&self.other, &self.reference].into_iter().flatten();
            *bytes += others.filter_map(RenderEngine::device_bytes).sum::<u64>();
            if self.device_bytes != *bytes {
                self.device_bytes = *bytes;
                log::debug!("device memory: {bytes} bytes");
            }
        }
        let frames = report.frames;
        self.report(Report::Frame(Box::new(report)));
        if self.divisor == 1 {
            self.write_screenshots(wanted, size, frames);
            self.full_frames = self.full_frames.saturating_add(1);
            self.stock_views(wanted, size)?;
        }
        Ok(Turn::Go)
    }

    /// The frame in hand was given up. Of those before it, `mean_frames` of both settings were in the mean.
    fn give_up(&mut self, wanted: &Wanted, size: [u32; 2], began: Instant, mean_frames: [u32; 2]) {
        let Some(without_photons) = self.pressure.gave_up() else {
            return;
        };
        log::debug!(
            "a frame of {}x{} was given up after {:.0} ms",
            size[0],
            size[1],
            milliseconds_since(began)
        );
        // What is shown stays when refining stops: whatever is asked of it then is asked of the frames that made it.
        let stays = self.pressure.is_to_stop() && mean_frames[0] > 0;
        let kept = if stays { mean_frames } else { [0; 2] };
        self.engine.give_up(without_photons, kept[0]);
        if let Some(other) = &mut self.other {
            other.give_up(without_photons, kept[1]);
        }
        if stays {
            if let Some(reference) = &mut self.reference {
                // It may have counted the frame.
                reference.clear();
            }
            return;
        }
        if self.is_preview {
            // It took too long for the hand.
            self.note_cost(wanted, 4.0 * PREVIEW_BUDGET_MS / pixels_of(size));
        }
        self.shown = None;
    }

    /// Gives the window the other views of the frame that was just rendered, so that it has each at once when it is asked
    /// for. Those that it can make itself it makes; those that need another renderer are left out. Ends as soon as something
    /// is asked for, and goes on after the next frame.
    fn stock_views(&mut self, wanted: &Wanted, size: [u32; 2]) -> Result<(), EngineError> {
        for inspection in Inspection::ALL {
            let mode = ViewMode::Inspection(inspection);
            let is_there = mode == wanted.view_mode
                || Seen::holds(inspection)
                || self.stocked.contains(&inspection);
            // One frame has none.
            let is_early = inspection == Inspection::Variance && self.full_frames < 2;
            if is_there || is_early || !self.engine.can_inspect(inspection) {
                continue;
            }
            if self.pressure.is_asked() || self.wanted().number != wanted.number {
                return Ok(());
            }
            self.pressure.begin();
            let began = Instant::now();
            let made = self.engine.pictures(mode, size, None);
            if self.pressure.gave_up().is_some() {
                return Ok(());
            }
            self.stocked.push(inspection);
            match made {
                Ok(pictures) => {
                    let view = (self.picture, mode, pictures.kept());
                    self.report(Report::View(Box::new(view)));
                }
                Err(error) if error.is_lost() => return Err(error),
                // Whoever asks for it is told.
                Err(error) => log::debug!("{}: {error}", mode.name()),
            }
            log::debug!(
                "{} was stocked in {:.1} ms",
                mode.name(),
                milliseconds_since(began)
            );
        }
        Ok(())
    }

    /// Says of pictures that were asked for that there will be none.
    fn drop_screenshots(&mut self, why: &str) {
        if !std::mem::take(&mut self.screenshots).is_empty() {
            self.report(Report::Failed(format!(
                "no screenshot was written: {why}; ask again"
            )));
        }
    }

    fn write_screenshots(&mut self, wanted: &Wanted, size: [u32; 2], frames: u32) {
        for folder in std::mem::take(&mut self.screenshots) {
            let written = screenshot::write(&folder, &self.engine, wanted, size, frames);
            self.report(match written {
                Ok(paths) => Report::Done(paths),
                Err(error) => Report::Failed(error.to_string()),
            });
        }
    }

    fn cost(&self, wanted: &Wanted) -> Option<f64> {
        let key = (wanted.view_mode, wanted.other.is_some());
        self.costs.get(&key).copied()
    }

    /// Takes what a frame cost into account, milliseconds per pixel; the estimate forgets old ones soon.
    fn note_cost(&mut self, wanted: &Wanted, cost: f64) {
        let mean = self.cost(wanted).map_or(cost, |old| 0.5 * (old + cost));
        let key = (wanted.view_mode, wanted.other.is_some());
        self.costs.insert(key, mean);
    }

    /// How much smaller frames have to be for the view to follow the hand.
    fn preview_divisor(&self, wanted: &Wanted) -> u32 {
        self.cost(wanted)
            .map_or(FIRST_DIVISOR, |cost| preview_divisor(wanted.size, cost))
    }

    /// The settings under which what is wanted has something to show: nearly those that were asked for.
    fn effective(&self, wanted: &Wanted) -> Settings {
        let mut settings = decided(&wanted.settings);
        // People look into frames.
        settings.render.output.kept = Kept::All;
        match wanted.view_mode {
            // The averaged frames have a variance of their own.
            ViewMode::Picture | ViewMode::Error | ViewMode::Inspection(Inspection::Variance) => {}
            // What has the map already needs none made.
            ViewMode::Inspection(Inspection::Caustic)
                if self.engine.forms_caustics()
                    && !self.engine.needs_renderer(&settings, wanted.rendered) => {}
            ViewMode::Inspection(inspection) => {
                settings.render = inspection.settings_for(&settings.render);
            }
        }
        settings
    }

    fn is_finished(&self, wanted: &Wanted) -> bool {
        let is_whole = |reference: &RenderEngine| reference.frames() >= MOST_FRAMES;
        let reference_done =
            wanted.view_mode != ViewMode::Error || self.reference.as_ref().is_some_and(is_whole);
        let frames = self.engine.frames().max(self.full_frames);
        frames >= MOST_FRAMES && reference_done && self.screenshots.is_empty()
    }
}

/// What `auto` stands for while people look.
pub fn decided(settings: &Settings) -> Settings {
    let mut settings = settings.clone();
    settings.render.decide_switches(true);
    settings
}

/// The least power of two by which an image of `size`, at `cost` milliseconds per pixel, is computed within the budget.
fn preview_divisor(size: [u32; 2], cost: f64) -> u32 {
    let pixels = pixels_of(size);
    let coarsest = (size[0].min(size[1]) / FEWEST_PIXELS).max(1);
    let mut divisor = 1;
    while 2 * divisor <= coarsest
        && pixels / f64::from(divisor * divisor) * cost > PREVIEW_BUDGET_MS
    {
        divisor *= 2;
    }
    divisor
}

fn pixels_of(size: [u32; 2]) -> f64 {
    f64::from(size[0]) * f64::from(size[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn previews_meet_the_budget_whatever_a_pixel_costs() {
        for cost in [1e-6, 1e-4, 1e-2, 0.1, 0.3] {
            let divisor = preview_divisor([640, 480], cost);
            let pixels = 640.0 * 480.0 / f64::from(divisor * divisor);
            assert!(pixels * cost <= PREVIEW_BUDGET_MS, "{cost}: {divisor}");
            let finer = pixels * 4.0 * cost;
            assert!(
                divisor == 1 || finer > PREVIEW_BUDGET_MS,
                "{cost}: {divisor}"
            );
        }
        // Fewer pixels show nothing, however dear they are.
        assert_eq!(preview_divisor([640, 480], 1e6), 32);
        assert_eq!(preview_divisor([8, 8], 1e6), 1);
    }
}
