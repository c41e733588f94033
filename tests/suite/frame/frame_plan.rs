//! The plan is what runs: its passes in its order, every name bound, nothing written that is read.

use std::collections::{BTreeMap, BTreeSet};

use stereolux::frame::bind::meaning;
use stereolux::frame::buffers::row;
use stereolux::frame::homes::{Home, Homes, settle};
use stereolux::frame::listing::{memory, uses};
use stereolux::frame::plan::on_demand;
use stereolux::frame::run::{named, specialised};
use stereolux::frame::step::Action;
use stereolux::frame::{ImageLayout, PlannedStage, SAMPLES_PER_SUBMISSION, Stage, Step};
use stereolux::gpu::kernel::{BindingKind, reflect_bindings};
use stereolux::gpu::{ShaderFeatures, ShaderLibrary};
use stereolux::renderer::{PlannedScene, Renderer, plan_of_scene};
use stereolux::settings::{
    DirectLight, Force, Loads, Method, PhotonEstimate, RenderSettings, Reuse, Schedule, Search,
};

use super::deforming::torn;
use super::support::{
    assert_says, both_bits, builtin, parallel_views, renderer, square_fov, start_views, words,
};

type Change = fn(&mut RenderSettings);

/// Every way a frame can be rendered, one change at a time.
const WAYS: &[(&str, Change)] = &[
    ("photons", |_| ()),
    ("paths", |s| s.method = Method::Path),
    ("paths by themselves", |s| {
        s.method = Method::Path;
        s.reuse = Reuse::Off;
    }),
    ("no reuse", |s| s.reuse = Reuse::Off),
    ("lookup", |s| s.reuse = Reuse::Lookup),
    ("direct from the map", |s| {
        s.photon.direct = DirectLight::Map
    }),
    ("kd-tree", |s| s.photon.search = Search::KdTree),
    ("nearest", |s| s.photon.estimate = PhotonEstimate::Nearest),
    ("nearest in a kd-tree", |s| {
        s.photon.search = Search::KdTree;
        s.photon.estimate = PhotonEstimate::Nearest;
    }),
    ("cooperative", |s| s.photon.loads = Loads::Cooperative),
    ("fused", |s| s.photon.schedule = Schedule::Fused),
    ("half rate", |s| s.photon.half_rate = true.into()),
    ("half rate without reuse", |s| {
        s.photon.half_rate = true.into();
        s.reuse = Reuse::Off;
    }),
    ("shares", |s| s.photon.shares = 3),
    ("filtered", |s| s.reconstruct.svgf = true.into()),
    ("filtered, eyes apart", |s| {
        s.reconstruct.svgf = true.into();
        s.reconstruct.stereo = false;
        s.reconstruct.atrous_passes = 0.into();
    }),
    ("no filter passes", |s| {
        s.reconstruct.atrous_passes = 0.into();
    }),
    ("three filter passes", |s| {
        s.reconstruct.atrous_passes = 3.into();
    }),
    ("everything shown", |s| {
        s.reconstruct.svgf = true.into();
        s.reconstruct.taa = true.into();
        s.reconstruct.still = true.into();
        s.reuse = Reuse::Lookup;
    }),
    ("parts and motion", |s| {
        s.output.parts = true;
        s.output.motion = true;
    }),
    ("plain buffers", |s| s.force.record_texels = Force::Off),
    ("texels", |s| s.force.record_texels = Force::On),
    ("wide groups", |s| s.force.wide_machine = Force::On),
];

fn settings(change: Change) -> RenderSettings {
    let mut settings = RenderSettings::default();
    settings.photon.count = 400;
    settings.spp = 2;
    change(&mut settings);
    settings
}

/// What shaders are given besides the frame's own buffers.
fn is_given(name: &str) -> bool {
    // Of the frame, of the scene, of what deforms in it, and of what is shown of it.
    const GIVEN: &str = "frame dispatch reconstruction previous_instances previous_positions \
        top_nodes mesh_nodes instances triangles triangle_vertices vertices materials texture_infos texels \
        lights light_alias environment_map environment_cdf \
        rest_vertices deform_meshes morph_deltas morph_weights joint_rows deformed_positions deformed_triangles \
        refit_nodes refit_costs submission mirror still";
    words(GIVEN).contains(&name) || name.ends_with("_texels")
}

