//! Everything of the viewer that is not a window: what is open, what is wanted, what is done with it.

use std::collections::{HashMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use egui::{Context, TextureOptions};

use super::fields::Fields;
use super::fly_camera::FlyCamera;
use super::frames::{FrameReport, PicturePlace, Seen, ViewMode, Wanted};
use super::gamepad::Gamepad;
use super::gizmo::TransformGizmo;
use super::layout::{Layout, Part};
use super::loading::Loading;
use super::panels::paths::{PathQuestion, Purpose};
use super::panels::settings;
use super::question::Question;
use super::selection::Selection;
use super::session::{Player, Recording};
use super::sketch::{Stand, Wish};
use super::textures::Pictures;
use super::view_pictures::{Stock, ViewPictures};
use super::window_state::WindowState;
use super::worker::{Report, Request, Worker};
use super::zoom::Zoom;
use crate::files::Stamp;
use crate::renderer::Inspection;
use crate::scene::Bounds;
use crate::scene::edit::{Document, Edit, EditError};
use crate::settings::{EnvironmentSettings, Eyes, Reuse, Settings};
use crate::xr::{Headset, Pose, View};

/// Frames whose times the statistics remember.
pub const HISTORY: usize = 240;
/// Lines that the log keeps.
const MOST_LINES: usize = 500;
/// Half of a headset's opening that an object fills when it is focused, radians, at least.
const FOCUS_HALF_ANGLE_RAD: f64 = 0.35;

/// What the viewer opens with.
pub struct Start {
    /// The scene.
    pub document: Document,
    /// All settings.
    pub settings: Settings,
    /// The environment of the settings is what `auto` light chose for this scene.
    pub is_auto_lit: bool,
    /// Whose eyes are shown.
    pub headset: Headset,
    /// Views to play in place of a head that is moved by hand.
    pub recording: Option<Recording>,
    /// Where screenshots and saved files go.
    pub out: PathBuf,
    /// What the window remembers.
    pub window_state: WindowState,
}

/// Something that is said on the picture.
pub struct Message {
    /// One line.
    pub text: String,
    /// Stays until it is closed.
    pub is_error: bool,
    /// When it was said, seconds of egui's clock.
    pub since: f64,
}

/// What the right panel shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tab {
    /// What is selected.
    #[default]
    Inspector,
    /// All settings.
    Settings,
}

/// The scene's own clock.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SceneClock {
    /// Runs.
    pub is_playing: bool,
    /// Seconds, or none while the scene is shown as its nodes have it.
    pub seconds: Option<f64>,
}

/// What is left to the window, which has a surface and an event loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WindowCommand {
    /// F11.
    ToggleFullScreen,
    /// Close.
    Quit,
}

