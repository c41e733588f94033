//! Animations, skins and morph targets as files have them: what is read, and one clear line for every fault.

use glam::{DAffine3, DQuat, DVec3};
use serde_json::{Value, json};
use stereolux_scene::builtin;

use stereolux_scene::{Bounds, Needs, Scene};

use super::import::{assert_fault, set};
use crate::cases::cases;
use crate::edits::node;
use crate::embedded_scenes::parade;

/// `builtin:parade` with its JSON changed; `bin` is its binary chunk.
fn altered(change: impl FnOnce(&mut Value, &mut Vec<u8>)) -> Result<Scene, String> {
    let glb = builtin::glb("parade").unwrap();
    let length = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().unwrap()) as usize;
    let json_end = 20 + length(12);
    let mut json: Value = serde_json::from_slice(&glb[20..json_end]).unwrap();
    let mut bin = glb[json_end + 8..].to_vec();
    change(&mut json, &mut bin);
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut file = b"glTF\x02\0\0\0".to_vec();
    let total = 12 + 8 + text.len() + 8 + bin.len();
    file.extend((total as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &text), (b"BIN\0", &bin)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend_from_slice(kind);
        file.extend_from_slice(chunk);
    }
    Scene::from_bytes("parade.glb", &file).map_err(|error| error.to_string())
}

/// Puts another time into key `key` of the first track.
fn set_key_time(json: &Value, bin: &mut [u8], key: usize, time_s: f32) {
    let input = json["animations"][0]["samplers"][0]["input"]
        .as_u64()
        .unwrap();
    let view = json["accessors"][input as usize]["bufferView"]
        .as_u64()
        .unwrap();
    let first = json["bufferViews"][view as usize]["byteOffset"]
        .as_u64()
        .unwrap();
    bin[first as usize + 4 * key..][..4].copy_from_slice(&time_s.to_le_bytes());
}

/// Section 3.7.4 of glTF 2.0: a node's transform counts for which side of a skinned mesh is the front, though not for where it is.
#[test]
fn a_skin_below_a_mirrored_node_is_mirrored_with_it() {
    let scene = Scene::builtin("parade").unwrap();
    let tube = node(&scene, "tube");
    let mesh = &scene.meshes[scene.nodes[tube].mesh.unwrap()];
    let mut mirrored = scene.clone();
    let aside = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    for root in scene.roots.clone() {
        let node = &mut mirrored.nodes[root];
        node.parent_from_node = aside * node.parent_from_node;
        node.parts = None;
    }
    let side_of = |scene: &Scene| {
        let deformation = scene.deformation(tube, &scene.rest_pose());
        let determinant = deformation.world_from_object.matrix3.determinant();
        // In its own space the mesh is never turned inside out.
        let inner = deformation.object_from_mesh[0].matrix3.determinant();
        (determinant.signum(), inner.signum())
    };
    assert_eq!(
        (side_of(&scene), side_of(&mirrored)),
        ((1.0, 1.0), (-1.0, 1.0))
    );
    let positions = |scene: &Scene| scene.positions_in_world(tube, mesh, &scene.rest_pose());
    for (place, other) in positions(&scene).into_iter().zip(positions(&mirrored)) {
        // A few roundings of f64 at 1 m.
        assert!(
            (aside.transform_point3(place) - other).length() < 1e-14,
            "{place} {other}"
        );
    }
}

