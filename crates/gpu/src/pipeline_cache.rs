//! Compiled pipelines from one run to the next, in a file of the user's. Drivers of desktop cards keep files of their own;
//! those of stand-alone headsets leave it to the application.

use std::hash::Hasher as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use stereolux_base::files;

use crate::context::GpuContext;
use crate::vulkan_interop::pipelines_from;

/// A file that has grown beyond this, by pipelines of shaders that are no more, is begun anew.
const MOST_BYTES: u64 = 256 << 20;
/// Of all that follows them: what a driver is given is what it wrote.
const CHECKSUM_BYTES: usize = 8;

/// Contexts of one process may store at once, and their file is the same.
static STORING: Mutex<()> = Mutex::new(());

/// What a driver has compiled, and the file that it came from and goes to.
pub(crate) struct PipelineCache {
    pub(crate) pipelines: wgpu::PipelineCache,
    path: PathBuf,
    stored: Mutex<Option<u64>>,
}

impl PipelineCache {
    /// Opens the file of the context's adapter in `folder`, or begins one; `None` if its interface has no such thing.
    fn open(context: &GpuContext, folder: &Path) -> Option<Self> {
        let device = &context.device;
        if !device.features().contains(wgpu::Features::PIPELINE_CACHE) {
            return None;
        }
        let path = folder.join(wgpu::util::pipeline_cache_key(&context.adapter_info())?);
        let read = files::read_regular(&path, MOST_BYTES + 1).unwrap_or_default();
        let known = checked(&read);
        if known.is_none() && !read.is_empty() {
            log::info!("{}: damaged or too large; begun anew", path.display());
        }
        // A file of another adapter that somebody gave this one's name is refused.
        let opened = context.guarded("pipeline cache", || Ok(pipelines_from(device, known)));
        let pipelines = opened
            .inspect_err(|error| log::info!("{}: {error}", path.display()))
            .ok()?;
        Some(Self {
            pipelines,
            stored: Mutex::new(known.map(checksum)),
            path,
        })
    }

    /// Writes what has been compiled, unless the file holds it.
    pub(crate) fn store(&self) {
        let _one_at_a_time = STORING.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(data) = self.pipelines.get_data() else {
            return;
        };
        let sum = checksum(&data);
        let mut stored = self.stored.lock().unwrap_or_else(PoisonError::into_inner);
        if *stored == Some(sum) {
            return;
        }
        // Tried once for what there is: a folder that cannot be written costs the next start time, and nothing else.
        *stored = Some(sum);
        let made = self.path.parent().map_or(Ok(()), std::fs::create_dir_all);
        let written = made.and_then(|()| {
            files::write_beside(&self.path, |out| {
                out.write_all(&sum.to_le_bytes())?;
                out.write_all(&data)
            })
        });
        if let Err(error) = written {
            log::info!(
                "{}: compiled pipelines are not kept: {error}",
                self.path.display()
            );
        }
    }
}

impl GpuContext {
    /// Keeps compiled pipelines in the user's folder for what can be made anew, where the device's interface can (Vulkan).
    pub fn keep_pipelines(&mut self) {
        if let Some(folder) = stereolux_base::user_folders::cache() {
            self.keep_pipelines_in(&folder);
        }
    }

    /// As [`GpuContext::keep_pipelines`], in a folder that is made when it is needed.
    pub fn keep_pipelines_in(&mut self, folder: &Path) {
        self.pipelines = PipelineCache::open(self, folder).map(Into::into);
    }
}

/// What follows the checksum, if that is right.
fn checked(file: &[u8]) -> Option<&[u8]> {
    let (sum, data) = file.split_first_chunk::<CHECKSUM_BYTES>()?;
    let is_whole = file.len() as u64 <= MOST_BYTES && u64::from_le_bytes(*sum) == checksum(data);
    is_whole.then_some(data)
}

// Another version of the standard library may sum otherwise: the file is begun anew then.
fn checksum(data: &[u8]) -> u64 {
    let mut hasher = std::hash::DefaultHasher::new();
    hasher.write(data);
    hasher.finish()
}
