//! The model of edits: inverses are exact, histories undo and redo, hidden nodes are left out.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use stereolux_scene::edit::{
    Document, Edit, EditError, HISTORY_LIMIT, MaterialPreset, NewContent, NewNode, Original,
    Placement,
};
use stereolux_scene::{LightKind, Material, Needs, Scene, Trs};

use crate::edits::{lamp, node};
use crate::shapes::Random;

fn document(scene: Scene) -> Document {
    let original = Original::new("test", Vec::new(), &scene);
    Document::new(scene, original)
}

fn random_trs(random: &mut Random) -> Trs {
    Trs {
        translation: random.vector(),
        rotation: DQuat::from_axis_angle(random.direction(), 3.0 * random.unit()),
        scale: DVec3::splat(0.5) + random.vector().abs(),
    }
}

/// Any edit, now and then one that must be refused.
fn random_edit(random: &mut Random, scene: &Scene) -> Edit {
    let node = random.below(scene.nodes.len() + 1);
    let material = random.below(scene.materials.len());
    match random.below(12) {
        0 | 1 => Edit::Transform {
            node,
            to: Placement::Parts(random_trs(random)),
        },
        2 => Edit::Transform {
            node,
            to: Placement::Matrix(DAffine3::from_mat3_translation(
                DMat3::from_cols(random.vector(), random.vector(), random.vector()),
                random.vector(),
            )),
        },
        3 => Edit::Visibility {
            node,
            is_hidden: random.below(2) == 0,
        },
        4 => Edit::Rename {
            node,
            name: format!("name {}", random.below(10)),
        },
        5 => {
            let mut to = scene.materials[material].clone();
            to.roughness = 1.2 * random.unit() as f32;
            to.emission = [random.unit() as f32; 3];
            Edit::Material {
                material,
                to: Box::new(to),
            }
        }
        6 => Edit::OwnMaterial {
            mesh: random.below(scene.meshes.len()),
            material,
        },
        7 => Edit::Light {
            light: random.below(scene.lights.len() + 1),
            to: lamp(LightKind::Point),
        },
        8 | 9 => Edit::Add {
            parent: (random.below(2) == 0).then_some(node),
            node: NewNode {
                name: "added".to_owned(),
                to: Placement::Parts(random_trs(random)),
                content: match random.below(3) {
                    0 => NewContent::Empty,
                    1 => NewContent::Light(lamp(LightKind::Directional)),
                    _ => NewContent::Mesh(random.below(scene.meshes.len())),
                },
            },
        },
        10 => Edit::Delete { node },
        _ => Edit::Duplicate { node },
    }
}

#[test]
fn every_edit_has_an_exact_inverse() {
    let mut random = Random(7);
    for name in ["cornell", "parade", "sphere"] {
        let start = Scene::builtin(name).unwrap();
        let mut kinds = std::collections::BTreeMap::<_, [usize; 2]>::new();
        for _ in 0..40 {
            let mut scene = start.clone();
            let mut steps = Vec::new();
            for _ in 0..12 {
                let before = scene.clone();
                let mut edit = random_edit(&mut random, &scene);
                if random.below(8) == 0 {
                    edit = Edit::Several(vec![edit, random_edit(&mut random, &scene)]);
                }
                let kind = format!("{edit:?}");
                let kind = kind.split([' ', '(']).next().unwrap().to_owned();
                let tally = kinds.entry(kind).or_default();
                match edit.clone().apply(&mut scene) {
                    Ok(inverse) => {
                        tally[0] += 1;
                        let mut again = scene.clone();
                        let redo = inverse.clone().apply(&mut again).unwrap();
                        assert!(again == before, "{edit:?} is not undone by {inverse:?}");
                        redo.apply(&mut again).unwrap();
                        assert!(again == scene, "{edit:?} is not done again");
                        steps.push((before, inverse));
                    }
                    Err(error) => {
                        tally[1] += 1;
                        assert!(
                            scene == before,
                            "{edit:?} was refused and changed the scene"
                        );
                        assert!(!error.to_string().contains('\n'));
                    }
                }
                assert_graph(&scene);
            }
            for (before, inverse) in steps.into_iter().rev() {
                inverse.apply(&mut scene).unwrap();
                assert!(scene == before);
            }
        }
        for (kind, [done, refused]) in &kinds {
            let must = *kind != "Light" || !start.lights.is_empty();
            assert!(*done > 0 || !must, "{name}: {kind} never worked");
            assert!(done + refused > 5, "{name}: {kind} was hardly tried");
        }
        assert_eq!(kinds.len(), 10, "{name}: {kinds:?}");
    }
}

