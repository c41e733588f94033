//! The native trace: what is written reads back to the bit, what is broken says where.

#![allow(clippy::unwrap_used)]

use glam::{DQuat, DVec3};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::path::Path;
use stereolux_settings::{Quality, RenderSettings};
use stereolux_xr::input::JOINTS;
use stereolux_xr::trace::{Trace, TraceFrame, TraceHeader, frame_line, header_line};
use stereolux_xr::{
    ActionValue, ActionValues, Button, Buttons, ControllerModel, Fov, FrameState, FrameSubmission,
    Hand, HandScript, Headset, HiddenArea, Input, InputError, Joint, LocatedViews, Motion, Pose,
    Recorder, RenderTargets, ReplayOptions, ReplaySession, SessionInfo, Side, SimulatedSession,
    Tracked, View, XrError, XrSession,
};

use crate::cases::cases;
use crate::folders::TemporaryFile;

const HEADER: &str =
    r#"{"format":"stereolux-trace","version":1,"headset":"quest3","refresh_hz":90.0}"#;
const HEADER_2: &str =
    r#"{"format":"stereolux-trace","version":2,"headset":"quest3","refresh_hz":90.0}"#;
const FRAME: &str = r#"{"t_ns":0,"views":[{"position":[-0.03,1.6,0.0],"orientation":[0.0,0.0,0.0,1.0],"fov":{"left":-0.9,"right":0.8,"up":0.9,"down":-0.9}},{"position":[0.03,1.6,0.0],"orientation":[0.0,0.0,0.0,1.0],"fov":{"left":-0.8,"right":0.9,"up":0.9,"down":-0.9}}],"flags":{"position_valid":true,"orientation_valid":true}}"#;

fn read(text: &str) -> Result<Trace, InputError> {
    Trace::from_reader("t.jsonl", text.as_bytes())
}

fn frame_at(t_ns: i64) -> String {
    FRAME.replacen("\"t_ns\":0", &format!("\"t_ns\":{t_ns}"), 1)
}

fn write(trace: &Trace) -> String {
    let frames = trace.frames.iter().map(TraceFrame::version);
    let version = frames.fold(trace.header.version(), u64::max);
    let mut text = header_line(&trace.header, version).unwrap();
    for frame in &trace.frames {
        text += &frame_line(frame).unwrap();
    }
    text
}

#[test]
fn the_documented_lines_read_and_write_back() {
    let text = format!("{HEADER}\n{FRAME}\n{}\n", frame_at(11_111_111));
    let trace = read(&text).unwrap();
    assert_eq!(
        trace.header,
        TraceHeader {
            headset: "quest3".into(),
            refresh_hz: 90.0,
            hidden: None,
        }
    );
    assert_eq!(trace.frames.len(), 2);
    assert_eq!(trace.frames[1].t_ns, 11_111_111);
    let left = &trace.frames[0].views.views[0];
    assert_eq!(left.position_in_world, DVec3::new(-0.03, 1.6, 0.0));
    assert_eq!(
        left.fov,
        Fov {
            angle_left: -0.9,
            angle_right: 0.8,
            angle_up: 0.9,
            angle_down: -0.9
        }
    );
    assert!(trace.warnings.is_empty());
    assert_eq!(write(&trace), text);
}

#[test]
fn windows_line_ends_byte_order_mark_and_blank_lines() {
    let text = format!("\u{feff}{HEADER}\r\n\r\n{FRAME}\r\n  \r\n");
    assert_eq!(
        read(&text).unwrap(),
        read(&format!("{HEADER}\n{FRAME}")).unwrap()
    );
}

#[test]
fn a_cut_anywhere_in_the_last_line_loses_that_line_only() {
    let text = format!("{HEADER}\n{FRAME}\n{}", frame_at(7));
    let whole = read(&text).unwrap();
    assert_eq!(whole.frames.len(), 2);
    let last = text.len() - frame_at(7).len();
    for end in last + 1..text.len() {
        let cut = read(&text[..end]).unwrap();
        assert_eq!(cut.frames, whole.frames[..1], "cut at byte {end}");
        assert_eq!(cut.warnings.len(), 1);
        assert!(cut.warnings[0].contains("line 3"), "{}", cut.warnings[0]);
    }
    assert!(read(&text[..last]).unwrap().warnings.is_empty());
    // Within a character, too; before the last line it is none.
    let half = &"\u{e4}".as_bytes()[..1];
    let cut = [format!("{HEADER}\n{FRAME}\n{{\"").as_bytes(), half].concat();
    let found = Trace::from_reader("t.jsonl", &*cut).unwrap();
    assert_eq!(found.frames, whole.frames[..1]);
    assert!(found.warnings[0].contains("line 3"), "{:?}", found.warnings);
    let damaged = [HEADER.as_bytes(), half, b"\n", FRAME.as_bytes()].concat();
    let error = Trace::from_reader("t.jsonl", &*damaged).unwrap_err();
    assert_eq!(error.line, Some(1));
    // The control: the same damage before the last line is an error there.
    let error = read(&format!("{HEADER}\n{}\n{}\n", &FRAME[..100], frame_at(7))).unwrap_err();
    assert_eq!(error.line, Some(2));
    // Damage that is no cut is an error on the last line too.
    let error = read(&format!(
        "{HEADER}\n{FRAME}\n{}",
        frame_at(7).replacen(':', ";", 1)
    ))
    .unwrap_err();
    assert_eq!(error.line, Some(3));
}

