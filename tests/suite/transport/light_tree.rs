//! Lights picked for a point by what they may bring there (`shaders/shared/light_tree.wesl`).

use glam::{DAffine3, DVec3};
use stereolux::gpu::buffers::{read_buffer, storage_buffer, storage_buffer_with_data};
use stereolux::gpu::{
    FrameRecorder, GpuContext, Kernel, PassTimes, ShaderFeatures, ShaderLibrary, Workgroups,
};
use stereolux::renderer::{InstanceId, SceneBuffers, shader_features};
use stereolux::scene::{LightKind, Needs, Node, PunctualLight, Scene};
use stereolux::settings::RenderSettings;

use super::hard_support::{glowing, mesh, quad};
use super::support::context;
use crate::suite::frame::layout::changed;

const DRAWS: u32 = 1 << 16;
/// Lamps of two triangles each, which are a group, on a grid; behind them in the order of lights. Then come point lights between them.
const ROWS: usize = 6;
const SPACING_M: f64 = 2.0;
const POINTS: usize = 4;

/// Lights picked for a point with numbers at equal distances, how probable each was as it was picked, and each light at all.
const PROBE: &str = "
import package::shared::lights::{pick_light_for, pick_probability};
@group(0) @binding(20) var<storage, read> point: array<vec4<f32>>;
@group(0) @binding(21) var<storage, read_write> picks: array<vec2<f32>>;
@group(0) @binding(22) var<storage, read_write> probabilities: array<f32>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let draws = arrayLength(&picks);
    if id.x < draws {
        let pick = pick_light_for(point[0].xyz, (f32(id.x) + 0.5) / f32(draws));
        picks[id.x] = vec2<f32>(f32(pick.light), pick.probability);
    }
    if id.x < arrayLength(&probabilities) {
        probabilities[id.x] = pick_probability(id.x, point[0].xyz);
    }
}
";

fn at(place: DVec3) -> DAffine3 {
    DAffine3::from_translation(place)
}

fn lamp_place(lamp: usize) -> DVec3 {
    let (row, column) = (lamp / ROWS, lamp % ROWS);
    SPACING_M * DVec3::new(row as f64, 0.0, column as f64)
}

fn scene(has_sun: bool) -> Scene {
    let corner = DVec3::new(-0.03, 0.0, -0.03);
    let lamp = mesh(&quad(corner, 0.06 * DVec3::X, 0.06 * DVec3::Z), 0);
    let lamps = (0..ROWS * ROWS).map(|lamp| Node {
        parent_from_node: at(lamp_place(lamp)),
        ..Node::of_mesh(0)
    });
    let point = |light: usize| Node {
        light: Some(0),
        parent_from_node: at(lamp_place(ROWS * light) + DVec3::ONE),
        ..Node::default()
    };
    let mut nodes: Vec<Node> = lamps.chain((0..POINTS).map(point)).collect();
    let light = |kind, intensity| PunctualLight {
        name: String::new(),
        kind,
        intensity: [intensity; 3],
    };
    if has_sun {
        nodes.push(Node {
            light: Some(1),
            ..Node::default()
        });
    }
    Scene {
        materials: vec![glowing([1.0; 3])],
        roots: (0..nodes.len()).collect(),
        nodes,
        meshes: vec![lamp],
        lights: vec![
            light(LightKind::Point, 0.001),
            light(LightKind::Directional, 100.0),
        ],
        ..Scene::default()
    }
}

struct Picked {
    /// How often each light was picked, of [`DRAWS`].
    counts: Vec<f64>,
    /// The greatest relative difference between a pick's probability and that of its light.
    off: f64,
    probabilities: Vec<f64>,
}

/// What shaders pick for a point of the world, with the head at `origin`.
fn picked(
    context: &GpuContext,
    library: &ShaderLibrary,
    scene: &Scene,
    buffers: &mut SceneBuffers,
    [origin, point]: [DVec3; 2],
) -> Picked {
    let mut library = library.clone();
    library.insert("tests/light_tree_probe", PROBE);
    let features = features_of(scene);
    let kernel = Kernel::new(context, &library, "tests/light_tree_probe", &features).unwrap();
    buffers.begin_frame(context, origin).unwrap();
    let in_render = (point - origin).as_vec3().extend(0.0).to_array();
    let point = storage_buffer_with_data(context, "point", &[in_render]).unwrap();
    let picks = storage_buffer(context, "picks", u64::from(DRAWS) * 8).unwrap();
    let lights = buffers.light_count();
    let probabilities = storage_buffer(context, "probabilities", 4 * lights as u64).unwrap();
    let resources = buffers
        .resources()
        .with("point", &point)
        .with("picks", &picks)
        .with("probabilities", &probabilities);
    let bound = kernel.interface.bind(context, &resources).unwrap();
    let mut recorder = FrameRecorder::new(context, None, "probe");
    let groups = Workgroups::Direct(kernel.groups_for(DRAWS));
    recorder.dispatch("probe", &kernel, &bound, 0, groups);
    recorder.submit("probe", &mut PassTimes::default()).unwrap();
    let probabilities: Vec<f32> =
        read_buffer(context, "probabilities", &probabilities, lights).unwrap();
    let picks: Vec<[f32; 2]> = read_buffer(context, "picks", &picks, DRAWS as usize).unwrap();
    let mut counts = vec![0.0; lights];
    let mut off = 0.0f64;
    for [light, probability] in picks {
        counts[light as usize] += 1.0;
        off = off.max(f64::from(
            (probability / probabilities[light as usize] - 1.0).abs(),
        ));
    }
    Picked {
        counts,
        off,
        probabilities: probabilities.into_iter().map(f64::from).collect(),
    }
}