/// See the module.
pub struct App {
    pub(super) document: Document,
    pub(super) settings: Arc<Settings>,
    /// The settings to the right of a split view's divider.
    pub other: Arc<Settings>,
    pub(super) headset: Headset,
    /// What the environment that is shown was read by.
    pub(super) environment: EnvironmentSettings,
    /// It is what `auto` light chose for the scene, and goes with it.
    pub(super) is_auto_lit: bool,
    pub(super) camera: FlyCamera,
    pub(super) player: Option<Player>,
    pub(super) clock: SceneClock,
    pub(super) selected: Selection,
    /// What the window remembers until the next start.
    pub window_state: WindowState,
    /// What is shown of frames.
    pub view_mode: ViewMode,
    /// Tab of the right panel.
    pub tab: Tab,
    /// The list of keys is open.
    pub shows_help: bool,
    /// The picture has the whole window.
    pub(super) hides_panels: bool,
    /// The path that is asked for.
    pub(super) asks_path: Option<PathQuestion>,
    /// What is asked before anything else goes on.
    pub(super) asks: Option<Question>,
    /// Views that are kept.
    pub(super) bookmarks: [Option<FlyCamera>; 5],
    /// Pictures of both eyes that were frozen, to be compared with: smooth ones, and those whose pixels are squares.
    pub(super) frozen: Option<[[egui::TextureHandle; 2]; 2]>,
    /// Everything that was said, with egui's seconds.
    pub(super) log: Vec<(f64, String)>,
    pub(super) shows_log: bool,
    pub(super) frame: Option<Box<FrameReport>>,
    /// Other views of the last frame.
    stock: Stock,
    pub(super) pictures: Pictures,
    /// The selected node's handles.
    pub gizmo: TransformGizmo,
    /// Device milliseconds of frames in the chart of times: photons, left eye, right eye, reconstruction.
    pub history: VecDeque<[f32; 4]>,
    /// What has been said and not been closed.
    pub messages: Vec<Message>,
    pub(super) busy: &'static str,
    pub(super) loading: Option<Loading>,
    pub(super) fields: Fields,
    pub(super) out: PathBuf,
    /// Files that this window wrote, and may write over while they are as it left them.
    pub(super) written: HashMap<PathBuf, Stamp>,
    /// What scenes are scaled by, while one is open that this window has saved as large as it was shown.
    pub(super) other_scale: Option<f64>,
    /// Where the scene that is open was saved last.
    pub(super) saved_scene: Option<PathBuf>,
    /// Pixels per eye of a view that stands still.
    pub(super) size: [u32; 2],
    /// Which pictures the last pass drew, and where in the window, points.
    pub shown_at: Vec<(Part, egui::Rect)>,
    pub(super) gamepad: Gamepad,
    worker: Worker,
    /// Where the worker was last asked for radiance.
    pointed: Option<PicturePlace>,
    /// What the worker was last told to show.
    sent: Option<Wanted>,
    /// Counts requests and changes of what is wanted.
    asked: u64,
    /// Scenes and edits that the worker was given.
    changes: u64,
    /// Of them, those up to the scene that is open.
    opened_at: u64,
    /// What stood where after so many changes, from that of the last frame on.
    stands: VecDeque<(u64, Stand)>,
    /// The last pass shows the sketch.
    pub(super) is_sketched: bool,
    /// The part of the pictures that is shown.
    pub(super) zoom: Zoom,
    /// No frames come until something changes: refining was stopped, or what is wanted was refused.
    pub(super) is_stopped: bool,
    /// A request that no frame has answered yet, and when it was made.
    unanswered: Option<(u64, Instant)>,
    commands: Vec<WindowCommand>,
}

impl App {
    /// Opens with `start`; `wake` is called when the picture changes.
    ///
    /// # Errors
    /// If the system refuses a thread.
    pub fn new(start: Start, wake: impl Fn() + Send + 'static) -> std::io::Result<Self> {
        let Start {
            mut document,
            settings,
            is_auto_lit,
            headset,
            recording,
            out,
            window_state,
        } = start;
        let camera = camera_of(&document);
        let settings = Arc::new(settings);
        let size = settings.size.unwrap_or(START_SIZE);
        let wanted = Wanted {
            number: 0,
            settings: Arc::clone(&settings),
            other: None,
            views: headset.views_from_head(&camera.pose()),
            rendered: window_state
                .layout
                .eyes(settings.render.reuse != Reuse::Off),
            scene_time_ns: None,
            size,
            view_mode: ViewMode::Picture,
            stands: false,
        };
        // From here on they count.
        document.take_changes();
        let stands = VecDeque::from([(0, Stand::of(document.scene()))]);
        let worker = Worker::start(Box::new(document.scene().clone()), wanted, wake)?;
        Ok(Self {
            other: Arc::new(other_method(&settings)),
            environment: settings.environment.clone(),
            is_auto_lit,
            settings,
            headset,
            camera,
            player: recording.map(Player::new),
            clock: SceneClock::default(),
            selected: Selection::default(),
            window_state,
            view_mode: ViewMode::Picture,
            tab: Tab::default(),
            shows_help: false,
            hides_panels: false,
            asks_path: None,
            asks: None,
            bookmarks: [None; 5],
            frozen: None,
            log: Vec::new(),
            shows_log: false,
            frame: None,
            stock: Stock::default(),
            pictures: Pictures::default(),
            gizmo: TransformGizmo::default(),
            history: VecDeque::new(),
            messages: Vec::new(),
            busy: "",
            loading: None,
            fields: Fields::new(&out, document.original()),
            document,
            out,
            written: HashMap::new(),
            other_scale: None,
            saved_scene: None,
            size,
            shown_at: Vec::new(),
            gamepad: Gamepad::open(),
            worker,
            pointed: None,
            sent: None,
            asked: 0,
            changes: 0,
            opened_at: 0,
            stands,
            is_sketched: false,
            zoom: Zoom::default(),
            is_stopped: false,
            unanswered: Some((0, Instant::now())),
            commands: Vec::new(),
        })
    }

