//! TUM and EuRoC head motion: formats, frames, recentring, interpolation.

#![allow(clippy::unwrap_used)]

use glam::{DMat3, DQuat, DVec3, EulerRot};
use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, FRAC_PI_4};
use stereolux_xr::trajectory::{HeadMotion, RecordedTrajectory, TrajectoryFormat};
use stereolux_xr::{InputError, Pose, TraceBody, TraceUp};

fn read(text: &str) -> Result<RecordedTrajectory, InputError> {
    RecordedTrajectory::from_reader("head.txt", text.as_bytes())
}

/// One TUM row at the origin with the rotation whose columns are the body's axes in the world.
fn tum_with_axes(x: DVec3, y: DVec3, z: DVec3) -> RecordedTrajectory {
    let q = DQuat::from_mat3(&DMat3::from_cols(x, y, z));
    read(&format!("0 1 2 3 {} {} {} {}\n", q.x, q.y, q.z, q.w)).unwrap()
}

fn only(motion: HeadMotion) -> Pose {
    motion.poses()[0].pose
}

fn forward(pose: Pose) -> DVec3 {
    pose.orientation * DVec3::NEG_Z
}

fn up(pose: Pose) -> DVec3 {
    pose.orientation * DVec3::Y
}

/// Rounding of quaternion products of unit vectors: a few 1e-16.
fn same(a: DVec3, b: DVec3) -> bool {
    a.distance(b) < 1e-14
}

#[test]
fn formats_are_told_apart_by_content() {
    let tum = "# timestamp tx ty tz qx qy qz qw\n10.5 1 2 3 0 0 0 1\n10.6 1 2 3 0 0 0 1\n";
    let recorded = read(tum).unwrap();
    assert_eq!(recorded.format, TrajectoryFormat::Tum);
    assert_eq!(recorded.poses[1].t_ns, 100_000_000);
    assert_eq!(
        recorded.poses[0].pose,
        Pose::new(DVec3::new(1.0, 2.0, 3.0), DQuat::IDENTITY)
    );
    let euroc = "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], v_RS_R_x [m s^-1]\n\
        1403636580838555648,4.688319,-1.786938,0.783338,0.534108,-0.153029,-0.827383,-0.082152,-0.027876\n\
        1403636580843555328,4.688177,-1.786770,0.787350,0.534640,-0.152990,-0.826976,-0.082863,-0.030043\n";
    let recorded = read(euroc).unwrap();
    assert_eq!(recorded.format, TrajectoryFormat::Euroc);
    assert_eq!(recorded.poses[1].t_ns, 4_999_680);
    let q = recorded.poses[0].pose.orientation;
    assert!(
        (q.w - 0.534_108).abs() < 1e-6 && (q.z + 0.082_152).abs() < 1e-6,
        "w comes first: {q}"
    );
    for (name, variant) in [
        ("windows", format!("\u{feff}{}", tum.replace('\n', "\r\n"))),
        ("tabs", tum.replace(' ', "\t")),
        ("no last line end", tum.trim_end().to_owned()),
        ("comment in between", tum.replace("10.6", "# pause\n\n10.6")),
    ] {
        assert_eq!(read(&variant).unwrap(), read(tum).unwrap(), "{name}");
    }
    let bare_header = euroc.replacen('#', "", 1);
    assert_eq!(read(&bare_header).unwrap(), read(euroc).unwrap());
}