/// Children and parents agree, and indices are in range.
fn assert_graph(scene: &Scene) {
    for (index, node) in scene.nodes.iter().enumerate() {
        for child in &node.children {
            assert_eq!(scene.nodes[*child].parent, Some(index));
        }
        if let Some(parent) = node.parent {
            assert!(scene.nodes[parent].children.contains(&index));
        }
        assert!(node.light.is_none_or(|light| light < scene.lights.len()));
    }
    for root in &scene.roots {
        assert_eq!(scene.nodes[*root].parent, None);
    }
    let materials = scene.materials.len() as u32;
    let mut triangles = scene.meshes.iter().flat_map(|mesh| &mesh.triangles);
    assert!(triangles.all(|triangle| triangle.material < materials));
}

#[test]
fn faulty_edits_are_refused_in_one_clear_line() {
    let mut scene = Scene::builtin("parade").unwrap();
    let ball = node(&scene, "ball");
    let far = Edit::place(ball, DAffine3::from_translation(DVec3::X * 1e39));
    let error = document(scene.clone()).edit(far).unwrap_err().to_string();
    assert!(error.contains("beyond 32-bit floats"), "{error}");
    let mut refuse = |edit: Edit, words: &str| {
        let before = scene.clone();
        let error = edit.apply(&mut scene).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
        assert!(scene == before);
    };
    refuse(
        Edit::Delete { node: 999 },
        "there is no node 999: the scene has",
    );
    refuse(
        Edit::place(ball, DAffine3::from_translation(DVec3::NAN)),
        "not finite",
    );
    let bad = |change: fn(&mut Material)| {
        let mut to = Material::default();
        change(&mut to);
        Edit::Material {
            material: 0,
            to: Box::new(to),
        }
    };
    refuse(bad(|m| m.roughness = 1.5), "roughness must be 0 to 1");
    refuse(
        bad(|m| m.ior = 0.5),
        "index of refraction must be 1 or more",
    );
    refuse(
        bad(|m| m.emission[1] = f32::NAN),
        "emission must be 0 to 1e38",
    );
    // More than files can hold as a colour and a power of two.
    refuse(bad(|m| m.emission[1] = 3e38), "emission must be 0 to 1e38");
    refuse(
        Edit::Material {
            material: 999,
            to: Box::default(),
        },
        "there is no material 999",
    );
    let tube = scene.nodes.iter().position(|node| node.skin.is_some());
    let tube = tube.unwrap();
    let refuse = |edit: Edit, words: &str| {
        let error = edit.apply(&mut scene.clone()).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    };
    refuse(Edit::Duplicate { node: tube }, "cannot be duplicated");
    let joint = scene.skins[scene.nodes[tube].skin.unwrap()].joints[0];
    refuse(
        Edit::Delete { node: joint },
        "which is skinned: delete that first",
    );
    // What was deleted cannot be deleted again, or get children.
    let inverse = Edit::Delete { node: ball }.apply(&mut scene).unwrap();
    let again = Edit::Delete { node: ball }.apply(&mut scene);
    assert_eq!(
        again,
        Err(EditError::Gone {
            name: "ball".to_owned()
        })
    );
    inverse.clone().apply(&mut scene).unwrap();
    assert_eq!(inverse.apply(&mut scene), Err(EditError::Stale));
}

/// Found by `fuzz/`: what could not be undone went through.
#[test]
fn inverses_that_do_not_fit_the_scene_are_refused() {
    let scene = Scene::builtin("cornell").unwrap();
    let count = scene.nodes.len();
    let mut document = document(scene.clone());
    // The last nodes are roots side by side, and no subtree.
    let truncate = Edit::Truncate {
        nodes: 3,
        lights: 0,
    };
    assert_eq!(document.edit(truncate), Err(EditError::Stale));
    assert!(*document.scene() == scene);
    // A deleted node cannot hang on another deleted one.
    for node in [1, count - 1] {
        document.edit(Edit::Delete { node }).unwrap();
    }
    let attach = Edit::Attach {
        node: count - 1,
        parent: Some(1),
        position: 0,
    };
    assert_eq!(document.edit(attach), Err(EditError::Stale));
    while document.undo().unwrap() {}
    assert!(*document.scene() == scene);
}