fn features_of(scene: &Scene) -> ShaderFeatures {
    shader_features(&Needs::of(scene), &RenderSettings::default())
}

/// Why what was picked is not as probable as it should be.
fn fault(picked: &Picked) -> Option<String> {
    let total: f64 = picked.probabilities.iter().sum();
    // A product of some 10 factors, each rounded by 2^-24, of each of 77 lights.
    if (total - 1.0).abs() > 1e-5 || picked.off > 1e-5 {
        return Some(format!("{total} in all, {} off", picked.off));
    }
    let numbers = picked.counts.iter().zip(&picked.probabilities);
    let expected = numbers.map(|(count, probability)| (count, probability * f64::from(DRAWS)));
    // A light has the numbers of one interval, or of two in a group of several: each end is one off, and rounding.
    let mut wrong = expected.filter(|(count, expected)| (*count - expected).abs() > 5.0);
    wrong
        .next()
        .map(|(count, expected)| format!("{count} times, not {expected}"))
}

#[test]
fn lights_are_picked_for_a_point_as_probably_as_they_say() {
    let context = context();
    let library = ShaderLibrary::embedded();
    for has_sun in [false, true] {
        let scene = scene(has_sun);
        let mut buffers = SceneBuffers::new(&context, &scene, &features_of(&scene)).unwrap();
        let leading = POINTS + usize::from(has_sun);
        // Which light a lamp's first triangle is.
        let light_of = |lamp: usize| leading + 2 * lamp;
        let below = |lamp| lamp_place(lamp) - 0.5 * DVec3::Y;
        // From near and far, and from where the head is far away.
        let pairs = [
            [DVec3::ZERO, below(8)],
            [below(20), below(20)],
            [DVec3::ONE, DVec3::new(5.0, -40.0, 3.0)],
            [DVec3::new(3e3, 0.0, -1e3), below(8)],
        ];
        let ask = |buffers: &mut SceneBuffers, places| {
            picked(&context, &library, &scene, buffers, places)
        };
        for places in pairs {
            let picked = ask(&mut buffers, places);
            assert_eq!(fault(&picked), None, "{places:?}");
            if has_sun {
                // The sun's record lies behind the points'.
                let sun = picked.probabilities[POINTS];
                assert!((0.25..=0.75).contains(&sun), "{sun}");
            }
        }
        // The nearest lamp of 36: half a metre away, where the next are two. By power each has less than a 36th.
        let of_lamps = if has_sun { 0.25 } else { 1.0 };
        let share = |picked: &Picked, lamp: usize| {
            let first = light_of(lamp);
            picked.probabilities[first..first + 2].iter().sum::<f64>() / of_lamps
        };
        let near = share(&ask(&mut buffers, pairs[0]), 8);
        assert!(near > 0.3, "{near}");
        // It goes elsewhere, and takes its light along.
        let moved = DVec3::new(-7.0, 1.0, 30.0);
        let place = [DVec3::ZERO, moved - 0.5 * DVec3::Y];
        assert!(share(&ask(&mut buffers, place), 8) < 0.1);
        assert!(buffers.place_instance(InstanceId(8), at(moved)));
        let picked = ask(&mut buffers, place);
        assert_eq!(fault(&picked), None);
        assert!(share(&picked, 8) > 0.8, "{}", share(&picked, 8));
        let left = ask(&mut buffers, pairs[0]);
        println!("{has_sun} {:?}", left.probabilities);
        assert!(share(&left, 8) < 0.1, "{}", share(&left, 8));
        // And is gone.
        assert!(buffers.remove_instance(InstanceId(8)));
        let picked = ask(&mut buffers, place);
        assert_eq!(fault(&picked), None);
        assert_eq!(share(&picked, 8), 0.0);
    }
}

#[test]
fn few_lamps_and_lamps_at_one_place_have_their_chance_beside_the_sun() {
    let context = context();
    let library = ShaderLibrary::embedded();
    for lamps in [1, 5] {
        let mut scene = scene(true);
        // The lamps of triangles are what the sun shines on.
        scene.materials[0].emission = [0.0; 3];
        scene.nodes.retain(|node| node.light != Some(0));
        let lamp = Node {
            light: Some(0),
            parent_from_node: at(DVec3::Y),
            ..Node::default()
        };
        scene.nodes.extend((0..lamps).map(|_| lamp.clone()));
        scene.roots = (0..scene.nodes.len()).collect();
        scene.lights[1].intensity = [1e6; 3];
        let mut buffers = SceneBuffers::new(&context, &scene, &features_of(&scene)).unwrap();
        let picked = picked(&context, &library, &scene, &mut buffers, [DVec3::ZERO; 2]);
        assert_eq!(fault(&picked), None);
        // All lamps together, however weak they are.
        let sun = picked.probabilities[0];
        assert!((sun - 0.75).abs() < 1e-6, "{lamps}: {sun}");
    }
}

#[test]
fn a_pick_that_misjudges_its_probability_is_noticed() {
    let context = context();
    let scene = scene(true);
    let mut buffers = SceneBuffers::new(&context, &scene, &features_of(&scene)).unwrap();
    let places = [DVec3::ZERO, lamp_place(8) - 0.5 * DVec3::Y];
    for (right, wrong) in [
        ("probability *= own;", "probability *= share;"),
        (
            "left = min(select(left - share, left, is_second) / own",
            "left = min(left / own",
        ),
        (
            "var probability = bitcast<f32>(group.y);",
            "var probability = 1.0;",
        ),
    ] {
        let wrong = changed("shared/light_tree", right, wrong);
        let picked = picked(&context, &wrong, &scene, &mut buffers, places);
        assert!(fault(&picked).is_some(), "{right}");
    }
}
