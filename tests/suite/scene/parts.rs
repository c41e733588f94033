//! Scenes that are added to the one shown and taken out again: frames are those of a renderer made from the whole, and what
//! they took comes back.

use std::path::Path;

use glam::{DAffine3, DVec3};
use stereolux::gpu::ShaderLibrary;
use stereolux::renderer::{Applied, Renderer};
use stereolux::scene::edit::{Edit, NewContent, NewNode, Placement};
use stereolux::scene::{Scene, ScenePart};
use stereolux::settings::{Force, Method, RenderSettings, Reuse};
use stereolux::xr::View;

use super::adding_example::ball;
use super::edited_frames::{assert_same, image};
use super::support::{
    assert_says, assert_success, builtin, parallel_views, renderer, resident_kb, settings,
    square_fov, words,
};
use super::trace_probe::Random;

const SIZE: [u32; 2] = [48, 48];

type Image = [Vec<[u32; 3]>; 2];

fn is_in_place(applied: &Applied) -> bool {
    matches!(applied, Applied::InPlace(_))
}

/// A scene that is shown, and what comes and goes.
struct Live {
    scene: Scene,
    settings: RenderSettings,
    views: [View; 2],
    renderer: Renderer,
}

impl Live {
    fn new(scene: Scene, settings: RenderSettings) -> Self {
        let views = parallel_views(scene.start_pose(), 0.06, square_fov(35.0));
        let mut renderer = renderer(&scene, &settings, SIZE);
        image(&mut renderer, &views, 0);
        Self {
            scene,
            settings,
            views,
            renderer,
        }
    }

    fn add(&mut self, part: Scene, at: DVec3, scale: f64) -> (ScenePart, Applied) {
        // As an application does it: on another thread.
        let preparation = self.renderer.part_preparation();
        let (part, prepared) = std::thread::spawn(move || {
            let prepared = preparation.prepare(&part).unwrap();
            (part, prepared)
        })
        .join()
        .unwrap();
        let (scale, turn) = (DVec3::splat(scale), glam::DQuat::from_rotation_y(0.4));
        let to = DAffine3::from_scale_rotation_translation(scale, turn, at);
        let added = self.scene.add_part(part, "added", None, Placement::of(to));
        let added = added.unwrap();
        let applied = self.renderer.add_part(&self.scene, &added, &prepared);
        (added, applied.unwrap())
    }

    fn added(&mut self, part: Scene, at: DVec3, scale: f64) -> ScenePart {
        let (added, applied) = self.add(part, at, scale);
        assert!(is_in_place(&applied), "{applied:?}");
        added
    }

    fn remove(&mut self, part: &ScenePart) {
        self.scene.remove_part(part).unwrap();
        let applied = self.renderer.remove_part(&self.scene, part).unwrap();
        assert!(is_in_place(&applied), "{applied:?}");
    }

    fn shown(&mut self) -> Image {
        image(&mut self.renderer, &self.views, 0)
    }

    /// The next frame is that of a new renderer, bit for bit.
    fn check(&mut self, what: &str) -> Image {
        let shown = self.shown();
        let mut new = renderer(&self.scene, &self.settings, SIZE);
        assert_eq!(new.features(), self.renderer.features(), "{what}");
        let wanted = image(&mut new, &self.views, 0);
        assert_same(&shown, &wanted, what);
        shown
    }

    /// Bytes of the scene's buffers on the device.
    fn bytes(&self) -> u64 {
        let resources = self.renderer.scene().resources();
        let names = words("mesh_nodes triangles triangle_vertices vertices texture_infos texels");
        let size = |name| match resources.get(name) {
            Some(wgpu::BindingResource::Buffer(binding)) => binding.buffer.size(),
            _ => 0,
        };
        names.into_iter().map(size).sum()
    }
}

/// A ball that needs shaders of its own.
fn shiny() -> Scene {
    let mut shiny = ball(8, 0.0);
    shiny.materials[0].specular = 1.0;
    shiny.materials[0].roughness = 0.2;
    shiny
}

