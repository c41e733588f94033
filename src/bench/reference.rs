//! Path-traced references, kept between runs.
//!
//! A reference is the mean of independent batches: one sample through each pixel's centre, or [`BOX_SAMPLES`] spread over
//! the pixel. The spread of the batches gives its own standard error, per pixel. It is rendered until that is small
//! enough for what is compared with it, or until a cap, and then says so.
//!
//! Its file carries the key that it was made under: scene, view, size, settings, adapter, and the fingerprint of the code.
//! A file under another key, or damaged, is rendered anew. A reference that has to become better goes on from its file.

use std::cell::OnceCell;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use stereolux_report::ReportError;
use stereolux_report::fingerprint::Fingerprint;
use stereolux_report::records::Machine;

use super::{BenchError, RENDER_CODE, go_on};
use crate::files;
use crate::gpu::{GpuContext, ShaderLibrary};
use crate::images::{Image, write_atomically};
use crate::metrics::RenderMoments;
use crate::renderer::{Eye, Renderer};
use crate::scene::Scene;
use crate::settings::{Eyes, Method, RenderSettings, Reuse, Settings};
use crate::xr::View;

/// Samples of one batch over a pixel's area.
pub const BOX_SAMPLES: u32 = 16;
/// Fewest batches: under these the spread is not worth much.
const FEWEST_BATCHES: u32 = 16;
/// A reference in the making is written this often, so that a kill costs no more.
const WRITE_EVERY: Duration = Duration::from_secs(60);
/// First line of the file.
const MAGIC: &str = "stereolux-reference 1";
/// Added to the seed, so that a path-traced variant and its reference share no random numbers.
const SEED_OFFSET: u32 = 0x9e37_79b9;

/// What a reference's pixels are means over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum PixelFilter {
    /// The ray through the pixel's centre, as a frame of one sample has it.
    Center,
    /// The pixel's area, as several samples have it.
    Box,
}

impl PixelFilter {
    fn samples_per_batch(self) -> u32 {
        match self {
            Self::Center => 1,
            Self::Box => BOX_SAMPLES,
        }
    }
}

/// What a reference is of.
#[derive(Clone, Copy)]
pub struct ReferenceSpec<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// Its fingerprint.
    pub scene_fingerprint: &'a str,
    /// The bench's settings: depth, forced features and adapter are taken from here.
    pub settings: &'a Settings,
    /// The eye.
    pub view: View,
    /// Pixels.
    pub size: [u32; 2],
    /// Pixel filter.
    pub filter: PixelFilter,
}

/// A reference in hand.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Mean and spread of its batches.
    pub moments: RenderMoments,
    /// Whether it stopped at the cap, short of what was asked for.
    pub capped: bool,
}

#[derive(Debug, Serialize, Deserialize)]
struct Header {
    key: String,
    width: u32,
    height: u32,
    batches: u32,
    checksum: String,
}

/// Makes and keeps references.
pub struct References {
    folder: PathBuf,
    max_samples: u32,
    /// Fewest batches that a reference has: by less, its variance is not known.
    pub(super) fewest_batches: u32,
    library: ShaderLibrary,
    machine: Machine,
    /// Once something is missing; a driver does not open devices without end.
    device: OnceCell<GpuContext>,
}

impl References {
    /// Keeps its files in `folder`, which exists; [`Self::most_samples`] says how long a reference is rendered.
    #[must_use]
    pub fn open(folder: &Path, max_samples: u32, library: ShaderLibrary, machine: Machine) -> Self {
        Self {
            folder: folder.to_owned(),
            max_samples,
            fewest_batches: FEWEST_BATCHES,
            library,
            machine,
            device: OnceCell::new(),
        }
    }

    /// The device that references are rendered on, and what is held against them.
    ///
    /// # Errors
    /// [`BenchError`]: there is none.
    pub fn device(&self, settings: &Settings) -> Result<GpuContext, BenchError> {
        if let Some(open) = self.device.get() {
            return Ok(open.clone());
        }
        let open = GpuContext::open(Some(&settings.adapter))?;
        Ok(self.device.get_or_init(|| open).clone())
    }

    /// The cap, samples per pixel.
    #[must_use]
    pub fn max_samples(&self) -> u32 {
        self.max_samples
    }

    /// Settings that the reference is rendered with: everything of `settings` that its picture depends on.
    fn settings(spec: &ReferenceSpec<'_>) -> Settings {
        let given = spec.settings;
        let mut settings = Settings {
            scene: String::new(),
            adapter: given.adapter.clone(),
            environment: given.environment.clone(),
            render: RenderSettings {
                method: Method::Path,
                reuse: Reuse::Off,
                spp: spec.filter.samples_per_batch(),
                seed: given.render.seed.wrapping_add(SEED_OFFSET),
                force: given.render.force.clone(),
                path: given.render.path.clone(),
                ..RenderSettings::default()
            },
            ..Settings::default()
        };
        settings.render.gpu.timestamps = false.into();
        settings
    }

