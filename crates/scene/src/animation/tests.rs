//! Sampling against closed forms.

use super::*;
use crate::Node;

fn track(interpolation: Interpolation, times_s: &[f64], width: usize, values: &[f64]) -> Track {
    Track {
        times_s: times_s.to_vec(),
        values: values.to_vec(),
        width,
        interpolation,
    }
}

#[test]
fn lines_steps_and_ends() {
    let times = [1.0, 2.0, 4.0];
    let values = [1.0, 10.0, 3.0, 20.0, -1.0, 40.0];
    let line = track(Interpolation::Linear, &times, 2, &values);
    assert_eq!(line.sample(1.5), [2.0, 15.0]);
    assert_eq!(line.sample(3.5), [0.0, 35.0]);
    let step = track(Interpolation::Step, &times, 2, &values);
    assert_eq!(step.sample(1.999), [1.0, 10.0]);
    assert_eq!(step.sample(2.0), [3.0, 20.0]);
    for clamped in [&line, &step] {
        assert_eq!(clamped.sample(-3.0), [1.0, 10.0]);
        assert_eq!(clamped.sample(9.0), [-1.0, 40.0]);
    }
    let lone = track(Interpolation::Linear, &[2.0], 1, &[7.0]);
    assert_eq!(
        [lone.sample(0.0), lone.sample(2.0), lone.sample(5.0)],
        [[7.0]; 3]
    );
}

#[test]
fn splines_reproduce_every_cubic() {
    // A Hermite spline with true tangents is the cubic itself; 2 s between the keys shows that tangents are per second.
    let value = |t: f64| 2.0 - t + 0.5 * t * t - 0.25 * t * t * t;
    let slope = |t: f64| -1.0 + t - 0.75 * t * t;
    let keys = [1.0, 3.0];
    let values: Vec<f64> = keys
        .iter()
        .flat_map(|t| [slope(*t), value(*t), slope(*t)])
        .collect();
    let spline = track(Interpolation::CubicSpline, &keys, 1, &values);
    for step in 0..=20 {
        let t = 1.0 + 0.1 * f64::from(step);
        // Sums of terms up to 8: a few 1e-15.
        assert!((spline.sample(t)[0] - value(t)).abs() < 1e-14, "{t}");
    }
    // In-tangents of the first and out-tangents of the last key are of no account.
    let mut other = spline.clone();
    other.values[0] = 99.0;
    other.values[5] = 99.0;
    assert_eq!(other.sample(1.7), spline.sample(1.7));
    other.values[2] += 1.0;
    assert_ne!(other.sample(1.7), spline.sample(1.7));
    assert_eq!(spline.sample(0.0), [value(1.0)]);
}

#[test]
fn rotations_turn_evenly_the_shorter_way() {
    let to = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -2.0) / 3.0, 2.0);
    // The negative quaternion is the same rotation, and must not send it the long way round.
    for sign in [1.0, -1.0] {
        let values: Vec<f64> = [DQuat::IDENTITY, to * sign]
            .iter()
            .flat_map(|q| q.to_array())
            .collect();
        let turning = track(Interpolation::Linear, &[0.0, 1.0], 4, &values);
        for step in 0..=10 {
            let share = 0.1 * f64::from(step);
            let expected = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -2.0) / 3.0, 2.0 * share);
            let got = turning.rotation(share);
            assert!(
                1.0 - got.dot(expected).abs() < 1e-14,
                "{share}: {got} {expected}"
            );
        }
    }
    // Negative control: a straight line through the quaternions does not turn evenly.
    let line = (DQuat::IDENTITY * 0.75 + to * 0.25).normalize();
    let even = DQuat::from_axis_angle(DVec3::new(1.0, 2.0, -2.0) / 3.0, 0.5);
    assert!(1.0 - line.dot(even).abs() > 1e-4);
}

fn scene() -> Scene {
    let node = |parent, children: &[usize], at: DVec3| Node {
        parent,
        children: children.to_vec(),
        parent_from_node: DAffine3::from_translation(at),
        ..Node::default()
    };
    let slide = track(
        Interpolation::Linear,
        &[0.0, 2.0],
        3,
        &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0],
    );
    let clip = |name: &str, number: usize, track: Track| Animation {
        name: name.to_owned(),
        number,
        length_s: 2.0,
        nodes: vec![NodeTracks {
            node: 0,
            translation: Some(track),
            rotation: None,
            scale: None,
            weights: None,
        }],
    };
    Scene {
        name: "slides".to_owned(),
        nodes: vec![node(None, &[1], DVec3::X), node(Some(0), &[], DVec3::Y)],
        roots: vec![0],
        animations: vec![clip("slow", 0, slide.clone()), clip("1", 3, slide)],
        ..Scene::default()
    }
}

#[test]
fn clips_loop_and_carry_children() {
    let scene = scene();
    let clip = scene.clip("slow").unwrap().unwrap();
    let child = |time_s| scene.pose_at(clip, time_s).world_from_node[1].translation;
    assert_eq!(child(0.5), DVec3::new(1.0, 1.0, 0.0));
    assert_eq!(child(2.5), child(0.5));
    assert_eq!(child(-1.5), child(0.5));
    // The last key is shown, also where f32 has rounded its time.
    assert_eq!(child(2.0), DVec3::new(4.0, 1.0, 0.0));
    assert_eq!(child(2.0 + 1e-9), child(2.0));
    assert_eq!(child(4.0), child(0.0));
    assert_ne!(child(1.5), child(0.5));
    assert_eq!(
        scene.rest_pose().world_from_node[1].translation,
        DVec3::new(1.0, 1.0, 0.0)
    );
}

#[test]
fn clips_are_found_by_name_then_by_number() {
    let scene = scene();
    let name = |wanted| scene.clip(wanted).unwrap().map(|clip| clip.name.as_str());
    assert_eq!(name(""), Some("slow"));
    assert_eq!(name("none"), None);
    assert_eq!(name("1"), Some("1"));
    assert_eq!(name("0"), Some("slow"));
    assert_eq!(name("3"), Some("1"));
    let message = scene.clip("walk").unwrap_err().to_string();
    assert_eq!(
        message,
        "slides has no animation 'walk' (animation.clip): it has 0 'slow', 3 '1'; \"none\" plays nothing"
    );
    assert_eq!(Scene::default().clip("").unwrap(), None);
}

#[test]
fn players_count_from_their_first_frame() {
    let scene = scene();
    let start = 123_456_789_012_345;
    let mut player = super::super::Player::new(&scene, "", 2.0, 0.25)
        .unwrap()
        .unwrap();
    let clip = scene.clip("").unwrap().unwrap();
    assert_eq!(player.pose_at(start), scene.pose_at(clip, 0.25));
    let later = player.pose_at(start + 500_000_000);
    assert_eq!(later, scene.pose_at(clip, 1.25));
    assert_eq!(player.pose_at(start), scene.pose_at(clip, 0.25));
}