fn middle(scene: &Scene) -> DVec3 {
    scene.bounds_in_world().unwrap().center()
}

fn path() -> RenderSettings {
    settings(|s| {
        s.method = Method::Path;
        s.reuse = Reuse::Off;
        s.path.max_depth = 4;
    })
}

#[test]
fn what_is_added_is_shown_as_if_it_had_always_been_there() {
    for settings in [settings(|_| {}), path()] {
        let scene = builtin("cornell");
        let mut live = Live::new(scene.clone(), settings);
        let empty = live.shown();
        let front = middle(&live.scene);
        let small = live.added(ball(6, 0.0), front + DVec3::new(-0.3, 0.2, 0.0), 0.15);
        let one = live.check("a ball");
        assert!(one != empty, "negative control");
        let lamp = live.added(ball(4, 2.0), front + DVec3::new(0.3, 0.3, 0.0), 0.1);
        live.check("a ball that shines");
        let room = live.added(builtin("cornell"), front + DVec3::new(0.1, -0.3, -0.2), 0.3);
        let all = live.check("another box with its own lamp");
        live.renderer.scene().hierarchies().validate().unwrap();
        // An edit of what was added.
        let hide = |live: &mut Live, is_hidden| {
            let node = room.root();
            let edit = Edit::Visibility { node, is_hidden };
            edit.apply(&mut live.scene).unwrap();
            let applied = live.renderer.apply_scene(&live.scene).unwrap();
            assert!(is_in_place(&applied), "{applied:?}");
        };
        hide(&mut live, true);
        live.check("hidden");
        hide(&mut live, false);
        assert!(live.shown() == all);
        // Out of the middle, and something larger and something smaller for its place.
        live.remove(&lamp);
        live.check("without the lamp");
        let large = live.added(ball(7, 1.0), front + DVec3::new(0.3, 0.3, 0.0), 0.1);
        let tiny = live.added(ball(3, 3.0), front + DVec3::new(0.3, -0.1, 0.2), 0.1);
        live.check("two balls, one of them where the lamp lay");
        for part in [&room, &tiny, &large, &small] {
            live.remove(part);
        }
        assert!(live.shown() == empty);
        assert_eq!(live.scene, scene);
    }
}

/// Whatever is added and removed, in whatever order.
#[test]
fn any_order_of_coming_and_going_leaves_the_same_picture() {
    let scene = builtin("cornell");
    let mut live = Live::new(scene.clone(), path());
    let front = middle(&live.scene);
    let mut random = Random(9);
    let mut held: Vec<ScenePart> = Vec::new();
    for step in 0..24 {
        if held.len() < 2 || (random.unit() < 0.55 && held.len() < 6) {
            let rings = 2 + random.below(9) as u32;
            let at = front + 0.4 * random.vector();
            let emission = random.below(2) as f32;
            held.push(live.added(ball(rings, emission), at, 0.08));
        } else {
            let gone = held.swap_remove(random.below(held.len()));
            live.remove(&gone);
        }
        if step % 6 == 5 {
            live.check(&format!("step {step}"));
        }
    }
    for part in held {
        live.remove(&part);
    }
    assert_eq!(live.scene, scene);
}