    /// Everything that the reference depends on.
    fn key(&self, spec: &ReferenceSpec<'_>) -> String {
        let mut hash = Fingerprint::default()
            .with_text(RENDER_CODE)
            .with_text(spec.scene_fingerprint)
            .with_text(&format!("{:?} {:?}", spec.view, spec.size))
            .with_value(&spec.filter)
            .with_value(&Self::settings(spec))
            .with_value(&self.machine);
        for (name, source) in self.library.sources() {
            hash = hash.with_text(name).with_text(source);
        }
        hash.to_string()
    }

    /// Samples per pixel that a reference has at most: a spread needs a few batches.
    pub fn most_samples(&self, filter: PixelFilter) -> u32 {
        let per_batch = filter.samples_per_batch();
        per_batch * (self.max_samples / per_batch).max(self.fewest_batches)
    }

    /// The reference of `spec`, rendered on until its variance (in units of relative MSE) is at most `target` or the cap is
    /// reached. `progress` hears of samples done and the cap.
    ///
    /// # Errors
    /// [`BenchError`]: rendering fails, or the file cannot be written.
    pub fn get(
        &self,
        spec: &ReferenceSpec<'_>,
        target: f64,
        progress: &mut dyn FnMut(u32, u32),
    ) -> Result<Reference, BenchError> {
        let key = self.key(spec);
        let path = self.folder.join(format!("{key}.reference"));
        let per_batch = spec.filter.samples_per_batch();
        let most = self.most_samples(spec.filter) / per_batch;
        let mut moments = read(&path, &key, spec.size)
            .unwrap_or_else(|| RenderMoments::new(spec.size[0], spec.size[1]));
        let missing = |moments: &RenderMoments| {
            moments.count < self.fewest_batches
                || moments
                    .relative_variance_of_mean(None)
                    .is_none_or(|variance| variance > target)
        };
        let before = moments.count;
        if missing(&moments) && moments.count < most {
            let settings = Self::settings(spec);
            let mut renderer = Renderer::new(
                self.device(&settings)?,
                &self.library,
                spec.scene,
                &settings.render,
                Eyes::Left,
                spec.size,
            )?;
            let views = [spec.view; 2];
            let mut written = Instant::now();
            while missing(&moments) && moments.count < most {
                // The variance falls as 1 / n, so it need not be asked for after every batch.
                let until = (moments.count + 4 + moments.count / 8).min(most);
                while moments.count < until {
                    renderer.render_frame(&views, moments.count, |_| {})?;
                    let pixels = renderer.read_radiance(Eye::Left)?.unwrap_or_default();
                    moments.add(&Image::new(spec.size[0], spec.size[1], pixels)?)?;
                }
                progress(moments.count * per_batch, most * per_batch);
                let ends = go_on();
                if ends.is_err() || written.elapsed() > WRITE_EVERY {
                    write(&path, &key, &moments)?;
                    written = Instant::now();
                }
                ends?;
            }
        }
        if moments.count > before {
            write(&path, &key, &moments)?;
        }
        Ok(Reference {
            capped: missing(&moments),
            moments,
        })
    }
}

fn payload(moments: &RenderMoments) -> Vec<u8> {
    let values = moments.mean.pixels.iter().chain(&moments.squares.pixels);
    values
        .flatten()
        .flat_map(|value| value.to_le_bytes())
        .collect()
}

fn write(path: &Path, key: &str, moments: &RenderMoments) -> Result<(), BenchError> {
    let payload = payload(moments);
    let header = Header {
        key: key.to_owned(),
        width: moments.mean.width,
        height: moments.mean.height,
        batches: moments.count,
        checksum: Fingerprint::default().with(&payload).to_string(),
    };
    let header = serde_json::to_string(&header).map_err(|error| ReportError::file(path, error))?;
    write_atomically(path, |out| {
        writeln!(out, "{MAGIC}\n{header}")?;
        out.write_all(&payload)
    })?;
    Ok(())
}

