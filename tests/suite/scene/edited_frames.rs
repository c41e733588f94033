//! Edits of a scene that is shown: the next frame is that of a renderer made from the edited scene, and costs no triangles.

use std::path::Path;

use glam::{DAffine3, DQuat, DVec3};
use stereolux::bvh::top::MOST_OPENED;
use stereolux::renderer::{Applied, Eye, InPlace, Renderer};
use stereolux::scene::edit::{Document, Edit, MaterialPreset, NewContent, NewNode, Placement};
use stereolux::scene::{LightKind, Material, Node, Scene, Trs};
use stereolux::settings::{Method, RenderSettings, Reuse};
use stereolux::xr::View;

use super::edits::{edit_everything, lamp, node};
use super::support::{
    Folder, assert_says, assert_success, both_bits, builtin, parallel_views, play, radiance,
    renderer, settings, square_fov, stereolux,
};

const SIZE: [u32; 2] = [64, 64];

fn views(scene: &Scene) -> [View; 2] {
    parallel_views(scene.start_pose(), 0.06, square_fov(35.0))
}

/// Bits of both eyes in a frame of this number.
pub fn image(renderer: &mut Renderer, views: &[View; 2], frame: u32) -> [Vec<[u32; 3]>; 2] {
    play(renderer, views, frame..frame + 1);
    both_bits(renderer)
}

/// Fails unless no pixel of either eye differs.
pub fn assert_same(shown: &[Vec<[u32; 3]>; 2], wanted: &[Vec<[u32; 3]>; 2], what: &str) {
    for (eye, (shown, wanted)) in shown.iter().zip(wanted).enumerate() {
        let differ = shown.iter().zip(wanted).filter(|(a, b)| a != b).count();
        assert_eq!(differ, 0, "{what}: pixels of eye {eye} that differ");
    }
}

fn in_place(applied: Applied) -> InPlace {
    match applied {
        Applied::InPlace(done) => done,
        Applied::NeedsRebuild { why } => panic!("needs a new renderer: {why}"),
    }
}

fn why(applied: Applied) -> String {
    match applied {
        Applied::NeedsRebuild { why } => why,
        Applied::InPlace(done) => panic!("was shown in place: {done:?}"),
    }
}

/// A renderer whose scene is edited step by step.
struct Live {
    scene: Scene,
    settings: RenderSettings,
    views: [View; 2],
    renderer: Renderer,
    last: [Vec<[u32; 3]>; 2],
}

impl Live {
    fn new(scene: Scene, settings: RenderSettings) -> Self {
        let views = views(&scene);
        let mut renderer = renderer(&scene, &settings, SIZE);
        let last = image(&mut renderer, &views, 0);
        Self {
            scene,
            settings,
            views,
            renderer,
            last,
        }
    }

    /// Applies edits one by one; each must be possible in place.
    fn edit(&mut self, edits: Vec<Edit>) -> InPlace {
        let mut done = InPlace::default();
        for edit in edits {
            edit.apply(&mut self.scene).unwrap();
            done = in_place(self.renderer.apply_scene(&self.scene).unwrap());
        }
        done
    }

    /// The next frame must be that of a new renderer, bit for bit, and not what was seen before.
    fn check(&mut self, what: &str) {
        let shown = image(&mut self.renderer, &self.views, 0);
        let mut new = renderer(&self.scene, &self.settings, SIZE);
        assert_eq!(new.features(), self.renderer.features(), "{what}");
        assert_eq!(new.radius_m(), self.renderer.radius_m(), "{what}");
        let wanted = image(&mut new, &self.views, 0);
        assert_same(&shown, &wanted, what);
        // Negative control: the same frame of the scene before the edit, whose random numbers are the same.
        assert!(shown != self.last, "{what}: nothing changed");
        self.last = shown;
        for placed in self.scene.instances() {
            let id = self.renderer.instance_of_node(placed.node).unwrap();
            assert_eq!(self.renderer.node_of_instance(id), Some(placed.node));
        }
    }
}

fn shift(scene: &Scene, node: usize, by: DVec3, turn: f64, scale: DVec3) -> Edit {
    let mut parts = scene.nodes[node].trs();
    parts.translation += by;
    parts.rotation = DQuat::from_rotation_y(turn) * parts.rotation;
    parts.scale *= scale;
    Edit::Transform {
        node,
        to: Placement::Parts(parts),
    }
}