#[test]
fn textures_come_along() {
    let settings = settings(|s| {
        s.method = Method::Path;
        s.reuse = Reuse::Off;
        s.force.textures = Force::On;
        s.force.glossy = Force::On;
        s.force.dielectric = Force::On;
        s.force.normal_maps = Force::On;
        s.force.alpha = Force::On;
        s.force.vertex_colors = Force::On;
        s.force.caustics = Force::Off;
    });
    let load = |name: &str| Scene::load(Path::new("tests/reference").join(name)).unwrap();
    let scene = load("textures.gltf");
    let mut live = Live::new(scene.clone(), settings);
    let empty = live.shown();
    let forward = live.views[0].orientation * DVec3::NEG_Z;
    let front = live.views[0].position_in_world + 2.0 * forward;
    let dark = |name: &str| {
        let mut part = load(name);
        // Lights of kinds that the scene has not are another matter.
        part.lights.clear();
        for node in &mut part.nodes {
            node.light = None;
        }
        part
    };
    let first = live.added(dark("textures.gltf"), front, 0.2);
    let with_textures = live.check("textures");
    assert!(with_textures != empty);
    let second = live.added(dark("alpha.gltf"), front + DVec3::Y * 0.3, 0.2);
    live.check("and alpha");
    live.remove(&second);
    live.check("without it");
    let third = live.added(dark("normal_map.gltf"), front + DVec3::Y * 0.3, 0.2);
    live.check("normal maps where it lay");
    live.remove(&first);
    live.check("and alone");
    live.remove(&third);
    assert!(live.shown() == empty);
    assert_eq!(live.scene, scene);
}

#[test]
fn what_the_shaders_lack_is_refused_and_changes_nothing() {
    let mut live = Live::new(builtin("cornell"), path());
    let empty = live.shown();
    let bytes = live.bytes();
    let front = middle(&live.scene);
    let (part, applied) = live.add(shiny(), front, 0.2);
    let Applied::NeedsRebuild { why } = applied else {
        panic!("cornell has no glossy surfaces");
    };
    assert!(why.contains("compiled in"), "{why}");
    assert!(live.shown() == empty);
    // A buffer shrinks when it has more than double of what it needs.
    assert!(live.bytes() <= 2 * bytes);
    live.scene.remove_part(&part).unwrap();
    let unknown = live.renderer.remove_part(&live.scene, &part).unwrap();
    assert!(!is_in_place(&unknown));
    // Two parts at once, of which one is told of.
    let to = || Placement::of(DAffine3::from_translation(front));
    let preparation = live.renderer.part_preparation();
    let prepared = preparation.prepare(&ball(3, 0.0)).unwrap();
    let [one, two] = ["one", "two"].map(|name| {
        let added = live.scene.add_part(ball(3, 0.0), name, None, to());
        added.unwrap()
    });
    for part in [&one, &two] {
        let applied = live.renderer.add_part(&live.scene, part, &prepared);
        assert!(!is_in_place(&applied.unwrap()));
    }
    live.scene.remove_part(&two).unwrap();
    let applied = live
        .renderer
        .add_part(&live.scene, &one, &prepared)
        .unwrap();
    assert!(is_in_place(&applied), "{applied:?}");
    live.check("after all that");
    // What another part shows stays.
    let shared = Edit::Add {
        parent: None,
        node: NewNode {
            name: "shares".to_owned(),
            to: to(),
            content: NewContent::Mesh(one.meshes.start),
        },
    };
    let undo = shared.apply(&mut live.scene).unwrap();
    let refused = live.scene.remove_part(&one).unwrap_err().to_string();
    assert_says(&refused, &["shares", "one"]);
    undo.apply(&mut live.scene).unwrap();
    live.remove(&one);
    assert!(live.scene.remove_part(&one).is_err());
    assert!(live.shown() == empty);
    // Nor is what has its numbers now.
    let next = live.added(ball(3, 0.0), front, 0.2);
    assert_eq!(next.nodes.start, one.nodes.start);
    assert!(live.scene.remove_part(&one).is_err());
    assert!(live.shown() != empty);
    live.remove(&next);
}

