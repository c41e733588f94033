//! `bench work`: counts what a frame's passes do, at a small size, and predicts the frame at the headset's size on named
//! cards ([`stereolux_report::work`]).

use std::mem::offset_of;

use stereolux_report::work::{WorkRow, files};

use super::scenes::SceneSource;
use super::{
    BenchError, BenchProgress, JUDGED_BY, Outcome, circumstances, go_on, scenes_or, write_table,
};
use crate::bvh::records::{BvhNode, Triangle};
use crate::frame::work::Dispatched;
use crate::gpu::{GpuContext, ShaderFeatures, ShaderLibrary};
use crate::options::BenchOptions;
use crate::renderer::records::photon::SortedPhoton;
use crate::renderer::{FrameResult, Renderer};
use crate::settings::{Choice as _, Eyes, Method, Settings};
use crate::xr::Headset;

/// Pixels per eye at which is counted, without `--size`: large enough that borders do not tell.
const SIZE: [u32; 2] = [256, 256];
/// Frames before the one that is counted: photon lists have grown, filters have a history.
const WARM_UP: u32 = 5;
/// Instructions of every pass's code.
const INSTRUCTIONS: &str = include_str!("../../crates/isa/instructions.csv");

/// Counts and predicts, and writes the report.
///
/// # Errors
/// [`BenchError`].
pub(super) fn run(
    options: &BenchOptions,
    library: &ShaderLibrary,
    progress: &mut dyn BenchProgress,
) -> Result<Outcome, BenchError> {
    let settings = &options.settings;
    let headset = Headset::load(&settings.headset)?;
    let counted = settings.size.unwrap_or(SIZE);
    let device = GpuContext::open(Some(&settings.adapter))?;
    let mut rows: Vec<WorkRow> = Vec::new();
    for name in scenes_or(options, &JUDGED_BY) {
        for method in [Method::Photon, Method::Path] {
            go_on()?;
            progress.says(&format!("{name}: {}", method.word()));
            let source = SceneSource::Named(name.clone());
            let scene = source.load(settings)?;
            let settings = settings_of(settings, method);
            let render = &settings.render;
            let mut renderer =
                Renderer::new(device.clone(), library, &scene, render, Eyes::Both, counted)?;
            let views = headset.views_from_head(&scene.start_pose());
            for frame in 0..WARM_UP {
                renderer.render_frame(&views, frame, |_| {})?;
            }
            let result = renderer.render_frame(&views, WARM_UP, |_| {})?;
            let passes = rows_of(
                &result,
                [&name, method.word()],
                [pixels(counted), pixels(headset.size)],
                renderer.features(),
            );
            rows.push(WorkRow::all(&passes));
            rows.extend(passes);
        }
    }
    let [width, height] = headset.size;
    let what = format!(
        "Counted at {}x{} pixels per eye; passes over images are stated for the {width}x{height} of {}. `run`'s frame with the \
         filters, `reuse = {}`, {} photons traced anew; the scene's starting pose.",
        counted[0],
        counted[1],
        headset.name,
        settings.render.reuse.word(),
        settings.render.photon.count,
    );
    let about = circumstances(&device, settings);
    write_table(options, rows.len(), files(&rows, &what, &about)?)
}

/// `run`'s settings, with photons traced in every frame.
fn settings_of(settings: &Settings, method: Method) -> Settings {
    let mut settings = settings.clone();
    let render = &mut settings.render;
    render.method = method;
    render.spp = 1;
    render.photon.every_frame = true;
    render.output.work = true;
    render.gpu.timestamps = false.into();
    // A wearer's head moves.
    render.reconstruct.still = false.into();
    render.decide_switches(true);
    settings
}

fn pixels([width, height]: [u32; 2]) -> f64 {
    f64::from(width) * f64::from(height)
}