/// What is wrong with a step: names that mean nothing, two bindings of one slot, buffers that it both reads and writes.
fn faults(step: &Step, features: &ShaderFeatures, library: &ShaderLibrary) -> Vec<String> {
    let Some(pass) = step.pass() else {
        return Vec::new();
    };
    let features = specialised(pass, features, step.runs_from_list());
    let shader = library.compile(&pass.shader_name(), &features).unwrap();
    let bindings = reflect_bindings(&shader).unwrap();
    let mut faults = Vec::new();
    let (mut read, mut written, mut slots) = (Vec::new(), Vec::new(), BTreeSet::new());
    for binding in &bindings {
        if !slots.insert(binding.slot) {
            faults.push(format!("{}: slot {} twice", step.label, binding.slot));
        }
        let name = named(step, &binding.name);
        if is_given(&name) {
            continue;
        }
        let Some(found) = meaning(&name, step.owner) else {
            faults.push(format!("{}: {name} means nothing", step.label));
            continue;
        };
        match binding.kind {
            BindingKind::ReadWrite => written.push((found.place, found.is_before)),
            _ => read.push((found.place, found.is_before)),
        }
    }
    let both = written.iter().filter(|place| read.contains(place));
    faults.extend(both.map(|place| format!("{}: reads and writes {place:?}", step.label)));
    faults
}

fn planned(settings: &RenderSettings, scene: &str) -> (Vec<PlannedStage>, ShaderFeatures) {
    let scene = builtin(scene);
    let PlannedScene {
        mut stages,
        features,
        ..
    } = plan_of_scene(&scene, settings, true).unwrap();
    stages.extend(on_demand(settings));
    (stages, features)
}

#[test]
fn every_name_of_every_plan_means_a_buffer_and_no_pass_writes_what_it_reads() {
    let library = ShaderLibrary::embedded();
    let mut seen = BTreeSet::new();
    for (way, change) in WAYS {
        for scene in ["gallery", "cornell"] {
            let (stages, features) = planned(&settings(*change), scene);
            for step in stages.iter().flat_map(|stage| &stage.steps) {
                // A step that was judged in another plan is judged alike.
                if seen.insert(format!("{step:?} {features:?}")) {
                    let faults = faults(step, &features, &library);
                    assert!(faults.is_empty(), "{way} in {scene}: {faults:?}");
                }
            }
        }
    }
}

/// Steps of two frames of one sample or two, with their parities; the second one's eyes see the same in its last sample.
fn two_frames<'a>(stages: &'a [PlannedStage], features: &ShaderFeatures) -> Vec<(usize, &'a Step)> {
    let of = |stage| stages.iter().find(|planned| planned.stage == stage);
    let frame = |parity: usize, last| {
        let first = [Stage::Left, Stage::Right]
            .into_iter()
            .filter(|_| !features.one_sample);
        let samples = [Stage::Begin]
            .into_iter()
            .chain(first)
            .chain([Stage::Left, last]);
        let steps = samples.chain([Stage::Reconstruct]);
        let steps = steps.filter_map(of).flat_map(|planned| &planned.steps);
        steps.map(move |step| (parity, step)).collect::<Vec<_>>()
    };
    let equal = of(Stage::RightEqual).map_or(Stage::Right, |equal| equal.stage);
    [frame(0, Stage::Right), frame(1, equal)].concat()
}