    /// What the window has to do.
    pub fn take_commands(&mut self) -> Vec<WindowCommand> {
        std::mem::take(&mut self.commands)
    }

    pub(super) fn command(&mut self, command: WindowCommand) {
        self.commands.push(command);
    }

    /// The scene with its history.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// The node that is selected, the last of several.
    pub fn selected(&self) -> Option<usize> {
        self.selected.last()
    }

    /// All settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// The head that is moved by hand.
    pub fn head(&self) -> Pose {
        self.camera.pose()
    }

    /// The last frame.
    pub fn frame(&self) -> Option<&FrameReport> {
        self.frame.as_deref()
    }

    /// Whether the last frame shows, in full size, everything that was asked for.
    pub fn is_up_to_date(&self) -> bool {
        let frame = self.frame.as_deref();
        !self.is_busy() && frame.is_some_and(|frame| frame.is_full && frame.number == self.asked)
    }

    /// What is being waited for; `None` once everything is shown.
    pub(super) fn awaited(&self) -> Option<String> {
        if self.is_up_to_date() || self.is_stopped {
            return None;
        }
        Some(match self.busy {
            "" => format!("rendering {}", self.view_mode.name()),
            busy => busy.to_owned(),
        })
    }

    /// Title of the window: what is open, and whether it is saved.
    pub fn title(&self) -> String {
        let mark = if self.document.is_modified() {
            " (not saved)"
        } else {
            ""
        };
        format!("stereolux: {}{mark}", self.document.scene().name)
    }

    /// Whether a scene is being read or shaders are compiled.
    pub fn is_busy(&self) -> bool {
        !self.busy.is_empty() || self.loading.is_some()
    }

    /// Selects a node, or nothing.
    pub fn select(&mut self, node: Option<usize>) {
        self.selected
            .set(node.filter(|node| self.document.scene().reaches(*node)));
    }

    pub(super) fn say(&mut self, context: &Context, text: impl Into<String>, is_error: bool) {
        let text = text.into();
        if is_error {
            log::error!("{text}");
        }
        self.log.push((context.time(), text.clone()));
        if self.log.len() > MOST_LINES {
            self.log.remove(0);
        }
        // The same trouble twice is said once.
        self.messages.retain(|message| message.text != text);
        self.messages.push(Message {
            text,
            is_error,
            since: context.time(),
        });
        if self.messages.len() > 6 {
            self.messages.remove(0);
        }
        context.request_repaint();
    }

    pub(super) fn take_reports(&mut self, context: &Context) {
        while let Some(report) = self.worker.poll() {
            match report {
                Report::Frame(frame) => {
                    self.note_times(&frame);
                    self.pictures.take(context, &frame);
                    while self
                        .stands
                        .get(1)
                        .is_some_and(|next| next.0 <= frame.changes)
                    {
                        self.stands.pop_front();
                    }
                    if let Some((number, since)) = self.unanswered
                        && number <= frame.number
                    {
                        log::debug!(
                            "answered by a frame of {}x{} in {:.1} ms",
                            frame.size[0],
                            frame.size[1],
                            since.elapsed().as_secs_f64() * 1e3
                        );
                        self.unanswered = None;
                    }
                    self.frame = Some(frame);
                }
                Report::Radiance(radiance) => {
                    if let Some(frame) = &mut self.frame {
                        frame.radiance = Some(radiance);
                    }
                }
                Report::View(view) => {
                    let (picture, mode, pictures) = *view;
                    self.stock.put(picture, mode, pictures);
                }
                Report::Busy(what) => self.busy = what,
                Report::Done(text) => self.say(context, text, false),
                Report::Failed(text) => {
                    self.busy = "";
                    self.say(context, text, true);
                }
                Report::Refused(text) => {
                    self.is_stopped = true;
                    self.say(context, text, true);
                }
                Report::Lost(text) => {
                    self.busy = "";
                    let more = format!("{text}; save what you need and start again");
                    self.say(context, more, true);
                }
            }
        }
    }