#[test]
fn clips_skins_and_targets_are_read() {
    let scene = Scene::builtin("parade").unwrap();
    let clips: Vec<_> = scene
        .animations
        .iter()
        .map(|clip| (clip.name.as_str(), clip.nodes.len(), clip.length_s))
        .collect();
    assert_eq!(clips, [("parade", 5, parade::LENGTH_S), ("wave", 2, 2.0)]);
    let needs = Needs::of(&scene);
    assert_eq!((needs.motion, needs.deformation), ("morph", true));
    assert_eq!(needs.clips, ["parade", "wave"]);
    assert!(scene.warnings.is_empty() && scene.source.left_out.is_empty());
    let tube = node(&scene, "tube");
    assert!(scene.deforms(tube) && scene.deforms(node(&scene, "ball")));
    assert!(!scene.deforms(node(&scene, "box")));

    // One second in, both upper joints have turned by 0.6 about z. The top belongs to the last one alone.
    let pose = scene.pose_at(&scene.animations[0], 1.0);
    let mesh = &scene.meshes[scene.nodes[tube].mesh.unwrap()];
    let positions = scene.positions_in_world(tube, mesh, &pose);
    let (gap, turn) = (DVec3::Y * parade::TUBE_M / 3.0, DQuat::from_rotation_z(0.6));
    let foot = DVec3::new(-0.45, 0.0, -0.6);
    let mut tops = 0;
    for (rest, position) in mesh.positions.iter().zip(&positions) {
        let rest = glam::Vec3::from(*rest).as_dvec3();
        if rest.y < parade::TUBE_M {
            continue;
        }
        tops += 1;
        let expected = foot + gap + turn * (gap + turn * (rest - 2.0 * gap));
        // f32 positions and keys of size 1: 1e-7.
        assert!((*position - expected).length() < 5e-7);
        assert!((*position - (foot + rest)).length() > 0.3);
    }
    assert!(tops > 16);
    // Half way through the morph (2 s of 4 is its height) the ball is the mean of both shapes.
    let ball = node(&scene, "ball");
    let mesh = &scene.meshes[scene.nodes[ball].mesh.unwrap()];
    let at =
        |time_s| scene.positions_in_world(ball, mesh, &scene.pose_at(&scene.animations[0], time_s));
    let (round, half, bent) = (at(0.0), at(1.0), at(2.0));
    let mut moved = 0.0f64;
    for ((round, half), bent) in round.iter().zip(&half).zip(&bent) {
        assert!((0.5 * (*round + *bent) - *half).length() < 1e-12);
        moved = moved.max((*bent - *round).length());
    }
    assert!(moved > 0.1);
    // The middle of what a mesh's own weights bend: of f32 positions of size 1.
    let mut bent = scene.clone();
    bent.nodes[ball].morph_weights = vec![1.0];
    let bent_mesh = &mut bent.meshes[scene.nodes[ball].mesh.unwrap()];
    bent_mesh.targets[0].positions.fill([1.0, 0.0, 0.0]);
    let mesh = bent_mesh.clone();
    let positions = bent.positions_in_world(ball, &mesh, &bent.rest_pose());
    let middle = Bounds::of_points(positions).unwrap().center();
    let center = |scene: &Scene| scene.center_of_node(ball, &scene.world_from_node(ball));
    assert!((center(&bent) - middle).length() < 1e-12);
    assert!((center(&scene) - middle).length() > 0.01);
}

#[test]
fn frames_the_skin_where_its_joints_are() {
    let scene = Scene::builtin("parade").unwrap();
    let bounds = scene.bounds_in_world().unwrap();
    let far = altered(|json, _| {
        for node in json["nodes"].as_array_mut().unwrap() {
            match node["name"].as_str() {
                Some("joint 0") => node["translation"] = json!([100.0, 0.0, 0.0]),
                // What a skinned node's own transform says does not count.
                Some("tube") => node["translation"] = json!([0.0, 500.0, 0.0]),
                _ => {}
            }
        }
    })
    .unwrap();
    let moved = far.bounds_in_world().unwrap();
    assert!((moved.max.x - 100.13).abs() < 1e-3, "{moved:?}");
    assert_eq!(moved.max.y, bounds.max.y);
}

#[test]
fn eight_influences_are_cut_to_four_that_sum_to_one() {
    let plain = Scene::builtin("parade").unwrap();
    // The same four once more: shares halve, places stay.
    let twice = altered(|json, _| {
        for mesh in json["meshes"].as_array_mut().unwrap() {
            let attributes = &mut mesh["primitives"][0]["attributes"];
            if attributes.get("JOINTS_0").is_some() {
                attributes["JOINTS_1"] = attributes["JOINTS_0"].clone();
                attributes["WEIGHTS_1"] = attributes["WEIGHTS_0"].clone();
            }
        }
    })
    .unwrap();
    // In the second set alone: the first has no share.
    let second = altered(|json, _| {
        let accessors = json["accessors"].as_array().unwrap().clone();
        let mut zeros = Vec::new();
        for mesh in json["meshes"].as_array_mut().unwrap() {
            let attributes = &mut mesh["primitives"][0]["attributes"];
            if let Some(weights) = attributes.get("WEIGHTS_0").and_then(Value::as_u64) {
                attributes["JOINTS_1"] = attributes["JOINTS_0"].clone();
                attributes["WEIGHTS_1"] = json!(weights);
                attributes["WEIGHTS_0"] = json!(accessors.len() + zeros.len());
                // Without a buffer view.
                let count = &accessors[weights as usize]["count"];
                zeros.push(json!({ "componentType": 5126, "type": "VEC4", "count": count }));
            }
        }
        json["accessors"].as_array_mut().unwrap().extend(zeros);
    })
    .unwrap();
    let tube = node(&plain, "tube");
    let positions = |scene: &Scene| {
        let pose = scene.pose_at(&scene.animations[0], 0.7);
        let mesh = &scene.meshes[scene.nodes[tube].mesh.unwrap()];
        scene.positions_in_world(tube, mesh, &pose)
    };
    for other in [twice, second] {
        for (a, b) in positions(&plain).iter().zip(positions(&other)) {
            assert!((*a - b).length() < 1e-6, "{a} {b}");
        }
    }
}

#[test]
fn channels_of_extensions_are_left_out_and_said() {
    let scene = altered(|json, _| {
        json["animations"][1]["channels"][0]["target"] = json!({ "path": "pointer" });
    })
    .unwrap();
    assert_eq!(scene.animations[1].nodes.len(), 1);
    let needs = Needs::of(&scene);
    let said = needs
        .left_out
        .iter()
        .any(|left| left.feature == "animation channels");
    assert!(said, "{:?}", needs.left_out);
}