#[test]
fn hiding_a_node_hides_everything_below_it() {
    let mut scene = Scene::builtin("gallery").unwrap();
    let lights = scene.light_instances().len();
    let vase = node(&scene, "vase");
    let spot = node(&scene, "spot on the vase");
    let shown = |scene: &Scene, node: usize| {
        let instances = scene.instances();
        instances.iter().any(|instance| instance.node == node)
    };
    let hide = |node| Edit::Visibility {
        node,
        is_hidden: true,
    };
    hide(vase).apply(&mut scene).unwrap();
    assert!(!shown(&scene, vase));
    hide(spot).apply(&mut scene).unwrap();
    assert_eq!(scene.light_instances().len(), lights - 1);
    assert_eq!(Needs::of(&scene).lights.spot, lights - 1);
    // A child of a hidden node is hidden, whatever itself says; cameras are not.
    let child = Edit::Add {
        parent: Some(vase),
        node: NewNode {
            name: "handle".to_owned(),
            to: Placement::Parts(Trs::default()),
            content: NewContent::Mesh(0),
        },
    };
    child.apply(&mut scene).unwrap();
    let handle = scene.nodes.len() - 1;
    assert!(!shown(&scene, handle) && !scene.nodes[handle].is_hidden);
    let pose = scene.start_pose();
    hide(node(&scene, "visitor")).apply(&mut scene).unwrap();
    assert_eq!(scene.start_pose(), pose);
    let show = Edit::Visibility {
        node: vase,
        is_hidden: false,
    };
    show.apply(&mut scene).unwrap();
    assert!(shown(&scene, vase) && shown(&scene, handle));
}

#[test]
fn a_document_undoes_and_redoes_with_one_step_per_drag() {
    let start = Scene::builtin("cornell").unwrap();
    let mut document = document(start.clone());
    let block = node(&start, "short block");
    // A copy elsewhere follows by the edits alone.
    let mut copy = start.clone();
    assert!(document.take_changes().is_empty());
    let at = |x: f64| {
        let mut parts = start.nodes[block].trs();
        parts.translation.x += x;
        Edit::Transform {
            node: block,
            to: Placement::Parts(parts),
        }
    };
    assert!(!document.is_modified() && !document.undo().unwrap());
    document.edit(at(0.0)).unwrap();
    assert!(!document.is_modified(), "nothing changed, so no step");
    document.begin_gesture();
    for step in 1..=20 {
        document.edit(at(0.01 * f64::from(step))).unwrap();
    }
    document.end_gesture();
    assert_eq!(document.undo_label(), Some("Move short block"));
    assert_eq!(document.history().count(), 1, "a drag is one step");
    let dragged = document.scene().clone();
    document.edit(at(0.5)).unwrap();
    assert_eq!(
        document.history().count(),
        2,
        "another drag is another step"
    );
    document.mark_saved();
    assert!(!document.is_modified());
    assert!(document.undo().unwrap() && document.is_modified());
    assert!(*document.scene() == dragged);
    assert!(document.undo().unwrap());
    assert!(*document.scene() == start);
    assert!(!document.undo().unwrap());
    assert_eq!(document.redo_label(), Some("Move short block"));
    assert!(document.redo().unwrap() && document.redo().unwrap());
    assert!(!document.is_modified(), "back at what was saved");
    assert!(!document.redo().unwrap());
    for change in document.take_changes() {
        change.apply(&mut copy).unwrap();
    }
    assert!(copy == *document.scene() && document.take_changes().is_empty());

    // Dragged back to where it was: no step remains.
    let steps = document.history().count();
    let now = document.scene().nodes[block].trs();
    document.begin_gesture();
    document.edit(at(0.7)).unwrap();
    document
        .edit(Edit::Transform {
            node: block,
            to: Placement::Parts(now),
        })
        .unwrap();
    document.end_gesture();
    assert_eq!(document.history().count(), steps);
    assert!(!document.is_modified());

    // Old steps are forgotten, and with them the way back to what was saved.
    for step in 0..HISTORY_LIMIT + 10 {
        let name = format!("block {step}");
        document.edit(Edit::Rename { node: block, name }).unwrap();
    }
    assert_eq!(document.history().count(), HISTORY_LIMIT);
    while document.undo().unwrap() {}
    assert!(document.is_modified());
    assert_eq!(document.scene().nodes[block].name, "block 9");
}

#[test]
fn labels_say_what_was_done() {
    let scene = Scene::builtin("cornell").unwrap();
    let block = node(&scene, "short block");
    let parts = scene.nodes[block].trs();
    let (mut moved, mut turned, mut scaled) = (parts, parts, parts);
    moved.translation = DVec3::Y;
    turned.rotation = DQuat::from_rotation_y(0.3) * parts.rotation;
    scaled.scale = parts.scale * 2.0;
    for (to, says) in [(moved, "Move"), (turned, "Turn"), (scaled, "Scale")] {
        let to = Placement::Parts(to);
        let label = Edit::Transform { node: block, to }.label(&scene);
        assert_eq!(label, format!("{says} short block"));
    }
    let deleted = Edit::Delete { node: block }.label(&scene);
    assert_eq!(deleted, "Delete short block");
}