fn with_material(scene: &Scene, name: &str, change: impl FnOnce(&mut Material)) -> Edit {
    let found = scene.materials.iter().position(|m| m.name == name);
    let material = found.unwrap_or_else(|| panic!("no material {name}"));
    let mut to = scene.materials[material].clone();
    change(&mut to);
    Edit::Material {
        material,
        to: Box::new(to),
    }
}

fn hide(node: usize) -> Edit {
    Edit::Visibility {
        node,
        is_hidden: true,
    }
}

/// A new light.
fn torch(parent: Option<usize>, kind: LightKind) -> Edit {
    Edit::Add {
        parent,
        node: NewNode {
            name: "torch".to_owned(),
            to: Placement::Parts(Trs::default()),
            content: NewContent::Light(lamp(kind)),
        },
    }
}

/// Materials of the triangles of a node's mesh.
fn material_of(scene: &Scene, node: usize) -> usize {
    let mesh = &scene.meshes[scene.nodes[node].mesh.unwrap()];
    mesh.triangles[0].material as usize
}

#[test]
fn an_edited_cornell_box_is_shown_as_a_new_renderer_shows_it() {
    let mut live = Live::new(builtin("cornell"), settings(|_| {}));
    let block = node(&live.scene, "short block");
    let (by, scale) = (DVec3::new(0.05, 0.02, 0.1), DVec3::new(1.2, 0.7, 1.0));
    let moved = shift(&live.scene, block, by, 0.4, scale);
    let done = live.edit(vec![moved]);
    assert!(!done.renumbered && done.uploaded_bytes == 0);
    live.check("moved, turned and scaled");

    // The lamp itself: powers, places and the table of picks follow.
    let mut materials = live.scene.materials.iter();
    let lamp_material = materials.find(|material| material.is_emissive()).unwrap();
    let scene = &live.scene;
    let shines = |node: &usize| {
        scene.nodes[*node].mesh.is_some()
            && scene.materials[material_of(scene, *node)].is_emissive()
    };
    let lamp_node = (0..scene.nodes.len()).find(shines).unwrap();
    let dimmer = with_material(scene, &lamp_material.name, |m| m.emission = [4.0, 9.0, 2.0]);
    let aside = shift(
        scene,
        lamp_node,
        DVec3::X * 0.1,
        0.3,
        DVec3::new(0.5, 1.0, 1.4),
    );
    live.edit(vec![dimmer, aside]);
    live.check("another lamp elsewhere");

    let copy = Edit::Duplicate { node: lamp_node };
    copy.apply(&mut live.scene).unwrap();
    let added = live.scene.nodes.len() - 1;
    let by = DVec3::new(-0.2, -0.1, 0.2);
    let elsewhere = shift(&live.scene, added, by, 0.0, DVec3::ONE);
    let done = live.edit(vec![elsewhere]);
    assert!(done.renumbered);
    live.check("a second lamp that emits");

    let own = live.scene.materials.len();
    let give = Edit::OwnMaterial {
        mesh: live.scene.nodes[block].mesh.unwrap(),
        material: material_of(&live.scene, block),
    };
    live.edit(vec![give]);
    let mut glowing = live.scene.materials[own].clone();
    glowing.emission = [0.0, 0.0, 2.0];
    glowing.double_sided = true;
    let glow = Edit::Material {
        material: own,
        to: Box::new(glowing),
    };
    live.edit(vec![glow, hide(lamp_node)]);
    live.check("a block that glows and a lamp that is hidden");
    live.edit(vec![Edit::Delete { node: block }]);
    live.check("the block deleted");
}

#[test]
fn edits_of_the_path_tracers_scene_are_exact_too() {
    let settings = settings(|s| {
        s.method = Method::Path;
        s.reuse = Reuse::Off;
        s.path.max_depth = 4;
    });
    // Point, spot and directional lights, textures, and a sphere around it all that the lights shine through.
    let scene = Scene::load(Path::new("tests/reference/lights.gltf")).unwrap();
    let mut live = Live::new(scene, settings);
    let lit: Vec<_> = live.scene.light_instances();
    let mut edits = Vec::new();
    for placed in &lit {
        let mut to = live.scene.lights[placed.light].clone();
        to.intensity = to.intensity.map(|channel| 0.5 * channel + 0.1);
        if let LightKind::Spot { outer_cone_rad, .. } = &mut to.kind {
            *outer_cone_rad *= 1.2;
        }
        edits.push(Edit::Light {
            light: placed.light,
            to,
        });
    }
    live.edit(edits);
    live.check("lights of every kind");
    let first = live.scene.instances()[0].node;
    let by = DVec3::new(0.1, 0.3, 0.0);
    let larger = shift(&live.scene, first, by, 0.1, DVec3::splat(1.3));
    live.edit(vec![larger]);
    live.check("a larger scene for light from afar");
    let kind = live.scene.lights[lit[0].light].kind;
    live.edit(vec![torch(Some(first), kind)]);
    live.check("one more light");
}

