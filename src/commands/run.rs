//! `run` and `render`: both are the frame loop, `render` over one frame of a still headset.

use std::ops::Range;
use std::path::Path;
use std::time::Instant;

use super::progress::Bar;
use super::source::{Source, desktop_source, source};
use super::{Failure, load_scene, report};
use crate::app::{App, Application, SceneAlone};
use crate::frame::user_passes::shader_library;
use crate::frame_loop::{self, LoopError, LoopOptions, Outcome, inspection};
use crate::gpu::GpuContext;
use crate::interrupt;
use crate::mirror::{Mirror, MirrorWindow};
use crate::options::{RenderOptions, RunOptions, SessionChoice};
use crate::output::OutputFolder;
use crate::printable::did_you_mean;
use crate::renderer::Renderer;
use crate::scene::{Camera, Scene};
use crate::scene_loading::Loaded;
use crate::settings::{
    Aov, ExrPrecision, Eyes, FramesInFlight, OutputSettings, RenderSettings, Reuse, Settings,
    Timestamps, WriteImages,
};
use crate::xr::validation::MAX_FOV_ANGLE_DEG;
use crate::xr::{
    Actions, Fov, HandScript, Headset, Motion, Pose, Recorder, SimulatedSession, XrSession,
};

/// The stereo frame loop, with an application on it.
pub fn run(options: &RunOptions, app: &mut dyn App) -> Result<(), Failure> {
    let headset = headset(&options.settings)?;
    let mut loaded = load_scene(&options.settings)?;
    loaded.settings.render.decide_switches(true);
    let start = options.session.pose;
    let start = start.unwrap_or_else(|| start_pose(&loaded, &headset));
    OutputFolder::check(&options.shared.out)?;
    // Before a session is opened: without a display there is nothing to close again.
    let is_desktop = options.session.choice == SessionChoice::Desktop;
    let mut window = (options.session.mirror || is_desktop)
        .then(MirrorWindow::open)
        .transpose()?;
    let hands = hand_script(&options.settings, &loaded.scene, &start)?;
    let actions = app.actions().map_err(Failure::unusable)?;
    let source = match window.as_mut().filter(|_| is_desktop) {
        Some(window) => desktop_source(options, &headset, start, &loaded.scene, &actions, window)?,
        None => source(options, &headset, start, hands, &actions)?,
    };
    interrupt::catch();
    let in_headset = source.context.is_some();
    let hurries = is_desktop || options.session.realtime || in_headset;
    decide_output(&mut loaded.settings, in_headset || is_desktop, hurries);
    if in_headset && !options.names_reuse {
        loaded.settings.render.reuse = Reuse::Lookup;
    }
    // Motion is that since the frame before.
    let aovs = loaded.settings.output.aov_list();
    let least = aovs.is_ok_and(|aovs| aovs.contains(&Aov::Motion));
    let warm_up = options.session.warm_up.max(u32::from(least));
    render_session(
        source,
        loaded,
        app,
        actions,
        &Job {
            eyes: Eyes::Both,
            range: options.session.range.as_ref().map(|range| (range, warm_up)),
            every: options.session.every,
            out: &options.shared.out,
            record: options.session.record.as_deref(),
        },
        window,
    )
}

/// Decides what is written and timed where settings leave it to `auto`: a wearer, or a person before a window, waits for neither.
/// And how many frames are on their way to the device at once, if a headset or a clock hurries them.
fn decide_output(settings: &mut Settings, is_watched: bool, hurries: bool) {
    if settings.output.images == WriteImages::Auto {
        settings.output.images = (!is_watched).into();
    }
    let timestamps = &mut settings.render.gpu.timestamps;
    if *timestamps == Timestamps::Auto {
        *timestamps = if is_watched {
            Timestamps::Stages
        } else {
            Timestamps::On
        };
    }
    let in_flight = &mut settings.gpu.frames_in_flight;
    if *in_flight == FramesInFlight::Auto {
        *in_flight = match hurries && !settings.output.images.is_on() {
            true => FramesInFlight::Two,
            false => FramesInFlight::One,
        };
    }
}