/// Passes that read an image whose memory another one has been written to since.
fn read_too_late(stages: &[PlannedStage], homes: &Homes, features: &ShaderFeatures) -> Vec<String> {
    let library = ShaderLibrary::embedded();
    let takes_turns = |name| row(name).is_some_and(|row| row.takes_turns());
    let mut holds = BTreeMap::new();
    let mut faults = Vec::new();
    for (parity, step) in two_frames(stages, features) {
        let Some(pass) = step.pass() else { continue };
        let features = specialised(pass, features, step.runs_from_list());
        let shader = library.compile(&pass.shader_name(), &features).unwrap();
        for binding in reflect_bindings(&shader).unwrap() {
            let name = named(step, &binding.name);
            let Some(found) = meaning(&name, step.owner) else {
                continue;
            };
            let (host, is_before) = match homes.of(&found.place) {
                Home::Own => (Ok(found.place), found.is_before),
                Home::In { host, is_before } => (Ok(host), is_before),
                Home::Turn(index) => (Err(index), false),
            };
            let turn = match host {
                Ok(host) if takes_turns(host.1) => parity ^ usize::from(is_before),
                _ => 0,
            };
            if binding.kind == BindingKind::ReadWrite {
                holds.insert((host, turn), found.place);
            } else if holds
                .get(&(host, turn))
                .is_some_and(|held| *held != found.place)
            {
                faults.push(format!("{} reads {name}", step.label));
            }
        }
    }
    faults
}

#[test]
fn images_that_share_memory_are_read_before_another_one_is_written_there() {
    let library = ShaderLibrary::embedded();
    let image = ImageLayout {
        size: [8, 8],
        ..ImageLayout::default()
    };
    for (way, change) in WAYS {
        for scene in ["gallery", "cornell"] {
            let settings = settings(*change);
            let planned = plan_of_scene(&builtin(scene), &settings, true).unwrap();
            let (stages, features) = (planned.stages, planned.features);
            let used = uses(&stages, &features, &library).unwrap();
            let homes = settle(&used, [], &image, &planned.maps);
            let faults = read_too_late(&stages, &homes, &features);
            assert!(faults.is_empty(), "{way} in {scene}: {faults:?}");
            let mut torn = stages.clone();
            let one = torn.iter_mut().find(|planned| planned.stage == Stage::Left);
            one.unwrap().steps.reverse();
            if settings.method == Method::Photon {
                let faults = read_too_late(&torn, &homes, &features);
                assert!(!faults.is_empty(), "{way} in {scene}");
            }
        }
    }
}

#[test]
fn images_are_the_same_whether_they_share_memory_or_not() {
    let scene = builtin("cornell");
    let views = start_views(&scene, 60.0);
    // More samples than one submission takes, and photons between samples.
    for (way, spp) in [
        ("photons", 1),
        ("paths", SAMPLES_PER_SUBMISSION + 1),
        ("half rate", 1),
        ("photons", 2),
        ("lookup", 1),
        ("filtered, eyes apart", 1),
        ("no filter passes", 1),
        ("three filter passes", 1),
    ] {
        let mut settings = settings(WAYS.iter().find(|(name, _)| *name == way).unwrap().1);
        settings.spp = spp;
        settings.photon.every_frame = way == "photons";
        settings.photon.progressive = spp == 2;
        for part in [
            &mut settings.reconstruct.svgf,
            &mut settings.reconstruct.taa,
            &mut settings.reconstruct.still,
        ] {
            *part = true.into();
        }
        let [mut shared, mut apart] = [(); 2].map(|()| renderer(&scene, &settings, [24, 16]));
        apart.keep_images_apart();
        // What is left of other images is a number that matters (NaN, say) only now and then.
        for frame in 0..16 {
            let [a, b] = [&mut shared, &mut apart].map(|renderer| {
                renderer.render_frame(&views, frame, |_| {}).unwrap();
                both_bits(renderer)
            });
            assert!(a == b, "{way}, frame {frame}");
        }
        assert!(shared.frame_bytes() < apart.frame_bytes());
    }
}

#[test]
fn memory_is_counted_as_it_is_allocated() {
    let size = [40, 24];
    for way in ["photons", "paths", "half rate", "everything shown"] {
        let change = WAYS.iter().find(|(name, _)| *name == way).unwrap().1;
        let mut settings = settings(change);
        // Copies in textures have whole rows.
        settings.force.record_texels = Force::Off;
        for name in ["cornell", "gallery"] {
            let scene = builtin(name);
            let renderer = renderer(&scene, &settings, size);
            let planned = plan_of_scene(&scene, &settings, true).unwrap();
            let library = ShaderLibrary::embedded();
            let plans = [&planned.stages].into_iter().chain(&planned.lower);
            let counted = memory(plans, &planned.features, &library, size, &planned.maps).unwrap();
            let allocated = renderer.frame_bytes();
            assert_eq!(counted.total_bytes, allocated, "{way} in {name}");
            let parts = counted.eyes_bytes + counted.shared_bytes + counted.photons_bytes;
            assert_eq!(parts, counted.total_bytes);
        }
    }
}