#[test]
fn an_optical_camera_in_a_z_up_world() {
    // Looks along the recording's +y: right is +x, down is -z. In this program's world: straight ahead.
    let recorded = tum_with_axes(DVec3::X, DVec3::NEG_Z, DVec3::Y);
    let head = only(recorded.to_head_motion(TraceUp::Z, TraceBody::Optical));
    assert!(same(forward(head), DVec3::NEG_Z) && same(up(head), DVec3::Y));
    assert_eq!(head.position, DVec3::new(1.0, 3.0, -2.0));
    // Looks along +x: right is -y.
    let recorded = tum_with_axes(DVec3::NEG_Y, DVec3::NEG_Z, DVec3::X);
    let head = only(recorded.to_head_motion(TraceUp::Z, TraceBody::Optical));
    assert!(same(forward(head), DVec3::X) && same(up(head), DVec3::Y));
    // Looks straight down, top of the image towards +y.
    let recorded = tum_with_axes(DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z);
    let head = only(recorded.to_head_motion(TraceUp::Z, TraceBody::Optical));
    assert!(same(forward(head), DVec3::NEG_Y) && same(up(head), DVec3::NEG_Z));
    // The controls: the wrong body or the wrong up axis turns the picture.
    let wrong = only(recorded.to_head_motion(TraceUp::Z, TraceBody::OpenXr));
    assert!(!same(forward(wrong), DVec3::NEG_Y));
    let wrong = only(recorded.to_head_motion(TraceUp::Y, TraceBody::Optical));
    assert!(!same(forward(wrong), DVec3::NEG_Y));
}

#[test]
fn a_y_up_openxr_recording_stays_as_it_is() {
    let recorded = read("0 1 2 3 0 0.6 0 0.8\n").unwrap();
    let head = only(recorded.to_head_motion(TraceUp::Y, TraceBody::OpenXr));
    assert_eq!(head.position, DVec3::new(1.0, 2.0, 3.0));
    assert!(
        head.orientation
            .angle_between(DQuat::from_xyzw(0.0, 0.6, 0.0, 0.8))
            < 1e-7
    );
}

#[test]
fn a_quaternion_gives_eye_from_body() {
    // A body with x forward, y left, z up (a robot's): its x axis is the eye's -z, y is -x, z is y.
    let eye_from_body = DMat3::from_cols(DVec3::NEG_Z, DVec3::NEG_X, DVec3::Y);
    let q = DQuat::from_mat3(&eye_from_body);
    let body = TraceBody::Quaternion(q);
    // The robot drives along the recording's +y, upright: x = +y, y = -x, z = +z.
    let recorded = tum_with_axes(DVec3::Y, DVec3::NEG_X, DVec3::Z);
    let head = only(recorded.to_head_motion(TraceUp::Z, body));
    assert!(same(forward(head), DVec3::NEG_Z) && same(up(head), DVec3::Y));
    // The control: the inverse is another body.
    let inverse = TraceBody::Quaternion(q.conjugate());
    assert!(!same(
        forward(only(recorded.to_head_motion(TraceUp::Z, inverse))),
        DVec3::NEG_Z
    ));
    // optical is a quaternion too: half a turn about x.
    let optical = TraceBody::Quaternion(DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0));
    let by_name = recorded.to_head_motion(TraceUp::Z, TraceBody::Optical);
    assert!(same(
        forward(only(by_name)),
        forward(only(recorded.to_head_motion(TraceUp::Z, optical)))
    ));
}

#[test]
fn the_euroc_default_is_its_inertial_unit() {
    assert_eq!(TrajectoryFormat::Tum.default_body(), TraceBody::Optical);
    // Vehicle level, looking along +x: body x is up (+z), body z is forward (+x), body y is right (-y).
    let recorded = tum_with_axes(DVec3::Z, DVec3::NEG_Y, DVec3::X);
    let body = TrajectoryFormat::Euroc.default_body();
    let head = only(recorded.to_head_motion(TraceUp::Z, body));
    assert!(same(forward(head), DVec3::X) && same(up(head), DVec3::Y));
    // Against the data set's own camera: body from cam0 (T_BS of sensor.yaml, rotation part).
    let body_from_camera = DMat3::from_cols(
        DVec3::new(0.014_865_542_981_8, 0.999_557_249_008, -0.025_774_436_697_4),
        DVec3::new(
            -0.999_880_929_698,
            0.014_967_213_324_7,
            0.003_756_188_357_97,
        ),
        DVec3::new(0.004_140_296_794_22, 0.025_715_529_948, 0.999_660_727_178),
    );
    let eye_from_body = body.body_from_eye().conjugate();
    let camera_forward_in_eye = eye_from_body * body_from_camera.z_axis;
    let camera_down_in_eye = eye_from_body * body_from_camera.y_axis;
    let degrees = |a: DVec3, b: DVec3| a.angle_between(b).to_degrees();
    assert!(degrees(camera_forward_in_eye, DVec3::NEG_Z) < 1.8);
    assert!(degrees(camera_down_in_eye, DVec3::NEG_Y) < 1.8);
}