/// What needs other shaders: a renderer made on another thread takes over at the frame that the application chooses.
#[test]
fn a_renderer_made_on_a_thread_takes_over() {
    for settings in [settings(|s| s.spp = 2), path()] {
        let mut live = Live::new(builtin("cornell"), settings);
        let front = middle(&live.scene);
        let (part, applied) = live.add(shiny(), front, 0.2);
        assert!(!is_in_place(&applied));
        let (rebuild, scene) = (live.renderer.rebuild(), live.scene.clone());
        let made = std::thread::spawn(move || rebuild.build(&ShaderLibrary::embedded(), &scene));
        // Frames go on, one of them is still on its way when the other takes over.
        let empty = live.shown();
        let flight = live.renderer.send_frame(&live.views, 0, |_| {}).unwrap();
        let made = made.join().unwrap().unwrap();
        live.renderer.succeed_by(made).unwrap();
        live.renderer.retire(flight).unwrap();
        assert!(live.check("a shiny ball") != empty);
        // It takes parts of its own, and none that it was made with.
        let more = live.added(ball(5, 0.0), front + DVec3::X * 0.3, 0.1);
        live.check("and another");
        live.remove(&more);
        live.scene.remove_part(&part).unwrap();
        let applied = live.renderer.remove_part(&live.scene, &part).unwrap();
        assert!(!is_in_place(&applied));
    }
}

#[test]
fn a_renderer_that_takes_over_plays_what_played_and_nothing_else() {
    let scene = builtin("parade");
    let mut unmoved = scene.clone();
    unmoved.animations.clear();
    let taken_over = |clip: &str, played: Option<&str>, first: &Scene| {
        let mut live = Live::new(
            first.clone(),
            settings(|s| s.animation.clip = clip.to_owned()),
        );
        if let Some(name) = played {
            live.renderer.play_clip(first, name, 1.0, 0.0, 0).unwrap();
        }
        let made = live
            .renderer
            .rebuild()
            .build(&ShaderLibrary::embedded(), &scene);
        live.renderer.succeed_by(made.unwrap()).unwrap();
        live.renderer.clip().map(|(name, _)| name.to_owned())
    };
    assert_eq!(taken_over("", None, &unmoved), None);
    assert_eq!(taken_over("none", None, &scene), None);
    assert_eq!(
        taken_over("none", Some("wave"), &scene).as_deref(),
        Some("wave")
    );
    assert_eq!(
        taken_over("", Some("wave"), &scene).as_deref(),
        Some("wave")
    );
}

#[test]
fn many_additions_leave_no_memory_behind() {
    // Memory is the process's, so it has one of its own.
    const ALONE: &str = "STEREOLUX_TEST_ALONE";
    if std::env::var_os(ALONE).is_none() {
        let name = "suite::scene::parts::many_additions_leave_no_memory_behind";
        let mut alone = std::process::Command::new(std::env::current_exe().unwrap());
        let alone = alone.args(["--exact", name, "--nocapture"]).env(ALONE, "1");
        let output = alone.output().unwrap();
        assert_success(&output);
        assert_says(&String::from_utf8_lossy(&output.stdout), &["1 passed"]);
        return;
    }
    let scene = builtin("cornell");
    let mut live = Live::new(scene.clone(), path());
    let empty = live.shown();
    let front = middle(&live.scene);
    // 22,500 triangles: 3 MB on either side.
    let part = ball(75, 0.0);
    let mut seen = Vec::new();
    for _ in 0..150 {
        let added = live.added(part.clone(), front, 0.2);
        image(&mut live.renderer, &live.views, 0);
        let most = live.bytes();
        live.remove(&added);
        image(&mut live.renderer, &live.views, 0);
        seen.push((most, live.bytes(), resident_kb("self")));
    }
    assert!(live.shown() == empty);
    assert_eq!(live.scene, scene);
    let (most, least, _) = seen[0];
    assert!(most > least + 3_000_000);
    assert!(seen.iter().all(|(m, l, _)| (*m, *l) == (most, least)));
    // A part that stayed would take 3 MB each time. Allocators give back in their own time, so ten are compared with those
    // fifty earlier, by their least: half a part may differ. And they take memory in blocks, once when two uploads happen to
    // overlap (4 MB, after any addition): what stays each time shows in both pairs, such a block in one.
    let least_of = |range: std::ops::Range<usize>| seen[range].iter().map(|s| s.2).min().unwrap();
    let least = [40..50, 90..100, 140..150].map(least_of);
    let stays = least.windows(2).all(|pair| pair[1] >= pair[0] + 1500);
    assert!(!stays, "{least:?} kB");
}