#[test]
fn a_wrong_name_and_a_pass_that_writes_what_it_reads_are_found() {
    let library = ShaderLibrary::embedded();
    let (stages, features) = planned(&settings(|s| s.reconstruct.svgf = true.into()), "cornell");
    let atrous = |step: &&Step| step.label == "reconstruction.left.svgf_atrous";
    let mut steps = stages.iter().flat_map(|stage| &stage.steps);
    let step = steps.find(atrous).unwrap();
    assert!(faults(step, &features, &library).is_empty());
    let renamed = |shader: &'static str, buffer: &'static str| {
        let mut step = step.clone();
        if let Action::Run { names, .. } = &mut step.action {
            names.push((shader, buffer));
        }
        faults(&step, &features, &library)
    };
    let unknown = renamed("light_to", "light_pung");
    assert_says(&unknown[0], &["light_pung means nothing"]);
    let from = named(step, "light_from");
    let same = renamed("light_to", Box::leak(from.into_boxed_str()));
    assert!(same[0].contains("reads and writes"), "{same:?}");
}

/// Labels of the passes of a stage, as often as they run.
fn labels(stages: &[PlannedStage], stage: Stage) -> Vec<String> {
    let planned = stages.iter().filter(|planned| planned.stage == stage);
    let steps = planned.flat_map(|planned| &planned.steps);
    let steps = steps.filter(|step| step.pass().is_some());
    steps.map(|step| step.label.clone()).collect()
}

/// Renders two frames and compares the dispatches with the plan.
fn runs_as_planned(renderer: &mut Renderer, spp: u32, way: &str) {
    let views = start_views(&builtin("gallery"), 20.0);
    for frame in 0..2 {
        let result = renderer.render_frame(&views, frame, |_| {}).unwrap();
        let stages = renderer.plan();
        let of = |stage| labels(&stages, stage);
        let mut expected = Vec::new();
        if frame == 0 {
            for planned in &stages {
                if matches!(planned.stage, Stage::Photons(_)) {
                    expected.extend(of(planned.stage));
                }
            }
        }
        for _ in 0..spp {
            expected.extend(of(Stage::Left));
            expected.extend(of(Stage::Right));
        }
        expected.extend(of(Stage::Reconstruct));
        assert_eq!(result.times.dispatched, expected, "{way}, frame {frame}");
        assert!(expected.len() > 3, "{way}");
    }
}

#[test]
fn what_runs_is_the_plan_in_its_order() {
    for (way, change) in WAYS {
        let settings = settings(*change);
        let mut renderer = renderer(&builtin("gallery"), &settings, [16, 16]);
        runs_as_planned(&mut renderer, settings.spp, way);
    }
}

#[test]
fn a_new_pose_and_equal_eyes_run_the_plans_stages() {
    let scene = builtin("parade");
    let settings = settings(|s| s.spp = 1);
    let mut renderer = renderer(&scene, &settings, [16, 16]);
    let view = parallel_views(scene.start_pose(), 0.0, square_fov(20.0));
    assert_eq!(view[0], view[1]);
    renderer.render_frame(&view, 0, |_| {}).unwrap();
    let rest = renderer.render_frame(&view, 1, |_| {}).unwrap();
    let stages = renderer.plan();
    let right = labels(&stages, Stage::RightEqual);
    let rest = rest.times.dispatched;
    assert!(rest.ends_with(&right), "{rest:?}");
    assert!(!rest.iter().any(|label| label.starts_with("pose.")));
    let pose = torn(&scene, 0.3);
    renderer.set_pose(&pose);
    let moved = renderer.render_frame(&view, 2, |_| {}).unwrap();
    let posed = labels(&stages, Stage::Pose);
    let begins = moved.times.dispatched.starts_with(&posed);
    assert!(posed.len() > 2 && begins, "{posed:?}");
}
