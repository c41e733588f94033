//! Eyes that are located once more right before they are rendered: who sees which views, how old they are, and that a
//! replay has the same pixels.

use std::cell::RefCell;
use std::path::Path;
use std::rc::Rc;
use std::time::{Duration, Instant};

use glam::{DQuat, DVec3, Vec3};
use stereolux::FrameLoop;
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::Eye;
use stereolux::scene::Scene;
use stereolux::settings::Reuse;
use stereolux::xr::trace::Trace;
use stereolux::xr::{
    FrameState, FrameSubmission, Headset, LocatedViews, Motion, Recorder, RenderTargets,
    ReplayOptions, ReplaySession, SessionInfo, SimulatedSession, View, XrError, XrSession,
};

use super::support::TemporaryFile;
use crate::suite::support::{both_bits, builtin, context, hit_rays, settings};

const FRAMES: u64 = 4;

/// Calls and when they came.
type Calls = Rc<RefCell<Vec<(&'static str, Instant)>>>;

/// A headset whose head goes on by a centimetre and turns while a frame is prepared.
struct Moving {
    inner: SimulatedSession,
    calls: Calls,
}

impl Moving {
    fn note(&self, call: &'static str) {
        self.calls.borrow_mut().push((call, Instant::now()));
    }
}

fn moved(views: [View; 2]) -> [View; 2] {
    views.map(|view| View {
        position_in_world: view.position_in_world + DVec3::new(0.01, -0.002, 0.004),
        orientation: (view.orientation * DQuat::from_rotation_y(0.02)).normalize(),
        ..view
    })
}

impl XrSession for Moving {
    fn info(&self) -> &SessionInfo {
        self.inner.info()
    }

    fn wait_frame(&mut self) -> Result<Option<FrameState>, XrError> {
        self.note("wait");
        self.inner.wait_frame()
    }

    fn begin_frame(&mut self) -> Result<(), XrError> {
        self.note("begin");
        self.inner.begin_frame()
    }

    fn locate_views(&mut self, time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        self.note("locate");
        self.inner.locate_views(time_ns)
    }

    fn relocate_views(&mut self, time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        self.note("relocate");
        let located = self.inner.locate_views(time_ns)?;
        Ok(located.map(|located| LocatedViews::valid(moved(located.views))))
    }

    fn acquire_targets(&mut self) -> Result<RenderTargets, XrError> {
        self.note("acquire");
        self.inner.acquire_targets()
    }

    fn end_frame(&mut self, submission: FrameSubmission<'_>) -> Result<(), XrError> {
        self.note("end");
        self.inner.end_frame(submission)
    }
}

fn moving(scene: &Scene) -> (Moving, Calls) {
    let headset = Headset::load("symmetric").unwrap();
    let inner = SimulatedSession::new(headset, Motion::Walk, scene.start_pose(), Some(FRAMES));
    let calls = Calls::default();
    let session = Moving {
        inner,
        calls: Rc::clone(&calls),
    };
    (session, calls)
}

/// What a frame's application saw, and both eyes' bits.
type Seen = ([View; 2], [Vec<[u32; 3]>; 2]);

fn play(session: impl XrSession, scene: &Scene) -> Vec<Seen> {
    let settings = settings(|s| {
        s.reuse = Reuse::Lookup;
        s.photon.every_frame = true;
        s.reconstruct.svgf = true.into();
        s.reconstruct.taa = true.into();
    });
    let library = ShaderLibrary::embedded();
    let mut frames =
        FrameLoop::new(context(), library, session, scene, &settings, [32, 24]).unwrap();
    let mut seen = Vec::new();
    loop {
        let mut views = None;
        let stats = frames.next_frame(|_, frame| views = Some(frame.views));
        if stats.unwrap().is_none() {
            return seen;
        }
        seen.push((views.unwrap(), both_bits(frames.renderer())));
    }
}

fn replay(path: &Path, scene: &Scene) -> Vec<Seen> {
    let options = ReplayOptions::new(Headset::load("symmetric").unwrap(), scene.start_pose());
    play(ReplaySession::open(path, options).unwrap(), scene)
}

#[test]
fn a_replay_has_what_was_located_first_and_last() {
    let scene = builtin("cornell");
    let [file, again, without] =
        ["late.jsonl", "again.jsonl", "without.jsonl"].map(TemporaryFile::new);
    let recorded = play(
        Recorder::create(&file.0, Box::new(moving(&scene).0)).unwrap(),
        &scene,
    );
    let trace = Trace::read(&file.0).unwrap();
    assert_eq!(trace.frames.len(), FRAMES as usize);
    for (frame, (views, _)) in trace.frames.iter().zip(&recorded) {
        // The application sees the first, the eyes are rendered by the last.
        assert_eq!(frame.located, Some(*views));
        assert_eq!(frame.views.views, moved(*views));
    }
    assert!(replay(&file.0, &scene) == recorded, "a replay differs");
    let options = ReplayOptions::new(Headset::load("symmetric").unwrap(), scene.start_pose());
    let session = ReplaySession::open(&file.0, options).unwrap();
    play(
        Recorder::create(&again.0, Box::new(session)).unwrap(),
        &scene,
    );
    assert_eq!(Trace::read(&again.0).unwrap(), trace);
    // A replay that knows of the last views alone traces photons around another place: that is seen.
    let text = std::fs::read_to_string(&file.0).unwrap();
    let lines = text
        .lines()
        .map(|line| match line.split_once(",\"located\":[") {
            Some((before, _)) => format!("{before}}}\n"),
            None => format!("{line}\n"),
        });
    std::fs::write(&without.0, lines.collect::<String>()).unwrap();
    let late_alone = replay(&without.0, &scene);
    assert!(late_alone[0].0 != recorded[0].0 && late_alone[0].1 != recorded[0].1);
    // Views that stay where they are need no second place in a file.
    let headset = Headset::load("symmetric").unwrap();
    let still = SimulatedSession::new(headset, Motion::Sway, scene.start_pose(), Some(2));
    play(
        Recorder::create(&without.0, Box::new(still)).unwrap(),
        &scene,
    );
    let text = std::fs::read_to_string(&without.0).unwrap();
    assert!(text.contains("\"version\":1") && !text.contains("located"));
}

#[test]
fn poses_are_as_old_as_the_eyes_and_images_are_taken_last() {
    const PREPARING: Duration = Duration::from_millis(60);
    let scene = builtin("cornell");
    let (session, calls) = moving(&scene);
    let library = ShaderLibrary::embedded();
    // Samples in the middle of their pixels.
    let settings = settings(|s| s.decide_switches(false));
    let mut frames =
        FrameLoop::new(context(), library, session, &scene, &settings, [32, 24]).unwrap();
    let mut first = None;
    for _ in 0..FRAMES {
        calls.borrow_mut().clear();
        let stats = frames.next_frame(|_, frame| {
            first = Some(frame.views);
            std::thread::sleep(PREPARING);
            calls.borrow_mut().push(("updated", Instant::now()));
        });
        let age_ms = stats.unwrap().unwrap().pose_age_ms;
        let calls = calls.borrow();
        let order = calls.iter().map(|(call, _)| *call);
        let expected = [
            "wait", "begin", "locate", "updated", "relocate", "acquire", "end",
        ];
        assert!(order.eq(expected), "{calls:?}");
        let ms = |from: usize, to: usize| (calls[to].1 - calls[from].1).as_secs_f64() * 1e3;
        // The application's time does not count: the pose was asked for after it, and the eyes were on their way before
        // images were taken.
        assert!(age_ms > 0.0 && age_ms <= ms(3, 5), "{age_ms} ms, {calls:?}");
        let first_age_ms = ms(2, 5);
        assert!(age_ms + PREPARING.as_secs_f64() * 1e3 <= first_age_ms);
        // Rays of the left image's middle: as the late views have them, to the precision of f32.
        let rays = hit_rays(frames.renderer(), Eye::Left);
        let found = Vec3::from_slice(&rays[12 * 32 + 16]).as_dvec3();
        let ahead = |view: &View| {
            let tan = view.fov.tangents();
            let x = tan.left + (16.5 / 32.0) * (tan.right - tan.left);
            let y = tan.up + (12.5 / 24.0) * (tan.down - tan.up);
            view.orientation * DVec3::new(x, y, -1.0).normalize()
        };
        let first = first.unwrap();
        assert!((found - ahead(&moved(first)[0])).length() < 1e-5);
        assert!((found - ahead(&first[0])).length() > 0.01);
    }
}