    /// Whether the last frame can show a view without another one.
    pub fn is_at_hand(&self, mode: ViewMode) -> bool {
        self.frame.as_ref().is_some_and(|frame| {
            frame.view_mode == mode
                || mode == ViewMode::Picture
                || matches!(mode, ViewMode::Inspection(view) if Seen::holds(view))
                || self.stock.get(frame.picture, mode).is_some()
        })
    }

    /// Lets the last frame show the view that is wanted, if that is at hand: a frame of its own takes longer.
    pub(super) fn show_at_hand(&mut self, context: &Context) {
        let Some(frame) = &mut self.frame else {
            return;
        };
        let (shown, wanted) = (frame.view_mode, self.view_mode);
        if shown == wanted {
            return;
        }
        let kept = self.stock.get(frame.picture, wanted).cloned();
        let made = || ViewPictures::of_frame(frame, wanted);
        let Some(pictures) = kept.or_else(made) else {
            return;
        };
        frame.view_mode = wanted;
        let last = std::mem::replace(&mut frame.shown, pictures);
        self.stock.put(frame.picture, shown, last.kept());
        self.pictures.take(context, frame);
    }

    /// The chart has frames of the scene that is open.
    fn note_times(&mut self, frame: &FrameReport) {
        if frame.changes < self.opened_at {
            return;
        }
        let ms = &frame.stats.gpu_ms;
        let times = [ms.photons, ms.left, ms.right, ms.reconstruction];
        self.history.push_back(times.map(|ms| ms as f32));
        if self.history.len() > HISTORY {
            self.history.pop_front();
        }
    }

    /// The worker is asked for something: counted, and unanswered for now.
    fn note_asked(&mut self) {
        self.asked += 1;
        self.is_stopped = false;
        self.unanswered.get_or_insert((self.asked, Instant::now()));
    }

    pub(super) fn ask(&mut self, request: Request) {
        self.note_asked();
        match &request {
            Request::Edit(_) => self.changes += 1,
            Request::Scene(_) => {
                self.changes += 1;
                self.opened_at = self.changes;
                self.note_stand();
            }
            _ => {}
        }
        self.worker.ask(request);
    }

    /// Carries an edit out, here and in the picture.
    pub fn edit(&mut self, context: &Context, edit: Edit) {
        if let Err(error) = self.document.edit(edit) {
            self.say(context, error.to_string(), true);
        }
    }

    /// Whether something of the scene is held and moves: undoing would cut that into two steps, and the hand would take back
    /// at once what was undone.
    fn is_dragging(&self, context: &Context) -> bool {
        self.document.is_in_gesture() && context.input(|input| input.pointer.any_down())
    }

    /// Goes a step through the document's history: [`Document::undo`] or [`Document::redo`].
    pub(super) fn step(
        &mut self,
        context: &Context,
        step: fn(&mut Document) -> Result<bool, EditError>,
    ) {
        if self.is_dragging(context) {
            return;
        }
        if let Err(error) = step(&mut self.document) {
            self.say(context, error.to_string(), true);
        }
        self.forget_missing();
    }

    /// Undoing may take selected nodes away.
    pub(super) fn forget_missing(&mut self) {
        self.selected.forget_missing(self.document.scene());
    }

    pub(super) fn set_settings(&mut self, context: &Context, settings: Settings) {
        if settings.headset != self.settings.headset {
            match Headset::load(&settings.headset) {
                Ok(headset) => self.headset = headset,
                Err(error) => return self.say(context, error.to_string(), true),
            }
        }
        if *self.settings != settings {
            self.settings = Arc::new(settings);
        }
    }