/// Rows of a y-up, OpenXR-axes recording.
fn motion(poses: &[(i64, Pose)]) -> HeadMotion {
    let rows: String = poses
        .iter()
        .map(|(t_ns, pose)| {
            let (p, q) = (pose.position, pose.orientation);
            format!(
                "{}.{:09} {} {} {} {} {} {} {}\n",
                t_ns / 1_000_000_000,
                t_ns % 1_000_000_000,
                p.x,
                p.y,
                p.z,
                q.x,
                q.y,
                q.z,
                q.w
            )
        })
        .collect();
    read(&rows)
        .unwrap()
        .to_head_motion(TraceUp::Y, TraceBody::OpenXr)
}

fn pose(x: f64, y: f64, z: f64, yaw: f64, pitch: f64, roll: f64) -> Pose {
    Pose::new(
        DVec3::new(x, y, z),
        DQuat::from_euler(EulerRot::YXZ, yaw, pitch, roll),
    )
}

#[test]
fn recentring_moves_and_turns_about_the_vertical_only() {
    let start = pose(5.0, 1.6, -2.0, 2.0, -0.4, 0.0);
    let recorded = [
        (0, pose(100.0, 0.5, 7.0, -1.0, 0.3, 0.2)),
        (1_000_000_000, pose(101.0, 0.7, 7.0, -0.5, -0.1, 0.0)),
    ];
    let recentered = motion(&recorded).recentered(&start);
    let [first, second] = [0, 1].map(|i| recentered.poses()[i].pose);
    assert_eq!(first.position, start.position);
    assert!((first.heading_rad() - start.heading_rad()).abs() < 1e-12);
    // Pitch and roll as recorded: heights of the head's axes are untouched.
    for (moved, (_, original)) in [first, second].iter().zip(recorded) {
        assert!((forward(*moved).y - forward(original).y).abs() < 1e-14);
        assert!((up(*moved).y - up(original).y).abs() < 1e-14);
    }
    assert!(
        (forward(first).y - forward(start).y).abs() > 0.1,
        "the start's pitch is not taken over"
    );
    // The way between the poses is turned by 3 radians (from heading -1 to 2) and kept in length.
    let way = DQuat::from_rotation_y(3.0) * DVec3::new(1.0, 0.2, 0.0);
    assert!((second.position - first.position).distance(way) < 1e-12);
    assert!((second.heading_rad() - 2.5).abs() < 1e-12);
    // Without recentring nothing moves.
    assert_eq!(
        motion(&recorded).poses()[0].pose.position,
        DVec3::new(100.0, 0.5, 7.0)
    );
}

#[test]
fn recentring_a_recording_that_starts_looking_down() {
    let start = pose(0.0, 0.0, 0.0, 1.0, 0.0, 0.0);
    let recorded = [
        (0, pose(3.0, 3.0, 3.0, 0.2, -FRAC_PI_2, 0.0)),
        (1, pose(3.0, 3.0, 3.0, 0.2, 0.0, 0.0)),
    ];
    let recentered = motion(&recorded).recentered(&start);
    assert!(
        same(forward(recentered.poses()[0].pose), DVec3::NEG_Y),
        "still looks down"
    );
    assert!((recentered.poses()[1].pose.heading_rad() - 1.0).abs() < 1e-12);
}