/// A file's moments, if it is whole and was made under this very key.
fn read(path: &Path, key: &str, size: [u32; 2]) -> Option<RenderMoments> {
    let bytes = files::read_regular(path, u64::MAX).ok()?;
    let refuse = |why: &str| {
        log::warn!("{}: {why}; it is rendered anew", path.display());
        None
    };
    let mut parts = bytes.splitn(3, |&byte| byte == b'\n');
    if parts.next() != Some(MAGIC.as_bytes()) {
        return refuse("not a reference of this version");
    }
    let Some(header) = parts
        .next()
        .and_then(|line| serde_json::from_slice::<Header>(line).ok())
    else {
        return refuse("its header cannot be read");
    };
    if header.key != key || [header.width, header.height] != size {
        return refuse("it was made for something else");
    }
    let pixels = size[0] as usize * size[1] as usize;
    let payload = parts.next().unwrap_or_default();
    if payload.len() != pixels * 48
        || Fingerprint::default().with(payload).to_string() != header.checksum
    {
        return refuse("it is damaged");
    }
    let mut values = payload
        .as_chunks::<8>()
        .0
        .iter()
        .map(|b| f64::from_le_bytes(*b));
    let mut moments = RenderMoments::new(size[0], size[1]);
    moments.count = header.batches;
    for pixel in moments
        .mean
        .pixels
        .iter_mut()
        .chain(&mut moments.squares.pixels)
    {
        for channel in pixel {
            *channel = values.next()?;
        }
    }
    Some(moments)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::folders::Folder;

    fn moments() -> RenderMoments {
        let mut moments = RenderMoments::new(4, 3);
        for level in [0.5_f32, 0.75, 2.0] {
            moments
                .add(&Image::filled(4, 3, [level, 0.1, 3.0]).unwrap())
                .unwrap();
        }
        moments
    }

    #[test]
    fn files_come_back_bit_for_bit_and_only_under_their_key() {
        let folder = Folder::new("reference");
        let path = folder.join("a.reference");
        write(&path, "key", &moments()).unwrap();
        assert_eq!(read(&path, "key", [4, 3]).unwrap(), moments());
        // Stale: another key in the file than the one that is asked for.
        assert_eq!(read(&path, "another", [4, 3]), None);
        assert_eq!(read(&path, "key", [3, 4]), None);
        assert_eq!(read(&folder.join("missing"), "key", [4, 3]), None);
    }

    #[test]
    fn damaged_files_are_refused() {
        let folder = Folder::new("reference-damaged");
        let path = folder.join("a.reference");
        write(&path, "key", &moments()).unwrap();
        let good = fs::read(&path).unwrap();
        let last = good.len() - 1;
        let mut flipped = good.clone();
        flipped[last - 5] ^= 1;
        for bad in [&good[..last], &good[..20], &b""[..], &flipped] {
            fs::write(&path, bad).unwrap();
            assert_eq!(read(&path, "key", [4, 3]), None);
        }
    }

    #[test]
    fn keys_tell_everything_apart_that_shows() {
        let folder = Folder::new("reference-keys");
        let machine = Machine::default();
        let open = |library: ShaderLibrary, machine: Machine| {
            References::open(folder.path(), 64, library, machine)
        };
        let references = open(ShaderLibrary::embedded(), machine.clone());
        let scene = Scene::default();
        let settings = Settings::default();
        let view = View {
            position_in_world: glam::DVec3::ZERO,
            orientation: glam::DQuat::IDENTITY,
            fov: crate::xr::Fov::from_degrees(-40.0, 40.0, 40.0, -40.0),
        };
        let spec = ReferenceSpec {
            scene: &scene,
            scene_fingerprint: "scene",
            settings: &settings,
            view,
            size: [8, 8],
            filter: PixelFilter::Center,
        };
        let key = references.key(&spec);
        assert_eq!(key, references.key(&spec));
        let mut moved = view;
        moved.position_in_world.x = 1e-12;
        let mut deeper = settings.clone();
        deeper.render.path.max_depth += 1;
        for other in [
            ReferenceSpec {
                scene_fingerprint: "other",
                ..spec
            },
            ReferenceSpec {
                view: moved,
                ..spec
            },
            ReferenceSpec {
                settings: &deeper,
                ..spec
            },
            ReferenceSpec {
                size: [8, 9],
                ..spec
            },
            ReferenceSpec {
                filter: PixelFilter::Box,
                ..spec
            },
        ] {
            assert_ne!(references.key(&other), key);
        }
        // Photons have nothing to do with a path-traced picture.
        let mut photons = settings.clone();
        photons.render.photon.count = 1;
        photons.render.method = Method::Photon;
        let same = ReferenceSpec {
            settings: &photons,
            ..spec
        };
        assert_eq!(references.key(&same), key);
        // Shaders and driver do.
        let mut library = ShaderLibrary::embedded();
        library.insert("passes/path_trace", "// another");
        assert_ne!(open(library, machine.clone()).key(&spec), key);
        let driver = Machine {
            driver: "e".to_owned(),
            ..machine
        };
        assert_ne!(open(ShaderLibrary::embedded(), driver).key(&spec), key);
    }
}