#[test]
fn presets_are_what_they_say_and_keep_the_colour() {
    let mut from = Material::lambert("paint", [0.2, 0.4, 0.6]);
    for preset in MaterialPreset::ALL {
        let to = preset.applied_to(&from);
        assert_eq!(MaterialPreset::of(&to), preset);
        assert_eq!(to.name, "paint");
        if preset != MaterialPreset::Glass {
            assert_eq!(to.base_color, from.base_color);
        }
        let edit = Edit::Material {
            material: 0,
            to: Box::new(to),
        };
        edit.apply(&mut Scene::builtin("cornell").unwrap()).unwrap();
    }
    from.roughness = 0.7;
    from.specular = 1.0;
    assert_eq!(MaterialPreset::Metal.applied_to(&from).roughness, 0.7);
}

#[test]
fn moving_an_animated_node_moves_what_its_clip_leaves_alone() {
    let mut scene = Scene::builtin("parade").unwrap();
    let clip = scene.animations[0].clone();
    let turning = clip
        .nodes
        .iter()
        .find(|tracks| tracks.translation.is_none() && tracks.rotation.is_some())
        .expect("a node that only turns");
    let index = turning.node;
    let before = scene.pose_at(&clip, 0.7).world_from_node[index];
    let mut parts = scene.nodes[index].trs();
    parts.translation.y += 0.25;
    let parent = scene.nodes[index].parent;
    let to = Placement::Parts(parts);
    let edit = Edit::Transform { node: index, to };
    let inverse = edit.apply(&mut scene).unwrap();
    let after = scene.pose_at(&scene.animations[0], 0.7).world_from_node[index];
    // The clip's turn stays; rounding of sums of size 1.
    assert!((after.matrix3.x_axis - before.matrix3.x_axis).length() < 1e-12);
    let gone = (after.translation - before.translation).length();
    assert!((gone - 0.25).abs() < 1e-12, "{gone} below {parent:?}");
    inverse.apply(&mut scene).unwrap();
    assert_eq!(scene.animations[0], clip);
}

/// A file may hold what is flat: it can be moved, made solid and flat again, and no step of that is lost.
#[test]
fn what_a_file_has_flat_may_be_moved_and_nothing_else_is_flattened() {
    let mut document = Document::load("builtin:parade").unwrap();
    let ball = node(document.scene(), "ball");
    let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let refused = document.edit(Edit::place(ball, flat)).unwrap_err();
    let refused = refused.to_string();
    assert!(
        refused.contains("ball: the transform is singular"),
        "{refused}"
    );
    let mut scene = document.scene().clone();
    Edit::place(ball, flat).apply(&mut scene).unwrap();
    let moved = DAffine3::from_translation(DVec3::X) * flat;
    let solid = DAffine3::from_translation(DVec3::Y);
    let flattened = scene.clone();
    let mut after = Vec::new();
    let mut inverses = Vec::new();
    for to in [moved, solid] {
        let edit = Edit::place(ball, to);
        inverses.push(edit.apply(&mut scene).unwrap());
        after.push(scene.clone());
    }
    while let (Some(inverse), Some(after)) = (inverses.pop(), after.pop()) {
        assert!(scene == after);
        inverse.apply(&mut scene).unwrap();
    }
    assert!(scene == flattened);
}

#[test]
fn several_nodes_that_are_dragged_back_leave_no_step() {
    let mut document = Document::load("builtin:parade").unwrap();
    let nodes = ["ball", "box"].map(|name| node(document.scene(), name));
    let before = document.scene().clone();
    let place = |by: DVec3| {
        let placed = nodes.map(|node| {
            Edit::place(
                node,
                DAffine3::from_translation(by) * before.nodes[node].parent_from_node,
            )
        });
        Edit::Several(placed.into())
    };
    document.begin_gesture();
    for by in [DVec3::X, 2.0 * DVec3::X] {
        document.edit(place(by)).unwrap();
    }
    assert!(document.is_modified());
    for node in nodes {
        assert!(document.scene().nodes[node] != before.nodes[node]);
    }
    document.edit(place(DVec3::ZERO)).unwrap();
    document.end_gesture();
    assert!(!document.is_modified());
    assert!(document.undo_label().is_none());
}