#[test]
fn poses_between_rows_are_interpolated() {
    let motion = motion(&[
        (0, pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)),
        (1_000_000_000, pose(4.0, 0.0, 2.0, FRAC_PI_2, 0.0, 0.0)),
        (1_500_000_000, pose(4.0, 1.0, 2.0, FRAC_PI_2, 0.0, 0.0)),
    ]);
    let half = motion.pose_at(500_000_000);
    assert!(same(half.position, DVec3::new(2.0, 0.0, 1.0)));
    assert!((half.heading_rad() - FRAC_PI_4).abs() < 1e-14);
    let fifth = motion.pose_at(200_000_000);
    assert!(
        (fifth.heading_rad() - 0.2 * FRAC_PI_2).abs() < 1e-14,
        "even turning, not a chord"
    );
    assert!(same(
        motion.pose_at(1_250_000_000).position,
        DVec3::new(4.0, 0.5, 2.0)
    ));
    // At and outside of the rows: the rows.
    for (t_ns, index) in [
        (0, 0),
        (1_000_000_000, 1),
        (1_500_000_000, 2),
        (-5, 0),
        (i64::MAX, 2),
    ] {
        assert_eq!(motion.pose_at(t_ns), motion.poses()[index].pose, "{t_ns}");
    }
    assert_eq!(motion.duration_ns(), 1_500_000_000);
}

#[test]
fn interpolation_takes_the_short_way() {
    // The second quaternion is written with the opposite sign: the same rotation.
    let (s, c) = ((0.1_f64).sin(), (0.1_f64).cos());
    let text = format!("0 0 0 0 0 0 0 1\n1 0 0 0 0 {} 0 {}\n", -s, -c);
    let motion = read(&text)
        .unwrap()
        .to_head_motion(TraceUp::Y, TraceBody::OpenXr);
    assert!((motion.pose_at(500_000_000).heading_rad() - 0.1).abs() < 1e-14);
}

#[test]
fn faults_name_line_and_field() {
    let tum = |row: &str| {
        let error = read(&format!("# c\n1 0 0 0 0 0 0 1\n{row}\n")).unwrap_err();
        assert_eq!(error.line, Some(3), "{error}");
        assert!(!error.to_string().contains('\n'), "{error}");
        error.field.unwrap_or_default()
    };
    assert_eq!(tum("2 0 0 0 0 0 0"), "");
    assert_eq!(tum("2 0 0 0 0 0 0 1 9"), "");
    assert_eq!(tum("x 0 0 0 0 0 0 1"), "timestamp");
    assert_eq!(tum("nan 0 0 0 0 0 0 1"), "timestamp");
    assert_eq!(tum("1 0 0 0 0 0 0 1"), "timestamp", "a repeated time");
    assert_eq!(
        tum("0.5 0 0 0 0 0 0 1"),
        "timestamp",
        "a time that runs back"
    );
    assert_eq!(tum("2 0 inf 0 0 0 0 1"), "ty");
    assert_eq!(tum("2 0 0 NaN 0 0 0 1"), "tz");
    assert_eq!(tum("2 0 0 0 0 0 - 1"), "qz");
    assert_eq!(tum("2 0 0 0 0 0 0 0.99"), "qx..qw");
    assert_eq!(tum("2 0 0 0 0 0 0 0"), "qx..qw");
    let euroc = |row: &str| {
        let error = read(&format!("#timestamp,p\n1,0,0,0,1,0,0,0\n{row}\n")).unwrap_err();
        assert_eq!(error.line, Some(3), "{error}");
        error.field.unwrap_or_default()
    };
    assert_eq!(euroc("2,0,0,0,1,0,0"), "");
    assert_eq!(euroc("2.5,0,0,0,1,0,0,0"), "timestamp");
    assert_eq!(euroc("1,0,0,0,1,0,0,0"), "timestamp");
    assert_eq!(euroc("2,0,,0,1,0,0,0"), "p_y");
    assert_eq!(euroc("2,0,0,0,0,0,0,q"), "q_z");
    assert_eq!(euroc("2,0,0,0,0.5,0,0,0"), "q_w..q_z");
    let jump = read("-9000000000 0 0 0 0 0 0 1\n9000000000 0 0 0 0 0 0 1\n").unwrap_err();
    assert_eq!(
        (jump.line, jump.field.as_deref()),
        (Some(2), Some("timestamp"))
    );
}