/// Where the parade is changed, to what, and what is said.
const FAULTS: &str = r#"
    /animations/0/channels/0/sampler | 99 | animations[0].channels[0].sampler: 99 is out of range
    /animations/0/channels/0/target/node | -1 | animations[0].channels[0].target.node: -1 is out of range
    /animations/0/channels/0/target/path | "colour" | path must be translation, rotation, scale or weights
    /animations/0/samplers/0/interpolation | "SPLINE" | animations[0].samplers[0].interpolation: must be
    /animations/0/samplers/0/input | 4294967296 | animations[0].samplers[0].input: 4294967296 is out of range
    /skins/0/joints | [] | skins[0]: has no joints
    /skins/0/joints/1 | 77 | skins[0].joints[1]: 77 is out of range
    /skins/0/joints | [0, 1] | names joint 2, the skin has 2
    /skins/0/joints | [0, 1, 2, 3, 4, 5, 6, 7, 8] | 3 matrices for 9 joints
    /skins/0/inverseBindMatrices | 0 | must hold 4x4 matrices of floats
"#;

#[test]
fn every_fault_of_motion_is_one_clear_line() {
    type Change = fn(&mut Value, &mut Vec<u8>);
    let changes: &[(Change, &str)] = &[
        (
            |json, _| {
                let input = &json["animations"][0]["samplers"][1]["input"];
                json["animations"][0]["samplers"][3]["input"] = input.clone();
            },
            "animations[0].samplers[3].output: 3 numbers do not fit 5 keys",
        ),
        (
            |json, _| {
                let output = json["animations"][0]["samplers"][1]["output"].clone();
                json["animations"][0]["samplers"][0]["output"] = output;
            },
            "4 components per element",
        ),
        (
            |json, _| {
                let channel = json["animations"][0]["channels"][0].clone();
                let channels = json["animations"][0]["channels"].as_array_mut();
                channels.unwrap().push(channel);
            },
            "a second channel for the translation",
        ),
        (
            |json, bin| set_key_time(json, bin, 1, 9f32),
            "times must ascend, but key 1 is at 9 s and the next at 2 s",
        ),
        (
            |json, bin| set_key_time(json, bin, 0, f32::NAN),
            "key 0 is at NaN s",
        ),
        (
            |json, _| {
                let target = &json["animations"][0]["channels"][0]["target"]["node"];
                let moved = target.as_u64().unwrap() as usize;
                let node = json["nodes"][moved].as_object_mut().unwrap();
                node.remove("translation");
                let identity = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
                node.insert("matrix".to_owned(), json!(identity));
            },
            "animates a node that has a matrix",
        ),
        (
            |json, _| {
                let ball = json["animations"][0]["channels"][3]["target"]["node"].clone();
                for mesh in json["meshes"].as_array_mut().unwrap() {
                    let primitive = mesh["primitives"][0].as_object_mut();
                    primitive.unwrap().remove("targets");
                }
                assert!(ball.is_u64());
            },
            "morph weights of a node whose mesh has no morph targets",
        ),
        (
            |json, _| {
                for node in json["nodes"].as_array_mut().unwrap() {
                    if node.get("skin").is_some() {
                        node["skin"] = json!(3);
                    }
                }
            },
            "'tube'.skin: 3 is out of range",
        ),
        (
            |json, _| {
                for mesh in json["meshes"].as_array_mut().unwrap() {
                    let attributes = mesh["primitives"][0]["attributes"].as_object_mut();
                    attributes.unwrap().remove("WEIGHTS_0");
                }
            },
            "JOINTS_0 and WEIGHTS_0 go together",
        ),
        (
            |json, _| {
                for mesh in json["meshes"].as_array_mut().unwrap() {
                    if mesh["primitives"][0].get("targets").is_some() {
                        mesh["primitives"][0]["targets"][0]["POSITION"] = json!(0);
                    }
                }
            },
            "POSITION has",
        ),
        (
            |json, _| {
                for mesh in json["meshes"].as_array_mut().unwrap() {
                    if mesh["primitives"][0].get("targets").is_some() {
                        mesh["weights"] = json!([0.5, 0.5]);
                    }
                }
            },
            "2 weights for 1 morph targets",
        ),
    ];
    for (change, expected) in changes {
        assert_fault(altered(change), expected);
    }
    for [at, value, says] in cases(FAULTS) {
        let changed = altered(|json, _| set(json, at, value.parse().unwrap()));
        assert_fault(changed, says);
    }
    assert!(altered(|_, _| ()).is_ok());
    // Lines are left out, and their morph targets with them; clips still have weights for them.
    let lines = altered(|json, _| {
        for mesh in json["meshes"].as_array_mut().unwrap() {
            mesh["primitives"][0]["mode"] = json!(1);
        }
    });
    assert!(lines.is_ok(), "{lines:?}");
}