/// Where the head starts. The embedded box is seen by its camera through a narrow angle: a headset stands nearer, so that
/// the box's opening fills as much of the view.
fn start_pose(loaded: &Loaded, headset: &Headset) -> Pose {
    let scene = &loaded.scene;
    let mut pose = scene.start_pose();
    let angle = scene.start_camera().and_then(|camera| camera.yfov_rad);
    if loaded.settings.scene != "builtin:cornell" {
        return pose;
    }
    if let (Some(angle), Some(bounds)) = (angle, scene.bounds_in_world()) {
        let seen = headset.views_from_head(&pose)[0].fov.tangents();
        let share = (f64::from(angle) / 2.0).tan() / ((seen.up - seen.down) / 2.0);
        let distance_m = pose.position.z - bounds.max.z;
        pose.position.z -= distance_m * (1.0 - share.min(1.0));
    }
    pose
}

/// The camera's angles for an image of this size; `None` for an orthographic one, or one of no use.
fn camera_fov(camera: &Camera, size: [u32; 2]) -> Option<Fov> {
    let tan_up = (f64::from(camera.yfov_rad?) / 2.0).tan();
    let tan_right = tan_up * f64::from(size[0]) / f64::from(size[1]);
    let [up, right] = [tan_up, tan_right].map(|tangent| tangent.atan().to_degrees());
    let is_usable = |angle: f64| angle > 0.0 && angle <= MAX_FOV_ANGLE_DEG;
    let fov = Fov::from_degrees(-right, right, up, -up);
    (is_usable(up) && is_usable(right)).then_some(fov)
}

/// One stereo pair from one pose.
pub fn render(options: &RenderOptions) -> Result<(), Failure> {
    let mut headset = headset(&options.settings)?;
    if let Some(ipd_m) = options.view.ipd {
        headset = headset.with_ipd(ipd_m)?;
    }
    let mut loaded = load_scene(&options.settings)?;
    loaded.settings.render.decide_switches(false);
    decide_output(&mut loaded.settings, false, false);
    interrupt::catch();
    let scene = &loaded.scene;
    let size = options.settings.size.unwrap_or(headset.size);
    let mut announcement = None;
    if let Some(fov) = options.view.fov {
        headset = headset.with_fov(fov)?;
    } else if options.view.pose.is_none()
        && !options.names_headset
        && let Some(camera) = scene.start_camera()
    {
        let fov = camera_fov(camera, size);
        let angles = match fov {
            Some(fov) => format!("{:.1} degrees high", 2.0 * fov.angle_up.to_degrees()),
            None => "with the headset's angles, since it has none that serve".to_owned(),
        };
        announcement = Some(format!(
            "the view is the glTF camera's '{}', {angles}; --fov or --headset give other angles",
            camera.name
        ));
        if let Some(fov) = fov {
            headset = headset.with_fov(fov)?;
        }
    }
    let pose = options.view.pose.unwrap_or_else(|| scene.start_pose());
    let session = SimulatedSession::new(headset, Motion::Still, pose, Some(1));
    render_session(
        Source {
            name: "one pose".to_owned(),
            announcement,
            ..Source::of(Box::new(session), size, Some(1))
        },
        loaded,
        &mut SceneAlone,
        Actions::default(),
        &Job {
            eyes: options.view.eyes,
            range: None,
            every: 1,
            out: &options.shared.out,
            record: None,
        },
        None,
    )
}

/// How many frames are on their way to the device at once.
fn in_flight(settings: &Settings) -> usize {
    if settings.render.output.work {
        // Its log holds one frame.
        return 1;
    }
    match settings.gpu.frames_in_flight {
        FramesInFlight::Auto | FramesInFlight::One => 1,
        FramesInFlight::Two => 2,
        FramesInFlight::Three => 3,
    }
}

/// What both commands ask of the frame loop.
struct Job<'a> {
    eyes: Eyes,
    range: Option<(&'a Range<u32>, u32)>,
    every: u32,
    out: &'a Path,
    record: Option<&'a Path>,
}

fn headset(settings: &Settings) -> Result<Headset, Failure> {
    Ok(Headset::load(&settings.headset)?)
}