/// A row per pass, in the order of their first dispatch.
fn rows_of(
    result: &FrameResult,
    [scene, method]: [&str; 2],
    [counted, wanted]: [f64; 2],
    features: &ShaderFeatures,
) -> Vec<WorkRow> {
    let map = &result.photons.map;
    let filled = match map.capacity {
        0 => 1.0,
        capacity => f64::from(map.stored.min(capacity)) / f64::from(capacity),
    };
    let mut rows: Vec<WorkRow> = Vec::new();
    for dispatched in &result.work {
        let Dispatched {
            label,
            threads,
            traffic,
            counts,
            ..
        } = dispatched;
        // Passes over images are what grows with them.
        let is_of_image = traffic.images != [0; 2];
        let scale = if is_of_image { wanted / counted } else { 1.0 };
        let seen = match dispatched.over_list {
            true => (*threads as f64 / counted).min(1.0),
            false => 1.0,
        };
        let place = rows.iter().position(|row| row.pass == *label);
        let place = place.unwrap_or_else(|| {
            rows.push(WorkRow {
                scene: scene.to_owned(),
                method: method.to_owned(),
                pass: label.clone(),
                code_instructions: code(dispatched, method, features),
                ..WorkRow::default()
            });
            rows.len() - 1
        });
        let row = &mut rows[place];
        row.dispatches += 1.0;
        row.threads += scale * *threads as f64;
        row.rays += scale * counts.rays as f64;
        row.nodes += scale * counts.nodes as f64;
        row.triangles += scale * counts.triangles as f64;
        row.photons_tested += scale * counts.photons_tested as f64;
        row.photons_counted += scale * counts.photons_counted as f64;
        let bytes = |way: usize| {
            // A gather's photons are among what it walks.
            let of_maps = if is_of_image {
                0.0
            } else {
                filled * traffic.maps[way] as f64
            };
            scale * seen * traffic.images[way] as f64 + of_maps
        };
        row.bytes_read += bytes(0);
        row.bytes_written += bytes(1);
    }
    // Only where it lies is read of a photon that is out of reach.
    let place = offset_of!(SortedPhoton, normal);
    let records = [
        size_of::<BvhNode>(),
        size_of::<Triangle>(),
        place,
        size_of::<SortedPhoton>() - place,
    ];
    let records = records.map(|bytes| bytes as f64);
    rows.into_iter().map(|row| row.predicted(records)).collect()
}

/// Instructions of a pass's code on RDNA 3 for the listed scene that is most like this one; 0 if the pass is not listed.
fn code(dispatched: &Dispatched, method: &str, features: &ShaderFeatures) -> f64 {
    let like = match (features.textures, features.environment) {
        (true, true) => "helmet",
        (true, false) => "gallery",
        (false, _) => "cornell",
    };
    let fits = |line: &str| -> Option<([bool; 2], f64)> {
        let cells: Vec<&str> = line.split(',').collect();
        let [_, "rdna3", scene, frame, pass, number] = cells.as_slice() else {
            return None;
        };
        // A kernel that another scene had word for word is not listed again.
        let likeness = [*scene == like, *frame == method];
        (*pass == dispatched.pass).then_some((likeness, number.parse().ok()?))
    };
    let all = INSTRUCTIONS.lines().filter_map(fits);
    all.max_by_key(|(likeness, _)| *likeness)
        .map_or(0.0, |(_, number)| number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::work::{Traffic, WorkCounts};
    use crate::renderer::MapStats;

    fn dispatched(pass: &str) -> Dispatched {
        Dispatched {
            label: format!("left.{pass}"),
            pass: pass.to_owned(),
            threads: 50,
            over_list: false,
            traffic: Traffic::default(),
            counts: WorkCounts::default(),
        }
    }

    #[test]
    fn images_grow_with_the_size_and_maps_do_not() {
        let mut result = FrameResult::default();
        result.photons.map = MapStats {
            stored: 10,
            capacity: 40,
            ..MapStats::default()
        };
        let counts = WorkCounts {
            rays: 7,
            ..WorkCounts::default()
        };
        let of_image = Traffic {
            images: [1000, 200],
            maps: [4000, 0],
        };
        let of_map = Traffic {
            maps: [4000, 80],
            ..Traffic::default()
        };
        let listed = Dispatched {
            traffic: of_image,
            over_list: true,
            counts,
            ..dispatched("path_trace")
        };
        let whole = Dispatched {
            traffic: of_image,
            counts,
            ..dispatched("direct_light")
        };
        let sort = Dispatched {
            traffic: of_map,
            ..dispatched("radix_count")
        };
        result.work = vec![listed.clone(), listed, whole, sort];
        let sizes = [100.0, 400.0];
        let rows = rows_of(&result, ["s", "path"], sizes, &ShaderFeatures::default());
        // Half of the pixels, twice, at four times the size.
        assert_eq!((rows[0].dispatches, rows[0].rays), (2.0, 56.0));
        assert_eq!((rows[0].bytes_read, rows[0].bytes_written), (4000.0, 800.0));
        assert_eq!((rows[1].bytes_read, rows[1].rays), (4000.0, 28.0));
        // A quarter of the list is filled.
        assert_eq!((rows[2].bytes_read, rows[2].bytes_written), (1000.0, 20.0));
        assert_eq!(rows[2].threads, 50.0);
    }

    #[test]
    fn instructions_are_those_of_the_scene_and_frame_that_are_most_alike() {
        let number = |pass: &str, method, textures| {
            let features = ShaderFeatures {
                textures,
                ..ShaderFeatures::default()
            };
            code(&dispatched(pass), method, &features)
        };
        let plain = number("path_trace", "path", false);
        assert!(plain > 0.0);
        assert!(number("path_trace", "path", true) > plain);
        assert_ne!(
            number("reuse_lookup", "photon", true),
            number("reuse_lookup", "path", true)
        );
        assert!(number("radix_count", "photon", true) > 0.0);
        assert_eq!(number("no_such_pass", "photon", false), 0.0);
    }
}