#[test]
fn edits_of_the_gallery_are_exact() {
    let mut live = Live::new(builtin("gallery"), settings(|s| s.photon.count = 2048));
    let (vase, bench) = (node(&live.scene, "vase"), node(&live.scene, "bench"));
    let paint = with_material(&live.scene, "marble floor", |m| {
        m.roughness = 0.4;
        m.base_color = [0.9, 0.4, 0.3, 1.0];
    });
    let by = DVec3::new(0.1, 0.2, 0.3);
    let raise = shift(&live.scene, vase, by, 0.5, DVec3::ONE);
    let copy = Edit::Duplicate { node: vase };
    live.edit(vec![paint, raise, hide(bench), copy]);
    live.check("floor, vases and bench");
}

#[test]
fn edits_hold_while_a_clip_plays() {
    let settings = settings(|_| {});
    let mut scene = builtin("parade");
    let views = views(&scene);
    let mut shown = renderer(&scene, &settings, SIZE);
    shown.animate(0);
    image(&mut shown, &views, 0);
    let stands = |node: &usize| {
        let mut tracks = scene.animations[0].nodes.iter();
        !scene.deforms(*node) && !tracks.any(|tracks| tracks.node == *node)
    };
    let mut nodes = scene.instances().into_iter().map(|instance| instance.node);
    let still = nodes.find(stands).unwrap();
    let tube = node(&scene, "tube");
    let joint = scene.skins[scene.nodes[tube].skin.unwrap()].joints[0];
    let by = DVec3::new(0.1, 0.2, 0.0);
    let aside = shift(&scene, still, by, 0.3, DVec3::splat(1.1));
    aside.apply(&mut scene).unwrap();
    // The tube follows its first joint, whose place the clip leaves alone.
    let aside = shift(&scene, joint, DVec3::new(0.2, 0.0, 0.1), 0.0, DVec3::ONE);
    aside.apply(&mut scene).unwrap();
    let done = in_place(shown.apply_scene(&scene).unwrap());
    assert!(!done.renumbered);
    // The clip has not been set back.
    let placed = shown.instance_of_node(still).unwrap();
    let place = shown.scene().placement(placed);
    assert_eq!(place, Some(scene.rest_pose().world_from_node[still]));
    shown.animate(700_000_000);
    let edited = image(&mut shown, &views, 1);
    let anew = |scene: &Scene| {
        let mut new = renderer(scene, &settings, SIZE);
        new.animate(0);
        new.animate(700_000_000);
        image(&mut new, &views, 1)
    };
    assert!(anew(&scene) == edited);
    assert!(anew(&builtin("parade")) != edited, "negative control");
}

