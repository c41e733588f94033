use std::ffi::OsString;
use std::path::Path;
use std::process::ExitCode;

use super::*;
use crate::app::{App, AppError, FrameInput, Kept, SceneAlone, run_app_with};
use crate::folders::Folder;
use crate::images::read_image;
use crate::xr::{Actions, HandScript};

/// The right hand's middle is in the front of the Cornell box, its back to the viewer; the left one has nothing to hold.
const SCRIPT: &str = "[[right]]
at_s = 0.0
position_m = [-0.25, 0.25, -0.1]
orientation = [0.6, 0.0, 0.0, 0.8]
press = [\"squeeze\"]
";

fn input(joints: bool) -> Input {
    let text = format!("joints = {joints}\n{SCRIPT}");
    let script = HandScript::parse("hands", &text, &Pose::IDENTITY, &|_| Err(String::new()));
    script.unwrap().at(0)
}

/// Ends, radii and distances of a fist in closed form. Products of f64 transforms of positions under 1 m round by
/// some 1e-16 m.
#[test]
fn bones_span_their_joints_and_skin_is_a_radius_away() {
    let joints = input(true).hands[1].joints.clone().unwrap();
    let solids: Vec<DAffine3> = solids(&joints).collect();
    assert_eq!(solids.len(), SOLIDS);
    assert_eq!(SHAPES.map(|(_, count)| count).iter().sum::<usize>(), SOLIDS);
    let is = |a: DVec3, b: DVec3| assert!(a.distance(b) < 1e-9, "{a} {b}");
    // The first ball is the wrist's, which is flatter.
    for (ball, joint) in solids.iter().zip(&joints[1..]).skip(1) {
        is(ball.translation, joint.pose.position);
        for axis in 0..3 {
            let radius_m = ball.matrix3.col(axis).length();
            assert!((radius_m - joint.radius_m).abs() < 1e-9, "{radius_m}");
        }
    }
    let tubes = &solids[BALLS..BALLS + BONES];
    assert_eq!(bones().count(), BONES);
    for (tube, bone) in tubes.iter().zip(bones()) {
        let [from, to] = bone.map(|at| &joints[at]);
        is(tube.transform_point3(DVec3::ZERO), from.pose.position);
        is(tube.transform_point3(DVec3::Z), to.pose.position);
        for across in [tube.matrix3.x_axis, tube.matrix3.y_axis] {
            let radius_m = from.radius_m.min(to.radius_m);
            assert!((across.length() - radius_m).abs() < 1e-9, "{bone:?}");
            assert!(across.dot(tube.matrix3.z_axis).abs() < 1e-12);
        }
    }
    let skin = &solids[BALLS + 2 * BONES..][..2 * PALM.len()];
    for (sides, [at, ..]) in skin.chunks(2).zip(PALM).filter(|(_, at)| at[0] != WRIST) {
        let joint = &joints[at];
        for side in sides {
            let off_m = side.translation.distance(joint.pose.position);
            assert!((off_m - joint.radius_m).abs() < 1e-9, "{at}: {off_m}");
        }
    }
}

#[test]
fn what_is_not_tracked_is_hidden_and_no_name_finds_it() {
    let scene = Scene::builtin("cornell").unwrap();
    let bare = scene.instances().len();
    let mut kept = Kept::new(scene, Actions::default());
    let mut world = World::new(&mut kept, None, None);
    world.show_hands(true).unwrap();
    let mut shown = |input: &Input, shows: bool| {
        world.show_hands(shows).unwrap();
        world.move_hands(input).unwrap();
        assert!(world.node("wearer's right hand").is_err());
        assert!(world.material("wearer's hands").is_err());
        let instances = world.scene().instances().split_off(bare);
        instances
            .iter()
            .map(|placed| placed.world_from_object)
            .collect::<Vec<_>>()
    };
    assert!(shown(&Input::default(), true).is_empty());
    let held = input(false);
    let grip = held.hands[1].grip.unwrap();
    assert_eq!(shown(&held, true)[0], grip.pose.affine());
    assert_eq!(shown(&held, true).len(), 2);
    assert_eq!(shown(&input(true), true).len(), SOLIDS);
    assert!(shown(&input(true), false).is_empty());
    // Joints all in one place, without a radius, still have a placement that a node may have.
    let mut collapsed = input(true);
    for joint in collapsed.hands[1].joints.as_mut().unwrap().iter_mut() {
        (joint.pose, joint.radius_m) = (Pose::IDENTITY, 0.0);
    }
    assert_eq!(shown(&collapsed, true).len(), SOLIDS);
}

/// Shows hands from a frame on, from the start for 0.
struct Shows(u32);

impl App for Shows {
    fn start(&mut self, world: &mut World<'_>) -> Result<(), AppError> {
        Ok(world.show_hands(self.0 == 0)?)
    }

    fn update(&mut self, frame: &FrameInput, world: &mut World<'_>) -> Result<(), AppError> {
        world.show_hands(frame.frame >= self.0)?;
        // From within the hand through its fingers.
        let (origin, direction) = frame.aim(Side::Right).unwrap();
        let met = |past: &[usize]| world.cast_ray(origin, direction, f64::INFINITY, past);
        let ceiling = world.node("ceiling")?;
        assert_eq!(met(&[]).unwrap().node, Some(ceiling));
        assert!(met(&[ceiling]).is_none_or(|beyond| beyond.node != Some(ceiling)));
        Ok(())
    }
}

/// The left eye's pixels of three frames.
fn pictures(app: &mut dyn App, out: &Path, more: &[&str]) -> [Vec<[f32; 3]>; 3] {
    let fixed = "application --size=32x32 --photons=2048 --headset=symmetric --out";
    let mut words: Vec<OsString> = fixed.split(' ').map(OsString::from).collect();
    words.push(out.into());
    words.extend(more.iter().map(OsString::from));
    assert_eq!(run_app_with(app, &[], words), ExitCode::SUCCESS);
    [0, 1, 2].map(|frame| {
        let path = out.join(format!("frame_{frame:04}_left.exr"));
        read_image(&path).unwrap().pixels
    })
}

#[test]
fn a_hand_is_seen_replays_to_the_bit_and_lets_rays_through() {
    let folder = Folder::new("hands");
    let hands = folder.write("hands.toml", format!("joints = true\n{SCRIPT}"));
    let [trace, out] = ["trace.jsonl", "out"].map(|name| folder.join(name));
    let script = format!("--set=simulated.hands={}", hands.display());
    let record = format!("--record={}", trace.display());
    let recorded = ["--session=simulated", "--frames=3", &script, &record];
    let recorded = pictures(&mut Shows(0), &out, &recorded);
    let trace = format!("--trace={}", trace.display());
    let by_setting = [&*trace, "--set=input.show_hands=true"];
    assert!(pictures(&mut SceneAlone, &out, &by_setting) == recorded);
    let without = pictures(&mut SceneAlone, &out, &[&*trace]);
    assert!((0..3).all(|frame| without[frame] != recorded[frame]));
    // Their sheen is not compiled in, which takes one frame.
    let later = pictures(&mut Shows(1), &out, &[&*trace]);
    assert!(later[0] == without[0] && later[2] != without[2]);
}