/// What the simulated hands do.
fn hand_script(settings: &Settings, scene: &Scene, start: &Pose) -> Result<HandScript, Failure> {
    if settings.simulated.hands.is_empty() {
        return Ok(HandScript::default());
    }
    let names = || scene.nodes.iter().map(|node| node.name.as_str());
    let place_of = |name: &str| match names().position(|known| known == name) {
        Some(node) => {
            let world_from_node = scene.rest_pose().world_from_node[node];
            Ok(scene.center_of_node(node, &world_from_node))
        }
        None => Err(did_you_mean(name, names())),
    };
    let path = Path::new(&settings.simulated.hands);
    HandScript::load(path, start, &place_of).map_err(Failure::unusable)
}

fn render_session(
    source: Source,
    loaded: Loaded,
    app: &mut dyn App,
    actions: Actions,
    job: &Job<'_>,
    window: Option<MirrorWindow>,
) -> Result<(), Failure> {
    let Loaded {
        scene,
        mut settings,
        light,
    } = loaded;
    let Source {
        session,
        context,
        name,
        announcement,
        lacks_room,
        size,
        frames,
        qualities,
    } = source;
    settings.render.surroundings.passthrough &= !lacks_room;
    let settings = &settings;
    OutputFolder::check(job.out)?;
    let mut context = match context {
        Some(context) => context,
        None => GpuContext::open(Some(&settings.adapter))?,
    };
    context.keep_pipelines();
    let mut mirror = window
        .map(|window| Mirror::new(window, &context))
        .transpose()?;
    if context.adapter.is_software() {
        log::info!(
            "{} computes on the CPU: timings are not a GPU's",
            context.adapter.name
        );
    }
    let passes = &settings.render.user_passes;
    let library = shader_library(&settings.gpu.shader_folder, passes).map_err(Failure::unusable)?;
    let mut application = Application::start(app, actions, scene, settings, library.clone())
        .map_err(|error| Failure::unusable(LoopError::App(error)))?;
    let scene = &application.kept.scene;
    let aovs = settings.output.aov_list().map_err(Failure::unusable)?;
    let mut render = settings.render.clone();
    for aov in &aovs {
        render = inspection(*aov).settings_for(&render);
    }
    let first = |(range, warm_up): (&Range<u32>, u32)| range.start.saturating_sub(warm_up);
    let first = job.range.map_or(0, first);
    let mut bar = Bar::new(settings.render.spp, first, frames);
    bar.say("compiling");
    let mut renderer = Renderer::for_session(
        context,
        &library,
        scene,
        &render,
        job.eyes,
        size,
        session.info(),
    )?;
    for (frame, quality) in &qualities {
        renderer
            .check_quality(quality)
            .map_err(|error| Failure::unusable(format!("{name}: frame {frame}: {error}")))?;
    }
    if interrupt::requested() {
        return Err(Failure::failed(
            "interrupted before the first frame; nothing was written",
        ));
    }
    // Everything that can be refused has been; only now do files appear, and old ones go once the new can be written.
    let adapter = &renderer.context().adapter.name;
    let mut output = OutputFolder::open(job.out, settings, adapter)?;
    let mut session: Box<dyn XrSession> = match job.record {
        Some(path) => match Recorder::create(path, session) {
            Ok(recorder) => Box::new(recorder),
            Err(error) => {
                output.give_up();
                return Err(error.into());
            }
        },
        None => session,
    };
    warn_of_much_output(&settings.output, &render, &aovs, job, frames, size);
    let removed = output.clear()?;
    if removed > 0 {
        let out = job.out.display();
        bar.print(&format!(
            "removed {removed} files of an older run from {out}"
        ));
    }
    if settings.render.output.chrome_trace {
        let clocks = renderer.compare_clocks()?;
        output.begin_trace(&clocks)?;
    }
    if let Some(light) = &light {
        bar.print(&format!("light: {light}"));
    }
    if let Some(line) = &announcement {
        bar.print(line);
    }
    let mut outcome = Outcome::default();
    let began = Instant::now();
    let ended = frame_loop::run(
        session.as_mut(),
        &mut renderer,
        &library,
        &mut output,
        LoopOptions {
            range: job.range,
            every: job.every,
            images: settings.output.images.is_on(),
            aovs: &aovs,
            in_flight: in_flight(settings),
        },
        &mut bar,
        mirror.as_mut(),
        &mut application,
        &mut outcome,
    );
    outcome.wall_s = began.elapsed().as_secs_f64();
    // The window goes at once, also while files are still written.
    if let Some(mirror) = mirror {
        mirror.close();
    }
    bar.finish();
    let traced = output.finish_trace();
    let ended = ended.map_err(Failure::from);
    // The folder was writable when the run began.
    let traced = traced.map_err(Failure::failed);
    let ended = ended.and(traced).and_then(|()| {
        if interrupt::requested() {
            return Err(Failure::failed(format!(
                "interrupted after {} frames; files written so far are complete",
                outcome.frames
            )));
        }
        Ok(())
    });
    let scene = &application.kept.scene;
    let run = report::EndedRun {
        settings,
        renderer: &renderer,
        scene,
        light: light.map(|light| light.to_string()),
        session: &name,
        info: session.info(),
        size,
        outcome: &outcome,
        error: ended.as_ref().err().map(|failure| failure.message.as_str()),
    };
    let written = OutputFolder::write_run(output.path(), &run);
    // The first error is the one to tell.
    if ended.is_ok() || interrupt::requested() {
        written.map_err(Failure::failed)?;
        if let Some(advice) = output.exposure_advice() {
            eprint_line!("{advice}");
        }
        eprint_line!("{}", run.summary_line(output.path()));
    }
    ended
}