    /// The settings that the panel shows, of which a split view has two.
    pub(super) fn panel_settings(&self) -> &Settings {
        if self.fields.edits_other {
            &self.other
        } else {
            &self.settings
        }
    }

    pub(super) fn screenshot(&mut self) {
        let request = Request::Screenshot(self.out.clone());
        if self.is_stopped && self.is_up_to_date() {
            // Of what is shown, which stays.
            self.worker.ask(request);
        } else {
            self.ask(request);
        }
    }

    pub(super) fn reload_shaders(&mut self) {
        self.ask(Request::ReloadShaders);
    }

    /// How fast W walks now, metres per second.
    pub(super) fn speed_m_per_s(&self, context: &Context) -> f64 {
        self.camera
            .speed_m_per_s(&super::keys::held(context, &self.fields.commanding))
    }

    /// The head is moved by hand, from where a recording has it, which waits to go on.
    pub(super) fn take_head(&mut self) {
        if let Some(views) = self.player.as_ref().and_then(Player::views) {
            self.camera.set_pose(View::head_in_world(&views));
        }
        self.leave_recording();
    }

    /// The head is not where a recording has it until that goes on.
    pub(super) fn leave_recording(&mut self) {
        if let Some(player) = &mut self.player {
            player.leave();
        }
    }

    pub(super) fn focus_selected(&mut self) {
        let scene = self.document.scene();
        let all = self.selected.nodes().iter();
        let boxes = all.filter_map(|node| scene.bounds_below(*node));
        let Some(bounds) = Bounds::around(boxes) else {
            return;
        };
        let radius_m = 0.5 * bounds.size().length();
        // A light has no size; look at it from a step away.
        let radius_m = if radius_m > 0.0 {
            radius_m
        } else {
            0.2 * self.camera.speed
        };
        self.take_head();
        self.camera
            .focus(bounds.center(), radius_m, FOCUS_HALF_ANGLE_RAD);
    }

    /// Keeps both eyes' pictures to be compared with, or lets them go.
    pub(super) fn freeze(&mut self, context: &Context) {
        self.frozen = match (self.frozen.take(), &self.frame) {
            (None, Some(frame)) => Some([0, 1].map(|eye| {
                [TextureOptions::LINEAR, TextureOptions::NEAREST].map(|options| {
                    let picture = Arc::clone(&frame.shown.eyes[eye]);
                    context.load_texture("frozen", picture, options)
                })
            })),
            _ => None,
        };
    }

    /// Opens the window that asks for a path.
    pub(super) fn ask_path(&mut self, purpose: Purpose) {
        let text = match purpose {
            // Beside what was opened last.
            Purpose::Open => {
                let last = self.window_state.recent.first();
                let folder = last.and_then(|path| Path::new(path).parent());
                folder.map_or_else(String::new, |folder| {
                    folder.join("").to_string_lossy().into_owned()
                })
            }
            Purpose::Save(what) => self.fields.path_of(what).clone(),
        };
        self.asks_path = Some(PathQuestion::new(purpose, text));
    }

    /// A name that is being written in the inspector counts as it stands.
    pub(super) fn take_name(&mut self) {
        let Some((node, name)) = self.fields.name.take() else {
            return;
        };
        let known = self.document.scene().nodes.get(node);
        if known.is_some_and(|known| known.name != name)
            && let Err(error) = self.document.edit(Edit::Rename { node, name })
        {
            log::error!("{error}");
        }
    }

    /// What is being written in fields of the panels counts as it stands.
    pub(super) fn take_written(&mut self, context: &Context) {
        self.take_name();
        settings::take_written(self, context);
    }

    /// Closes the window, or asks first where something is not saved.
    pub fn request_quit(&mut self) {
        self.take_name();
        if self.document.is_modified() {
            self.asks = Some(Question::Quit);
        } else {
            self.commands.push(WindowCommand::Quit);
        }
    }

    /// Both eyes' views: of the recording, or of the head.
    pub(super) fn views(&self) -> [View; 2] {
        self.player
            .as_ref()
            .and_then(Player::views)
            .unwrap_or_else(|| self.headset.views_from_head(&self.camera.pose()))
    }