#[test]
fn a_trace_without_a_whole_frame_is_unusable() {
    for text in [
        "",
        "\n\n",
        "\u{feff}",
        HEADER,
        &HEADER[..30],
        &format!("{HEADER}\n{}", &FRAME[..50]),
    ] {
        let error = read(text).unwrap_err().to_string();
        assert!(error.starts_with("t.jsonl"), "{error}");
        assert!(!error.contains('\n'), "{error}");
    }
}

#[test]
fn header_faults() {
    let field = |from: &str, to: &str| {
        assert!(HEADER.contains(from), "{from}");
        let error = read(&format!("{}\n{FRAME}\n", HEADER.replacen(from, to, 1))).unwrap_err();
        assert_eq!(error.line, Some(1));
        error.field.unwrap_or_default()
    };
    assert_eq!(field("stereolux-trace", "other"), "format");
    assert_eq!(field("\"format\":\"stereolux-trace\",", ""), "format");
    assert_eq!(field("\"version\":1", "\"version\":3"), "version");
    assert_eq!(field("\"version\":1,", ""), "version");
    assert_eq!(field("\"quest3\"", "3"), "headset");
    assert_eq!(field("90.0", "0.0"), "refresh_hz");
    assert_eq!(field("90.0", "-90.0"), "refresh_hz");
    assert_eq!(field("90.0", "\"90\""), "refresh_hz");
    assert_eq!(field("90.0", "null"), "refresh_hz");
    assert_eq!(field("\"version\"", "\"extra\":0,\"version\""), "extra");
    assert_eq!(field("{\"format\"", "[\"format\""), "");
    assert_eq!(
        read(FRAME).unwrap_err().field.as_deref(),
        Some("format"),
        "no header at all"
    );
}