#[test]
fn quaternions_are_normalised_within_a_thousandth() {
    let recorded = read("0 0 0 0 0 0 0 1.0009\n").unwrap();
    assert_eq!(recorded.poses[0].pose.orientation.length(), 1.0);
    assert!(read("0 0 0 0 0 0 0 1.0011\n").is_err());
    // Four digits, as the TUM benchmark writes them.
    let q = read("0 0 0 0 0.6132 0.5962 -0.3311 -0.3986\n")
        .unwrap()
        .poses[0]
        .pose
        .orientation;
    assert!((q.length() - 1.0).abs() < 1e-15);
    assert!(
        (q.x - 0.6132).abs() < 1e-3 && (q.w * FRAC_1_SQRT_2 + 0.3986 * FRAC_1_SQRT_2).abs() < 1e-3
    );
}

#[test]
fn files_that_are_no_trajectory() {
    for text in [
        "",
        "\n",
        "# only a comment\n",
        "\u{feff}#\r\n",
        "timestamp,p_x\n",
    ] {
        assert!(
            read(text)
                .unwrap_err()
                .to_string()
                .contains("holds no pose"),
            "{text:?}"
        );
    }
    for text in ["hello world\n", "<xml/>\n", "a,b,c\n", "[1,2]\n"] {
        let error = read(text).unwrap_err();
        assert_eq!(error.line, Some(1));
        assert!(
            error.to_string().contains("TUM") && error.to_string().contains("EuRoC"),
            "{error}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, rng_seed: RngSeed::Fixed(1),
        failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_text_never_panics(text in "[-+0-9a-z.,# {}\\n\\r]{0,200}") {
        if let Err(error) = read(&text) {
            prop_assert!(error.to_string().starts_with("head.txt"));
        }
    }

    #[test]
    fn recentring_keeps_gravity_and_relative_motion(
        start in [-3.0..3.0_f64, -1.4..1.4_f64, -3.0..3.0_f64],
        first in [-3.0..3.0_f64, -1.4..1.4_f64, -3.0..3.0_f64],
        later in [-3.0..3.0_f64, -1.4..1.4_f64, -3.0..3.0_f64],
    ) {
        let turned = |a: [f64; 3], x: f64| pose(x, 2.0 * x, -x, a[0], a[1], a[2]);
        let (start, a, b) = (turned(start, 9.0), turned(first, -4.0), turned(later, 1.0));
        let motion = motion(&[(0, a), (10, b)]).recentered(&start);
        let [c, d] = [0, 1].map(|i| motion.poses()[i].pose);
        let turn = DQuat::from_rotation_y(start.heading_rad() - a.heading_rad());
        prop_assert_eq!(c.position, start.position);
        // cos(1.4) = 0.17: headings are good to some 1e-15 / 0.17.
        let off = (c.heading_rad() - start.heading_rad()).rem_euclid(std::f64::consts::TAU);
        prop_assert!(off.min(std::f64::consts::TAU - off) < 1e-13);
        for (before, after) in [(a, c), (b, d)] {
            prop_assert!((forward(before).y - forward(after).y).abs() < 1e-14);
            prop_assert!((up(before).y - up(after).y).abs() < 1e-14);
            prop_assert!((turn * forward(before)).distance(forward(after)) < 1e-14);
        }
        prop_assert!(((b.position - a.position).length() - (d.position - c.position).length()).abs() < 1e-13);
    }
}