    /// The eyes that the layout needs.
    pub(super) fn rendered(&self) -> Eyes {
        let shows_reuse = self.view_mode == ViewMode::Inspection(Inspection::Provenance);
        let reuses = self.settings.render.reuse != Reuse::Off || shows_reuse;
        self.window_state.layout.eyes(reuses)
    }

    fn note_stand(&mut self) {
        let stand = Stand::of(self.document.scene());
        self.stands.push_back((self.changes, stand));
    }

    /// Changes up to the scene that is open: a frame of fewer shows another one.
    pub(super) fn opened_at(&self) -> u64 {
        self.opened_at
    }

    /// Whether the last frame shows another place or another scene than is wanted now. Animated scenes are shown by frames
    /// alone.
    pub(super) fn is_behind(&self) -> bool {
        self.frame.as_ref().is_none_or(|frame| {
            frame.changes < self.opened_at
                || !frame.has(self.rendered())
                || (self.clock.seconds.is_none()
                    && (frame.changes < self.changes || frame.views != self.views()))
        })
    }

    /// What the window draws itself until a frame comes; `None` while a frame shows it.
    pub fn sketch(&self) -> Option<Wish<'_>> {
        let frame = self.frame.as_deref();
        let frame = frame.filter(|frame| frame.changes >= self.opened_at);
        self.is_sketched.then(|| Wish {
            scene: self.document.scene(),
            scene_number: self.opened_at,
            source: frame.zip(self.stands.front().map(|(_, stand)| stand)),
            views: self.views(),
            size: self.size,
            near_m: 1e-3 * self.camera.speed,
            selected: self.selected.covered(self.document.scene()),
        })
    }

    /// Asks for the radiance at a place of what is shown: [`FrameReport::radiance`] has it soon.
    pub(super) fn point_at(&mut self, place: PicturePlace) {
        if self.pointed != Some(place) {
            self.pointed = Some(place);
            self.worker.ask(Request::Radiance(place));
        }
    }

    /// Stops refining what is shown; any change goes on with it.
    pub(super) fn stop(&mut self) {
        self.worker.ask(Request::Stop);
        self.is_stopped = true;
    }

    /// Tells the worker what is wanted now, if that is something else.
    pub(super) fn send(&mut self) {
        let edits = self.document.take_changes();
        let is_edited = !edits.is_empty();
        for edit in edits {
            self.ask(Request::Edit(Box::new(edit)));
        }
        if is_edited {
            self.note_stand();
        }
        let told = self.sent.as_ref().map_or(0, |sent| sent.number);
        let mut now = Wanted {
            number: told,
            settings: Arc::clone(&self.settings),
            other: (self.window_state.layout == Layout::Split).then(|| Arc::clone(&self.other)),
            views: self.views(),
            rendered: self.rendered(),
            scene_time_ns: self.clock.seconds.map(|seconds| (seconds * 1e9) as i64),
            size: self.size,
            view_mode: self.view_mode,
            // No reason to send it again.
            stands: self.sent.as_ref().is_some_and(|sent| sent.stands),
        };
        if self.sent.as_ref() == Some(&now) && told == self.asked {
            return;
        }
        self.note_asked();
        now.number = self.asked;
        let shown = self.frame.as_ref().map(|frame| frame.view_mode);
        now.stands = shown == Some(self.view_mode) && !self.is_behind();
        self.worker.want(now.clone());
        self.sent = Some(now);
    }
}

/// Pixels per eye until the window has been laid out.
const START_SIZE: [u32; 2] = [320, 320];

/// The head at the scene's first camera, or where all is seen.
pub(super) fn camera_of(document: &Document) -> FlyCamera {
    let scene = document.scene();
    let start = scene.start_pose();
    let size_m = scene
        .bounds_in_world()
        .map_or(5.0, |bounds| bounds.size().max_element());
    FlyCamera::new(start, size_m)
}

/// A split view begins with the other light transport.
fn other_method(settings: &Settings) -> Settings {
    use crate::settings::Method;
    let mut other = settings.clone();
    other.render.method = match settings.render.method {
        Method::Photon => Method::Path,
        Method::Path => Method::Photon,
    };
    other
}