#[test]
fn frame_faults_name_line_and_field() {
    // Where no field is named, or one without its path, it is not JSON.
    for [from, to, field, remark] in cases(
        r#"
        "t_ns":0 | "t_ns":0.5 | t_ns | -
        "t_ns":0 | "t_ns":-1 | t_ns | before the frame before
        "t_ns":0 | "t_ns":99999999999999999999 | t_ns | -
        "t_ns":0, | - | t_ns | -
        [-0.03,1.6,0.0] | [-0.03,1.6] | views[0].position | -
        [0.03,1.6,0.0] | [0.03,"1.6",0.0] | views[1].position[1] | -
        [0.03,1.6,0.0] | [0.03,null,0.0] | views[1].position[1] | -
        [-0.03,1.6,0.0] | 7 | views[0].position | -
        [0.0,0.0,0.0,1.0] | [0.0,0.0,0.0,1.1] | views[0].orientation | -
        [0.0,0.0,0.0,1.0] | [0.0,0.0,0.0,0.0] | views[0].orientation | -
        "left":-0.9 | "left":-1.7 | views[0].fov.left | beyond 89 degrees
        "left":-0.9 | "left":0.9 | views[0].fov.left | left over right
        "left":-0.8 | "left":-170.0 | views[1].fov.left | degrees by mistake
        "down":-0.9 | "down":0.9 | views[0].fov.down | -
        "up":0.9, | - | views[0].fov.up | -
        "up":0.9 | "top":0.9 | views[0].fov.top | -
        "position_valid":true | "position_valid":false | flags.position_valid | -
        "orientation_valid":true | "orientation_valid":false | flags.orientation_valid | -
        "orientation_valid":true | "orientation_valid":1 | flags.orientation_valid | -
        "flags" | "flag" | flag | -
        [0.03,1.6,0.0] | [NaN,1.6,0.0] | position | -
        [0.03,1.6,0.0] | [1e999,1.6,0.0] | position | -
        "views":[ | "views": | - | -
        "#,
    ) {
        assert!(FRAME.contains(from), "{from}");
        let broken = FRAME.replacen(from, to, 1);
        let broken = broken.replacen("\"t_ns\":0", "\"t_ns\":5", 1);
        let error = read(&format!("{HEADER}\n{FRAME}\n{broken}\n{}\n", frame_at(9))).unwrap_err();
        assert_eq!(error.line, Some(3), "{error}");
        assert!(!error.to_string().contains('\n'), "{error}");
        assert_eq!(error.field.unwrap_or_default(), field, "{to} {remark}");
    }
}

#[test]
fn an_error_is_one_line_whatever_the_file_holds() {
    let broken = FRAME.replacen("\"flags\"", "\"fl\\nags\"", 1);
    let error = read(&format!("{HEADER}\n{broken}\n")).unwrap_err();
    assert_eq!(error.field.as_deref(), Some("fl\nags"));
    assert!(!error.to_string().contains('\n'), "{error}");
}

#[test]
fn one_view_or_three_are_refused() {
    let value: serde_json::Value = serde_json::from_str(FRAME).unwrap();
    for count in [0, 1, 3] {
        let mut value = value.clone();
        let view = value["views"][0].clone();
        value["views"] = serde_json::Value::Array(vec![view; count]);
        let error = read(&format!("{HEADER}\n{value}\n")).unwrap_err();
        assert_eq!(error.field.as_deref(), Some("views"), "{error}");
    }
}

#[test]
fn a_repeated_time_is_refused() {
    let error = read(&format!("{HEADER}\n{FRAME}\n{FRAME}\n")).unwrap_err();
    assert_eq!(
        (error.line, error.field.as_deref()),
        (Some(3), Some("t_ns"))
    );
}

#[test]
fn unusable_files() {
    let error = Trace::read(Path::new("/nowhere/t.jsonl"))
        .unwrap_err()
        .to_string();
    assert!(error.contains("/nowhere/t.jsonl"), "{error}");
    assert!(
        Trace::read(&std::env::temp_dir())
            .unwrap_err()
            .to_string()
            .contains("directory")
    );
    // A sparse terabyte of zero bytes: refused at once.
    let huge = TemporaryFile::new("huge.jsonl");
    std::fs::File::create(&huge.0)
        .unwrap()
        .set_len(1 << 40)
        .unwrap();
    assert!(
        Trace::read(&huge.0)
            .unwrap_err()
            .to_string()
            .contains("256 KiB")
    );
}

/// A frame as far as its views; `None` at the end.
fn begin(session: &mut dyn XrSession) -> Option<(FrameState, LocatedViews)> {
    let frame = session.wait_frame().unwrap()?;
    session.begin_frame().unwrap();
    let located = session.locate_views(frame.predicted_display_time_ns);
    Some((frame, located.unwrap().unwrap()))
}

/// A frame in which nothing else changes.
fn plain(t_ns: i64, views: LocatedViews, switch_reuse: bool, input: Input) -> TraceFrame {
    TraceFrame {
        t_ns,
        views,
        located: None,
        switch_reuse,
        refresh_hz: None,
        hidden: None,
        quality: None,
        controller_model: [None, None],
        input,
    }
}

fn play(session: &mut dyn XrSession) -> Vec<TraceFrame> {
    let mut frames = Vec::new();
    while let Some((frame, views)) = begin(session) {
        let t_ns = frame.predicted_display_time_ns;
        let input = session.locate_input(t_ns).unwrap();
        session
            .end_frame(FrameSubmission::new(t_ns, Some(&views)))
            .unwrap();
        frames.push(plain(t_ns, views, frame.switch_reuse, input));
    }
    frames
}

fn simulated(frames: u64) -> SimulatedSession {
    let start = Pose::new(DVec3::new(0.1, 1.6, 1e6), DQuat::from_rotation_y(0.4));
    SimulatedSession::new(
        Headset::load("index").unwrap(),
        Motion::Sway,
        start,
        Some(frames),
    )
    .with_seed(5)
}

#[test]
fn a_recording_replays_to_the_bit_and_records_to_the_same_bytes() {
    let (first, second) = (
        TemporaryFile::new("first.jsonl"),
        TemporaryFile::new("second.jsonl"),
    );
    let mut recorder = Recorder::create(&first.0, Box::new(simulated(200))).unwrap();
    let used = play(&mut recorder);
    assert_eq!(used.len(), 200);
    let options = || ReplayOptions::new(Headset::load("symmetric").unwrap(), Pose::IDENTITY);
    let replay = ReplaySession::open(&first.0, options()).unwrap();
    assert_eq!(
        replay.info().headset,
        "index",
        "the trace's headset, not the option's"
    );
    let mut recorder = Recorder::create(&second.0, Box::new(replay)).unwrap();
    let replayed = play(&mut recorder);
    let bits = |frame: &TraceFrame| {
        frame
            .views
            .views
            .map(|v| v.orientation.to_array().map(f64::to_bits))
    };
    assert_eq!(used, replayed);
    assert!(used.iter().map(bits).eq(replayed.iter().map(bits)));
    assert_eq!(first.text(), second.text());
    assert_eq!(first.text().lines().count(), 201);
}

#[test]
fn each_frame_is_on_disk_when_it_ends_and_empty_frames_leave_no_line() {
    let file = TemporaryFile::new("stream.jsonl");
    let mut recorder = Recorder::create(&file.0, Box::new(simulated(10))).unwrap();
    assert_eq!(
        file.text().lines().count(),
        1,
        "the header is there before the first frame"
    );
    for k in 0..4_u64 {
        let t_ns = recorder
            .wait_frame()
            .unwrap()
            .unwrap()
            .predicted_display_time_ns;
        recorder.begin_frame().unwrap();
        let views = recorder.locate_views(t_ns).unwrap();
        let rendered = if k == 2 { None } else { views.as_ref() };
        recorder
            .end_frame(FrameSubmission::new(t_ns, rendered))
            .unwrap();
        let lines = [1, 2, 3, 3, 4][k as usize + 1];
        assert_eq!(file.text().lines().count(), lines);
        assert!(file.text().ends_with('\n'));
    }
    // As after a kill: never closed, readable.
    std::mem::forget(recorder);
    assert_eq!(Trace::read(&file.0).unwrap().frames.len(), 3);
}

#[test]
fn the_views_that_were_used_are_recorded_not_those_located() {
    let file = TemporaryFile::new("used.jsonl");
    let mut recorder = Recorder::create(&file.0, Box::new(simulated(1))).unwrap();
    let (frame, mut views) = begin(&mut recorder).unwrap();
    views.views[0].position_in_world.x += 1.0;
    recorder
        .end_frame(FrameSubmission::new(
            frame.predicted_display_time_ns,
            Some(&views),
        ))
        .unwrap();
    assert_eq!(Trace::read(&file.0).unwrap().frames[0].views, views);
}

/// A frame at which the wearer switches reuse.
fn switched_at(t_ns: i64) -> String {
    let switched = frame_at(t_ns).replace("}}]", "}}],\"switch_reuse\":true");
    assert!(switched.contains("switch_reuse"));
    switched
}

/// What is recorded of a replay of these frames, each shown or not and with what is set.
fn recorded(name: &str, frames: &[String], told: &[(bool, Option<Quality>)]) -> Vec<TraceFrame> {
    let text = format!("{HEADER_2}\n{}\n", frames.join("\n"));
    let source = TemporaryFile::with(&format!("source-{name}.jsonl"), &text);
    let file = TemporaryFile::new(&format!("recorded-{name}.jsonl"));
    let options = ReplayOptions::new(Headset::load("symmetric").unwrap(), Pose::IDENTITY);
    let session = ReplaySession::open(&source.0, options).unwrap();
    let mut recorder = Recorder::create(&file.0, Box::new(session)).unwrap();
    for (is_seen, quality) in told {
        let (frame, views) = begin(&mut recorder).unwrap();
        let views = Some(&views).filter(|_| *is_seen);
        let submission = FrameSubmission::new(frame.predicted_display_time_ns, views);
        let submission = submission.with_quality(*quality);
        recorder.end_frame(submission).unwrap();
    }
    Trace::read(&file.0).unwrap().frames
}

/// What is set is written when it is another, and again when the wearer has switched reuse meanwhile.
#[test]
fn quality_is_written_where_it_changes() {
    let switched = switched_at(3);
    let frames = [frame_at(1), frame_at(2), switched, frame_at(4), frame_at(5)];
    let first = Some(Quality::of(&RenderSettings::default()));
    let second = first.map(|first| Quality {
        max_depth: 3,
        ..first
    });
    let told = [first, first, first, None, second].map(|quality| (true, quality));
    let lines = recorded("changes", &frames, &told);
    let written: Vec<_> = lines.iter().map(|line| line.quality).collect();
    assert_eq!(written, [first, None, first, None, second]);
}

#[test]
fn what_changes_in_frames_that_nobody_sees_shows_in_the_next_line() {
    let (one, two, three) = (frame_at(1), switched_at(2), frame_at(3));
    let frames = [one, two, three, switched_at(4), switched_at(5), frame_at(6)];
    let quality = Some(Quality::of(&RenderSettings::default()));
    let (none, unseen) = ((true, None), (false, None));
    let told = [none, unseen, none, (false, quality), none, none];
    let lines = recorded("hidden", &frames, &told);
    // The second switch in a row undoes the first.
    let switches: Vec<bool> = lines.iter().map(|line| line.switch_reuse).collect();
    assert_eq!(switches, [false, true, false, false]);
    let qualities: Vec<_> = lines.iter().map(|line| line.quality).collect();
    assert_eq!(qualities, [None, None, quality, None]);
}

#[test]
fn unwritable_recordings() {
    for path in [Path::new("/nowhere/at/all.jsonl"), &std::env::temp_dir()] {
        let error = Recorder::create(path, Box::new(simulated(1)))
            .err()
            .unwrap();
        assert!(error.is_unusable_input());
        let text = error.to_string();
        assert!(
            text.contains(&path.display().to_string()) && text.contains("--record"),
            "{text}"
        );
    }
}

#[test]
fn what_could_not_be_read_back_is_not_written() {
    let file = TemporaryFile::new("nan.jsonl");
    let mut recorder = Recorder::create(&file.0, Box::new(simulated(1))).unwrap();
    let (frame, mut views) = begin(&mut recorder).unwrap();
    views.views[1].position_in_world.x = f64::NAN;
    let error = recorder
        .end_frame(FrameSubmission::new(
            frame.predicted_display_time_ns,
            Some(&views),
        ))
        .unwrap_err();
    assert!(
        matches!(error, XrError::RecordWrite { frames: 0, .. }),
        "{error}"
    );
    assert!(!error.is_unusable_input());
    assert_eq!(file.text().lines().count(), 1);
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_reported() {
    let error = Recorder::create(Path::new("/dev/full"), Box::new(simulated(1)))
        .err()
        .unwrap();
    assert!(matches!(error, XrError::RecordCreate { .. }), "{error}");
}

prop_compose! {
    fn any_view()(
        x in -1e7..1e7_f64, y in -1e-7..1e-7_f64, z in prop::num::f64::NORMAL | prop::num::f64::ZERO | prop::num::f64::SUBNORMAL,
        q in [0.01..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64],
        left in -1.55..1.5_f64, width in 0.001..3.0_f64, down in -1.55..1.5_f64, height in 0.001..3.0_f64,
    ) -> View {
        View {
            position_in_world: DVec3::new(x, y, z),
            orientation: DQuat::from_array(q).normalize(),
            fov: Fov {
                angle_left: left,
                angle_right: (left + width).min(1.55),
                angle_up: (down + height).min(1.55),
                angle_down: down,
            },
        }
    }
}

fn any_pose() -> impl Strategy<Value = Pose> {
    any_view().prop_map(|view| Pose::new(view.position_in_world, view.orientation))
}

fn any_vector() -> impl Strategy<Value = DVec3> {
    [prop::num::f64::NORMAL | prop::num::f64::ZERO; 3].prop_map(DVec3::from_array)
}

prop_compose! {
    fn any_tracked()(pose in any_pose(), linear_velocity in any_vector(), angular_velocity in any_vector()) -> Tracked {
        Tracked { pose, linear_velocity, angular_velocity }
    }
}

fn any_buttons() -> impl Strategy<Value = Buttons> {
    any::<[bool; 6]>().prop_map(|held| {
        let all = Button::ALL.into_iter().zip(held);
        all.fold(Buttons::default(), |set, (button, is_in)| {
            set.with(button, is_in)
        })
    })
}

prop_compose! {
    fn any_hand()(
        grip in prop::option::of(any_tracked()), aim in prop::option::of(any_tracked()),
        pulls in [0.0..=1.0_f64, 0.0..=1.0_f64], stick in [-1.0..=1.0_f64, -1.0..=1.0_f64],
        pressed in any_buttons(), touched in any_buttons(),
        joints in prop::option::weighted(0.2, prop::collection::vec((any_pose(), 0.0..=1.0_f64), JOINTS)),
    ) -> Hand {
        let joint = |(pose, radius_m): (Pose, f64)| Joint { pose, radius_m };
        let joints = joints.map(|joints| joints.into_iter().map(joint).collect::<Vec<_>>());
        Hand {
            grip, aim, trigger: pulls[0], squeeze: pulls[1], stick: stick.into(), pressed, touched,
            joints: joints.map(|joints| joints.try_into().unwrap()),
        }
    }
}

fn any_action_value() -> impl Strategy<Value = ActionValue> {
    prop_oneof![
        any::<bool>().prop_map(ActionValue::Bool),
        (-1.0..=1.0_f64).prop_map(ActionValue::Float),
        [-1.0..=1.0_f64, -1.0..=1.0_f64].prop_map(|axes| ActionValue::Vec2(axes.into())),
        any_tracked().prop_map(|tracked| ActionValue::Pose(Some(tracked))),
    ]
}

prop_compose! {
    fn any_input()(
        hands in [prop::option::of(any_hand()), prop::option::of(any_hand())], gaze in prop::option::of(any_pose()),
        told in prop::collection::vec(("[a-z_.-]{1,5}", any_action_value()), 0..4),
    ) -> Input {
        let mut actions = ActionValues::default();
        for (name, value) in told {
            actions.set(&name, value);
        }
        Input { hands: hands.map(Option::unwrap_or_default), gaze, actions }
    }
}

prop_compose! {
    fn any_quality()(
        scale in 0.1_f32..=1.0, counts in [0..=67_108_864_u32, 1..=64, 1..=64, 1..=16, 0..=8],
        half_rate in any::<bool>(), reuse in any::<bool>(),
    ) -> Quality {
        let [photons_per_frame, photon_shares, max_depth, light_candidates, filter_passes] = counts;
        Quality {
            resolution_scale: scale, photons_per_frame, photon_shares, max_depth, light_candidates, half_rate,
            filter_passes, reuse,
        }
    }
}

#[test]
fn quality_is_checked_and_named_by_file_line_and_field() {
    let quality = r#""quality":{"resolution_scale":0.7,"photons_per_frame":9,"photon_shares":1,"max_depth":3,"light_candidates":2,"half_rate":false,"filter_passes":0,"reuse":true}"#;
    let line = |quality: &str| FRAME.replace("\"t_ns\":0", &format!("\"t_ns\":0,{quality}"));
    let text = |quality: &str| format!("{HEADER_2}\n{}\n", line(quality));
    let back = read(&text(quality)).unwrap().frames[0].quality.unwrap();
    assert_eq!(
        (back.resolution_scale, back.max_depth, back.reuse),
        (0.7, 3, true)
    );
    for [from, to, field] in cases(
        r#"
        0.7 | 0.05 | quality.resolution_scale
        0.7 | true | quality.resolution_scale
        "photons_per_frame":9 | "photons_per_frame":-1 | quality.photons_per_frame
        "photon_shares":1 | "photon_shares":0 | quality.photon_shares
        "max_depth":3 | "max_depth":3.5 | quality.max_depth
        "light_candidates":2 | "light_candidates":17 | quality.light_candidates
        ,"reuse":true | - | quality.reuse
        "reuse" | "rense" | quality.rense
        "#,
    ) {
        assert!(quality.contains(from), "{from}");
        let refused = read(&text(&quality.replace(from, to))).unwrap_err();
        assert_eq!(
            (refused.line, refused.field.as_deref()),
            (Some(2), Some(field)),
            "{refused}"
        );
    }
}

#[test]
fn a_file_states_the_lowest_version_that_can_hold_it() {
    let views = read(&format!("{HEADER}\n{FRAME}\n")).unwrap().frames[0].views;
    let plain = |switch_reuse, input| plain(0, views, switch_reuse, input);
    let gaze = Input {
        gaze: Some(Pose::IDENTITY),
        ..Input::default()
    };
    assert_eq!(plain(false, Input::default()).version(), 1);
    assert_eq!(plain(true, Input::default()).version(), 2);
    assert_eq!(plain(false, gaze.clone()).version(), 2);
    let changed = TraceFrame {
        quality: Some(Quality::of(&RenderSettings::default())),
        ..plain(false, Input::default())
    };
    assert_eq!(changed.version(), 2);
    let line = frame_line(&changed).unwrap();
    let refused = read(&format!("{HEADER}\n{line}")).unwrap_err();
    assert_eq!(refused.field.as_deref(), Some("quality"), "{refused}");
    // A reader of version 1 knows no input, and one of version 2 both.
    let line = frame_line(&plain(false, gaze)).unwrap();
    let refused = read(&format!("{HEADER}\n{line}")).unwrap_err();
    assert_eq!(refused.field.as_deref(), Some("input"), "{refused}");
    assert!(read(&format!("{HEADER_2}\n{line}")).is_ok());
    assert!(read(&format!("{HEADER_2}\n{FRAME}\n")).is_ok());
}

#[test]
fn malformed_input_is_named_by_file_line_and_field() {
    for [input, field] in cases(
        r#"
        3 | input
        {"middle":{}} | input.middle
        {"left":{"trigger":1.5}} | input.left.trigger
        {"left":{"squeeze":"a"}} | input.left.squeeze
        {"right":{"stick":[0,-2]}} | input.right.stick[1]
        {"right":{"stick":[0]}} | input.right.stick
        {"right":{"pressed":["trigga"]}} | input.right.pressed
        {"right":{"pressed":[1]}} | input.right.pressed
        {"right":{"joints":[]}} | input.right.joints
        {"left":{"grip":{"position":[0,0,0],"orientation":[0,0,0,2]}}} | input.left.grip.orientation
        {"actions":3} | input.actions
        {"actions":{"take":"yes"}} | input.actions.take
        {"actions":{"take":[1]}} | input.actions.take
        {"actions":{"take":2}} | input.actions.take
        {"actions":{"take":[0,-2]}} | input.actions.take
        {"actions":{"take":[0,"a"]}} | input.actions.take[1]
        {"actions":{"take":{"position":[0,0,0]}}} | input.actions.take.orientation
        {"gaze":{"position":[0,0,0]}} | input.gaze.orientation
        "#,
    ) {
        let frame = FRAME.replacen('{', &format!("{{\"input\":{input},"), 1);
        let error = read(&format!("{HEADER_2}\n{frame}\n")).unwrap_err();
        assert_eq!(error.line, Some(2), "{error}");
        assert_eq!(error.to_string().lines().count(), 1, "{error}");
        assert_eq!(error.field.unwrap_or_default(), field);
    }
}

/// A simulated headset whose runtime knows a controller of each hand in turn, from the third frame on.
struct WithModels {
    inner: SimulatedSession,
    waited: u64,
}

fn model(side: Side) -> ControllerModel {
    let glb = format!("the {} one", side.word()).into_bytes();
    ControllerModel { side, glb }
}

impl XrSession for WithModels {
    fn info(&self) -> &SessionInfo {
        self.inner.info()
    }
    fn wait_frame(&mut self) -> Result<Option<FrameState>, XrError> {
        self.waited += 1;
        self.inner.wait_frame()
    }
    fn begin_frame(&mut self) -> Result<(), XrError> {
        self.inner.begin_frame()
    }
    fn locate_views(&mut self, time_ns: i64) -> Result<Option<LocatedViews>, XrError> {
        self.inner.locate_views(time_ns)
    }
    fn controller_model(&mut self) -> Result<Option<ControllerModel>, XrError> {
        Ok(match self.waited {
            3 => Some(model(Side::Right)),
            4 => Some(model(Side::Left)),
            _ => None,
        })
    }
    fn acquire_targets(&mut self) -> Result<RenderTargets, XrError> {
        self.inner.acquire_targets()
    }
    fn end_frame(&mut self, submission: FrameSubmission<'_>) -> Result<(), XrError> {
        self.inner.end_frame(submission)
    }
}

/// What a session gives in each frame.
fn models(session: &mut dyn XrSession) -> Vec<Option<ControllerModel>> {
    let mut models = Vec::new();
    while let Some(frame) = session.wait_frame().unwrap() {
        let t_ns = frame.predicted_display_time_ns;
        session.begin_frame().unwrap();
        let views = session.locate_views(t_ns).unwrap();
        models.push(session.controller_model().unwrap());
        let submission = FrameSubmission::new(t_ns, views.as_ref());
        session.end_frame(submission).unwrap();
    }
    models
}

#[test]
fn controllers_models_are_recorded_beside_the_trace_and_replayed() {
    let folder = crate::folders::Folder::new("trace-models");
    let (first, second) = (folder.join("a.jsonl"), folder.join("b.jsonl"));
    let options = || ReplayOptions::new(Headset::load("quest3").unwrap(), Pose::IDENTITY);
    let live = WithModels {
        inner: simulated(6),
        waited: 0,
    };
    let recorded = models(&mut Recorder::create(&first, Box::new(live)).unwrap());
    let expected = [Side::Right, Side::Left].map(|side| Some(model(side)));
    assert_eq!(recorded[2..4], expected);
    assert_eq!(recorded.iter().flatten().count(), 2);
    let read = Trace::read(&first).unwrap();
    let name = |name: &str| Some(name.to_owned());
    assert_eq!(read.frames[2].controller_model, [None, name("a.right.glb")]);
    assert_eq!(read.frames[3].controller_model, [name("a.left.glb"), None]);
    assert_eq!(read.model_lines, [4, 5]);
    // A replay is recorded likewise.
    let replay = ReplaySession::open(&first, options()).unwrap();
    assert_eq!(
        models(&mut Recorder::create(&second, Box::new(replay)).unwrap()),
        recorded
    );
    let again = Trace::read(&second).unwrap();
    assert_eq!(
        again.frames[2].controller_model,
        [None, name("b.right.glb")]
    );
    for name in ["a.right.glb", "b.right.glb"] {
        assert_eq!(std::fs::read(folder.join(name)).unwrap(), b"the right one");
    }
    // Gone, or a folder: the first is named with its line.
    std::fs::remove_file(folder.join("a.left.glb")).unwrap();
    let refused = ReplaySession::open(&first, options()).unwrap_err();
    assert!(refused.is_unusable_input());
    let says = refused.to_string();
    let place = ", line 5, field controller_model.left: 'a.left.glb' cannot be read: ";
    assert!(says.contains(&format!("a.jsonl{place}")), "{says}");
    std::fs::create_dir(folder.join("a.left.glb")).unwrap();
    assert!(ReplaySession::open(&first, options()).is_err());
}

#[test]
fn a_model_s_file_lies_beside_the_trace() {
    let with = |header: &str, models: &str| {
        let key = format!("{{\"controller_model\":{models},");
        read(&format!("{header}\n{}\n", FRAME.replacen('{', &key, 1)))
    };
    assert!(with(HEADER_2, r#"{"left":"a b.glb","right":"..glb"}"#).is_ok());
    for (models, field) in [
        ("3", ""),
        (r#"{"middle":"a.glb"}"#, ".middle"),
        (r#"{"left":7}"#, ".left"),
        (r#"{"left":""}"#, ".left"),
        (r#"{"left":"."}"#, ".left"),
        (r#"{"right":".."}"#, ".right"),
        (r#"{"right":"a/b.glb"}"#, ".right"),
        (r#"{"right":"a.glb/"}"#, ".right"),
        (r#"{"right":"/a.glb"}"#, ".right"),
        (r#"{"right":"..\\a.glb"}"#, ".right"),
        (r#"{"right":"C:a.glb"}"#, ".right"),
    ] {
        let error = with(HEADER_2, models).unwrap_err();
        let expected = format!("controller_model{field}");
        assert_eq!((error.line, error.field), (Some(2), Some(expected)));
    }
    let early = with(HEADER, r#"{"left":"a.glb"}"#).unwrap_err();
    assert_eq!(early.field.as_deref(), Some("controller_model"));
}

#[test]
fn what_simulated_hands_do_is_recorded_and_replayed() {
    let script = "joints = true\n[[left]]\nat_s = 0.01\nposition_m = [1, 2, 3]\n[[left]]\nat_s = 0.03\npress = ['menu']\n\
                  point_at = 'a'\n[[right]]\nat_s = 0.02\nstick = [0.5, -1]\nwave = true\n";
    let place_of = |_: &str| Ok(DVec3::new(0.3, 0.2, 0.1));
    let hands = HandScript::parse("hands.toml", script, &Pose::IDENTITY, &place_of).unwrap();
    let file = TemporaryFile::new("hands.jsonl");
    let recorded =
        play(&mut Recorder::create(&file.0, Box::new(simulated(5).with_hands(hands))).unwrap());
    assert!(recorded[4].input.hand(Side::Left).pressed.has(Button::Menu));
    assert_eq!(recorded[4].input.hand(Side::Right).stick.y, -1.0);
    let hands = &recorded[4].input.hands;
    for Hand { grip, joints, .. } in hands {
        let palm = joints.as_ref().unwrap()[0].pose.position;
        assert_eq!(palm, grip.unwrap().pose.position);
    }
    assert!(
        file.text()
            .starts_with("{\"format\":\"stereolux-trace\",\"version\":2,")
    );
    let options = ReplayOptions::new(Headset::load("index").unwrap(), Pose::IDENTITY);
    let mut replay = ReplaySession::open(&file.0, options).unwrap();
    assert_eq!(play(&mut replay), recorded);
    // Without hands it is a file of version 1.
    play(&mut Recorder::create(&file.0, Box::new(simulated(5))).unwrap());
    assert!(
        file.text()
            .starts_with(HEADER.split("\"headset").next().unwrap())
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, rng_seed: RngSeed::Fixed(1),
        failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_views_survive_the_file_to_the_bit(
        views in prop::collection::vec([any_view(), any_view()], 1..5),
        step_ns in 1..i64::MAX / 8,
        headset in "\\PC{0,12}",
        refresh_hz in 1.0..1000.0_f64,
        triangles in prop::collection::vec(any::<[[i16; 2]; 3]>(), 0..4),
        inputs in prop::collection::vec(any_input(), 1..4),
        qualities in prop::collection::vec(prop::option::of(any_quality()), 1..4),
        located in [any_view(), any_view()],
    ) {
        let hidden = (!triangles.is_empty()).then(|| {
            let eye = |scale: f64| HiddenArea::from_triangles(
                triangles.iter().map(|t| t.map(|corner| corner.map(|c| f64::from(c) * scale))).collect(),
            );
            [eye(1e-4), eye(0.3e-4)]
        });
        let changed = hidden.clone();
        let frames = views.into_iter().enumerate().map(|(k, views)| TraceFrame {
            t_ns: k as i64 * step_ns,
            views: LocatedViews::valid(views),
            located: (k % 4 == 2).then_some(located),
            switch_reuse: k % 3 == 1,
            refresh_hz: (k % 5 == 3).then_some(72.5),
            hidden: changed.clone().filter(|_| k % 5 == 4),
            quality: qualities[k % qualities.len()],
            controller_model: [None, (k % 7 == 5).then(|| "a.right.glb".to_owned())],
            input: inputs[k % inputs.len()].clone(),
        });
        let frames: Vec<TraceFrame> = frames.collect();
        let model_lines = (0..frames.len()).filter(|k| k % 7 == 5).map(|k| k + 2).collect();
        let header = TraceHeader { headset, refresh_hz, hidden };
        let trace = Trace { header, frames, model_lines, warnings: vec![] };
        let text = write(&trace);
        let back = read(&text).unwrap();
        prop_assert_eq!(&back, &trace);
        prop_assert_eq!(write(&back), text);
    }

    #[test]
    fn damage_never_panics(
        cuts in prop::collection::vec((0..900_usize, "[ -~\n]{0,3}"), 1..6),
    ) {
        let mut text = format!("{HEADER}\n{FRAME}\n{}\n", frame_at(7));
        for (at, with) in cuts {
            let at = at.min(text.len() - 1);
            text.replace_range(at..=at, &with);
            if text.is_empty() { break; }
        }
        if let Err(error) = read(&text) {
            prop_assert!(error.to_string().starts_with("t.jsonl"));
            prop_assert!(!error.to_string().contains('\n'));
        }
    }

    #[test]
    fn any_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = Trace::from_reader("t.jsonl", bytes.as_slice());
    }
}