/// Bytes over which a run says how much it will write.
const MUCH_OUTPUT: f64 = 2e9;

/// Says how much a run may write, if that is much. ZIP's share is not known before: the figure is the most.
fn warn_of_much_output(
    output: &OutputSettings,
    render: &RenderSettings,
    aovs: &[Aov],
    job: &Job<'_>,
    frames: Option<u32>,
    size: [u32; 2],
) {
    let in_range = |(range, _): (&Range<u32>, u32)| {
        let end = frames.map_or(range.end, |frames| frames.min(range.end));
        end.saturating_sub(range.start)
    };
    let frames = job.range.map(in_range).or(frames);
    let Some(frames) = frames.filter(|_| output.images.is_on()) else {
        return;
    };
    let eyes = if job.eyes == Eyes::Both { 2.0 } else { 1.0 };
    let color = match output.exr {
        ExrPrecision::F32 => 12.0,
        ExrPrecision::F16 => 6.0,
    };
    let parts = if render.output.parts { 4.0 } else { 1.0 };
    let layers = aovs.iter().map(|aov| match aov {
        Aov::Depth | Aov::Instance => 4.0,
        Aov::Motion => 8.0,
        Aov::Normal | Aov::Albedo => color,
    });
    // 3 bytes for the PNG, 3 for the picture of reuse.
    let per_pixel = parts * color + layers.sum::<f64>() + 6.0;
    let pixels = f64::from(size[0]) * f64::from(size[1]);
    let frames = f64::from(frames.div_ceil(job.every.max(1)));
    let bytes = frames * eyes * pixels * per_pixel;
    if bytes > MUCH_OUTPUT {
        log::warn!(
            "images of {frames} frame{s} take up to {:.1} GB before compression; --every K writes fewer, \
             --set output.exr=f16 smaller ones, --set output.images=false none",
            bytes * 1e-9,
            s = if frames == 1.0 { "" } else { "s" },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_headset_gets_no_files_and_times_of_stages_unless_settings_say_so() {
        for (in_headset, images, timestamps) in [
            (true, WriteImages::Off, Timestamps::Stages),
            (false, WriteImages::On, Timestamps::On),
        ] {
            let mut settings = Settings::default();
            decide_output(&mut settings, in_headset, in_headset);
            let render = &settings.render;
            assert_eq!(settings.output.images, images);
            assert_eq!(render.gpu.timestamps, timestamps);
            assert_eq!(in_flight(&settings), if in_headset { 2 } else { 1 });
            let mut settings = Settings::default();
            settings.output.images = true.into();
            settings.render.gpu.timestamps = false.into();
            settings.gpu.frames_in_flight = FramesInFlight::Three;
            let given = settings.clone();
            decide_output(&mut settings, in_headset, in_headset);
            assert_eq!(settings, given);
        }
    }
}