#[test]
fn what_was_not_compiled_or_uploaded_asks_for_a_new_renderer() {
    let scene = builtin("cornell");
    let views = views(&scene);
    let settings = settings(|_| {});
    let mut shown = renderer(&scene, &settings, SIZE);
    let before = image(&mut shown, &views, 0);
    let mut ask = |edits: Vec<Edit>, words: &str| {
        let mut edited = scene.clone();
        for edit in edits {
            edit.apply(&mut edited).unwrap();
        }
        assert_says(&why(shown.apply_scene(&edited).unwrap()), &[words]);
    };
    let block = node(&scene, "short block");
    let material = material_of(&scene, block);
    let preset = |preset: MaterialPreset| Edit::Material {
        material,
        to: Box::new(preset.applied_to(&scene.materials[material])),
    };
    ask(vec![preset(MaterialPreset::Glass)], "is not compiled in");
    let glossy = preset(MaterialPreset::Glossy);
    ask(vec![glossy], "gloss and metal is not compiled in");
    let torch = torch(None, LightKind::Point);
    ask(vec![torch], "point lights is not compiled in");
    let mut materials = scene.materials.iter();
    let lamp = materials
        .position(|material| material.is_emissive())
        .unwrap();
    let lamp_off = Edit::Material {
        material: lamp,
        to: Box::new(MaterialPreset::Diffuse.applied_to(&scene.materials[lamp])),
    };
    ask(vec![lamp_off], "no light is left");
    // A mesh's own material and a refused change: what is known of the mesh comes back.
    let own = Edit::OwnMaterial {
        mesh: scene.nodes[block].mesh.unwrap(),
        material,
    };
    ask(
        vec![own, preset(MaterialPreset::Metal)],
        "is not compiled in",
    );
    let mut other = scene.clone();
    other.meshes.pop();
    assert!(why(shown.apply_scene(&other).unwrap()).contains("other meshes"));
    // Refused, the renderer is as it was; and the scene itself is no change.
    assert!(image(&mut shown, &views, 0) == before);
    let none = in_place(shown.apply_scene(&scene).unwrap());
    assert!(!none.renumbered && none.uploaded_bytes == 0 && none.spare_features.is_empty());
    assert!(image(&mut shown, &views, 0) == before);
}

#[test]
fn undone_edits_show_the_first_picture_again() {
    let mut scene = builtin("sphere");
    let views = views(&scene);
    let settings = settings(|s| s.photon.count = 2048);
    let mut shown = renderer(&scene, &settings, SIZE);
    let before = image(&mut shown, &views, 0);
    let wall = node(&scene, "wall");
    let edits = vec![
        with_material(&scene, "wall", |m| m.base_color = [0.1, 0.7, 0.2, 1.0]),
        Edit::Duplicate {
            node: node(&scene, "lamp"),
        },
        shift(&scene, wall, DVec3::X * 0.1, 0.2, DVec3::new(1.0, 1.2, 1.0)),
    ];
    let undo = Edit::Several(edits).apply(&mut scene).unwrap();
    in_place(shown.apply_scene(&scene).unwrap());
    assert!(image(&mut shown, &views, 0) != before, "negative control");
    undo.apply(&mut scene).unwrap();
    in_place(shown.apply_scene(&scene).unwrap());
    assert!(image(&mut shown, &views, 0) == before);
}

/// Other paint and an instance that comes leave the noise of the pictures as small as it was, and show at once.
#[test]
fn history_is_kept_over_edits() {
    let mut scene = builtin("cornell");
    let views = views(&scene);
    let settings = settings(|s| {
        s.reconstruct.svgf = true.into();
        s.reconstruct.taa = true.into();
        s.reconstruct.still = true.into();
        s.photon.every_frame = true;
    });
    let mut shown = renderer(&scene, &settings, SIZE);
    play(&mut shown, &views, 0..16);
    let still = |shown: &Renderer| shown.reconstruction().unwrap().still_frames();
    assert_eq!(still(&shown), 16);
    let block = node(&scene, "short block");
    let raised = shift(&scene, block, DVec3::Y * 0.1, 0.0, DVec3::ONE);
    raised.apply(&mut scene).unwrap();
    in_place(shown.apply_scene(&scene).unwrap());
    play(&mut shown, &views, 16..17);
    assert_eq!(still(&shown), 1, "the mean of still frames begins anew");
    let name = scene.materials[material_of(&scene, block)].name.clone();
    let painted = with_material(&scene, &name, |m| m.base_color = [0.1, 0.7, 0.1, 1.0]);
    let copy = Edit::Duplicate { node: block };
    for edit in [painted, copy] {
        edit.apply(&mut scene).unwrap();
    }
    let beside = shift(
        &scene,
        scene.nodes.len() - 1,
        DVec3::Y * 0.4,
        0.0,
        DVec3::ONE,
    );
    beside.apply(&mut scene).unwrap();
    assert!(in_place(shown.apply_scene(&scene).unwrap()).renumbered);
    play(&mut shown, &views, 17..18);
    assert_eq!(still(&shown), 1);
    let edited = radiance(&shown, Eye::Left);
    let mut new = renderer(&scene, &settings, SIZE);
    play(&mut new, &views, 17..18);
    let first = radiance(&new, Eye::Left);
    play(&mut new, &views, 18..82);
    let converged = radiance(&new, Eye::Left);
    let error = |image: &[[f32; 3]]| {
        let pairs = image.as_flattened().iter().zip(converged.as_flattened());
        let squares = pairs.map(|(a, b)| f64::from(a.min(1.0) - b.min(1.0)).powi(2));
        squares.sum::<f64>()
    };
    let [edited, first] = [edited, first].map(|image| error(&image));
    // Frames that begin anew have the noise of one.
    assert!(edited < 0.5 * first, "{edited} of {first}");
}

