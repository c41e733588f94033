use super::*;
use crate::folders::Folder;
use crate::settings::Reuse;

#[test]
fn only_what_differs_is_listed() {
    assert!(differing_settings(&Settings::default()).is_empty());
    let mut settings = Settings::default();
    settings.render.photon.count = 7;
    settings.render.spp = 2;
    let found = differing_settings(&settings);
    assert_eq!(found.len(), 2);
    assert_eq!(found["photon.count"], 7);
    assert_eq!(found["spp"], 2);
}

struct Silent;

impl BenchProgress for Silent {
    fn says(&mut self, _: &str) {}
    fn planned(&mut self, _: crate::options::Suite, _: &[GroupPlan], _: f64) {}
    fn began(&mut self, _: &GroupPlan) {}
    fn round(&mut self, _: &GroupPlan, _: Round) {}
    fn reference(&mut self, _: &GroupPlan, _: u32, _: u32) {}
    fn finished(&mut self, _: &GroupPlan) {}
    fn skipped(&mut self, _: &GroupPlan) {}
}

#[test]
fn variants_take_the_time_of_one_of_their_scene_by_pixels_and_samples() {
    let one = plan();
    let mut larger = plan();
    larger.size = one.size.map(|pixels| 2 * pixels);
    larger.candidates.truncate(1);
    larger.candidates[0].settings.spp = 3;
    let mut other = plan();
    other.scene = SceneSource::Named("builtin:sphere".to_owned());
    let mut timed = Vec::new();
    let found = estimated_s(&[one.clone(), larger, other], |plan, _| {
        timed.push(plan.scene.name());
        Ok(VariantTime {
            set_up_s: 100.0,
            frame_s: timed.len() as f64,
        })
    });
    assert_eq!(timed, ["builtin:plane", "builtin:sphere"]);
    // Per frame: a second a variant, twelve for the larger picture of three samples, two seconds a variant.
    let (variants, frames) = (one.candidates.len() as f64, one.frames() as f64);
    let expected = 100.0 * (2.0 * variants + 1.0) + frames * (variants + 12.0 + 2.0 * variants);
    let found = found.unwrap();
    assert!(
        (found / expected - 1.0).abs() < 1e-12,
        "{found} for {expected}"
    );
}

fn plan() -> GroupPlan {
    let candidate = |reuse| Candidate {
        variant: format!("{reuse:?}"),
        settings: RenderSettings {
            reuse,
            ..RenderSettings::default()
        },
        factors: BTreeMap::new(),
        motion: InstanceMotion::Nothing,
    };
    GroupPlan {
        suite: "stereo",
        name: "group".to_owned(),
        scene: SceneSource::Named("builtin:plane".to_owned()),
        headset: Headset::load("symmetric").unwrap(),
        headset_label: "symmetric".to_owned(),
        views: ViewPlan::Start,
        size: [8, 8],
        eyes: Eyes::Both,
        filter: Some(PixelFilter::Center),
        candidates: vec![candidate(Reuse::Off), candidate(Reuse::Scatter)],
        rounds: 3,
        warm_up: 1,
    }
}

/// Works `with` a lab in an empty folder.
fn lab<T>(name: &str, max_samples: u32, with: impl FnOnce(&mut Lab<'_>) -> T) -> T {
    let out = Folder::new(name);
    let machine = Machine::default();
    let settings = Settings::default();
    let library = ShaderLibrary::embedded();
    let mut silent = Silent;
    let mut lab = Lab {
        out: out.path(),
        settings: &settings,
        machine: machine.clone(),
        library: library.clone(),
        journal: Journal::open(&out.join("journal.jsonl")).unwrap(),
        references: References::open(out.path(), max_samples, library, machine),
        progress: &mut silent,
        known: Known::default(),
    };
    with(&mut lab)
}

#[test]
fn keys_change_with_everything_that_is_measured() {
    let keys = |plan: &GroupPlan| lab("keys", 64, |lab| lab.keys(plan).unwrap());
    let known = keys(&plan());
    assert_eq!(known, keys(&plan()));
    assert_ne!(known[0], known[1]);
    type Change = fn(&mut GroupPlan);
    let changes: [Change; 9] = [
        |plan| plan.rounds += 1,
        |plan| plan.size = [8, 9],
        |plan| plan.views = ViewPlan::Ahead(0.1),
        |plan| plan.scene = SceneSource::Named("builtin:sphere".to_owned()),
        |plan| plan.headset = plan.headset.clone().with_ipd(0.05).unwrap(),
        |plan| plan.filter = Some(PixelFilter::Box),
        // Another variant in the group changes all of its keys: they are measured against each other.
        |plan| plan.candidates[1].settings.photon.count = 7,
        |plan| plan.candidates[1].settings.seed = 1,
        |plan| plan.candidates[1].motion = InstanceMotion::One,
    ];
    for (index, change) in changes.into_iter().enumerate() {
        let mut other = plan();
        change(&mut other);
        assert!(
            keys(&other).iter().all(|key| !known.contains(key)),
            "{index}"
        );
    }
    let cap = lab("keys-cap", 128, |lab| lab.keys(&plan()).unwrap());
    assert_ne!(cap, known);
}

#[test]
fn heads_move_as_planned() {
    let scene = Scene::builtin("plane").unwrap();
    let views = |views: ViewPlan| {
        let plan = GroupPlan { views, ..plan() };
        lab("views", 64, |lab| lab.views(&plan, &scene).unwrap())
    };
    let still = views(ViewPlan::Start);
    assert_eq!(still.len(), 4);
    assert!(still.iter().all(|view| *view == still[0]));
    let ahead = views(ViewPlan::Ahead(0.25));
    let moved = ahead[0][0].position_in_world - still[0][0].position_in_world;
    assert!((moved - DVec3::new(0.0, 0.0, -0.25)).length() < 1e-12);
    let jitter = views(ViewPlan::Jitter);
    assert!(jitter[1][0].position_in_world != jitter[0][0].position_in_world);
    let trace = views(ViewPlan::Trace);
    // Warm-up looks from the last frame, where errors are taken; the first recorded frame is the starting pose.
    assert_eq!((trace.len(), trace[0]), (4, trace[3]));
    let start = trace[1][0].position_in_world - still[0][0].position_in_world;
    assert!(start.length() < 1e-9 && trace[2] != trace[1]);
}