/// A thousand more instances of the short block, whose mesh has its triangles `copies` times over.
fn crowd(copies: usize) -> Scene {
    let mut scene = builtin("cornell");
    let block = node(&scene, "short block");
    let mesh = scene.nodes[block].mesh.unwrap();
    let triangles = scene.meshes[mesh].triangles.clone();
    for _ in 1..copies {
        scene.meshes[mesh].triangles.extend_from_slice(&triangles);
    }
    for index in 0..1000 {
        let place = DVec3::new(f64::from(index % 32), 0.0, f64::from(index / 32)) * 0.02;
        scene.roots.push(scene.nodes.len());
        scene.nodes.push(Node {
            name: format!("block {index}"),
            parent_from_node: DAffine3::from_translation(place)
                * DAffine3::from_scale(DVec3::splat(0.02)),
            mesh: Some(mesh),
            ..Node::default()
        });
    }
    scene
}

#[test]
fn an_edit_uploads_in_proportion_to_instances_and_not_to_triangles() {
    let uploads = |copies: usize| {
        let mut scene = crowd(copies);
        let views = views(&scene);
        let settings = settings(|s| {
            s.method = Method::Path;
            s.reuse = Reuse::Off;
            s.path.max_depth = 2;
        });
        let mut shown = renderer(&scene, &settings, [8, 8]);
        image(&mut shown, &views, 0);
        let triangles = scene.triangle_count();
        let mut bytes = Vec::new();
        let moved = node(&scene, "block 500");
        let name = scene.materials[material_of(&scene, moved)].name.clone();
        let edits = [
            shift(&scene, moved, DVec3::Y * 0.1, 0.1, DVec3::ONE),
            with_material(&scene, &name, |m| m.base_color = [0.2, 0.3, 0.4, 1.0]),
            hide(moved),
            Edit::Duplicate {
                node: node(&scene, "block 7"),
            },
        ];
        for (frame, edit) in (1..).zip(edits) {
            edit.apply(&mut scene).unwrap();
            let done = in_place(shown.apply_scene(&scene).unwrap());
            image(&mut shown, &views, frame);
            bytes.push([done.uploaded_bytes, shown.scene().upload_bytes()]);
        }
        (triangles, bytes, scene.instances().len() as u64)
    };
    let [(few, coarse, instances), (many, fine, _)] = [1, 40].map(uploads);
    assert!(many > 20 * few, "{few} {many}");
    // Per instance a node of the upper hierarchy (64 bytes), a record (160), and lights. Larger meshes may have parts to open.
    let parts = 2 * MOST_OPENED as u64 * (112 + 64);
    for ([now, next], other) in fine.iter().zip(&coarse) {
        assert_eq!(*now, other[0]);
        assert!(*now <= 320, "one material at most: {now}");
        assert!(
            *next > 0 && *next <= (instances + 64) * 256 + parts,
            "{next}"
        );
        assert!(next.abs_diff(other[1]) <= parts, "{next} {other:?}");
    }
    assert_eq!([fine[0][0], fine[1][0]], [0, 320]);
}

#[test]
fn a_saved_scene_renders_the_same_picture() {
    let folder = Folder::new("saving-render");
    let mut document = Document::load("builtin:cornell").unwrap();
    edit_everything(&mut document, ["short block", "tall block", "ceiling"]);
    let path = folder.join("edited.glb");
    document.save(&path).unwrap();
    let read = Scene::load(&path).unwrap();
    let views = views(&read);
    let picture = |scene: &Scene| {
        let mut renderer = renderer(scene, &settings(|_| {}), SIZE);
        image(&mut renderer, &views, 0)
    };
    let saved = picture(&read);
    assert!(saved == picture(document.scene()));
    assert!(saved != picture(&builtin("cornell")), "negative control");
    // The program reads it too.
    assert_success(&stereolux(&["info", "--scene", path.to_str().unwrap()]));
}
