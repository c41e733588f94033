//! What each dispatch of a frame did, where `output.work` has it counted: a log on the device, a slot per dispatch.

use std::ops::AddAssign;
use std::sync::{Mutex, PoisonError};

use bytemuck::{Pod, Zeroable};
use serde::Serialize;

use super::bind::{Buffers, Whose, meaning};
use super::run::named;
use super::step::Step;
use crate::gpu::buffers::{read_buffer, storage_buffer};
use crate::gpu::kernel::BindingKind;
use crate::gpu::{FrameRecorder, GpuContext, GpuError, Kernel, Resources, Workgroups};

/// Dispatches of a frame that the log holds; later ones are left out, and said so.
const SLOTS: usize = 1024;
/// The buffer that shaders count in.
const COUNTS: &str = "work_counts";

/// What shaders count.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Pod, Zeroable)]
#[repr(C)]
pub struct WorkCounts {
    /// Rays traced, shadow rays included.
    pub rays: u64,
    /// Inner nodes of both levels that they entered.
    pub nodes: u64,
    /// Tests of a ray with a triangle.
    pub triangles: u64,
    /// Photons whose distance from a gather point was compared with the radius.
    pub photons_tested: u64,
    /// Those within it.
    pub photons_counted: u64,
}

impl AddAssign for WorkCounts {
    fn add_assign(&mut self, more: Self) {
        self.rays += more.rays;
        self.nodes += more.nodes;
        self.triangles += more.triangles;
        self.photons_tested += more.photons_tested;
        self.photons_counted += more.photons_counted;
    }
}

/// A slot of the log.
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Slot {
    counts: WorkCounts,
    groups: [u32; 3],
    unused: [u32; 3],
}

/// Bytes of the frame's buffers that a pass is bound to, each taken once.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Images of an eye that it only reads, and that it writes.
    pub images: [u64; 2],
    /// The same of a photon map's buffers.
    pub maps: [u64; 2],
}

/// A dispatch.
#[derive(Debug, Clone)]
pub struct Dispatched {
    /// Its name in timings.
    pub label: String,
    /// Name of its pass.
    pub pass: String,
    /// Threads of its workgroups; one per entry of a list where threads take several.
    pub threads: u64,
    /// Whether buffers said over how much it runs: a list of pixels, a level of a tree.
    pub over_list: bool,
    /// Buffers.
    pub traffic: Traffic,
    /// What it did.
    pub counts: WorkCounts,
}

struct Noted {
    dispatched: Dispatched,
    groups: Option<[u32; 3]>,
}

/// The log of a frame.
pub struct WorkLog {
    slots: wgpu::Buffer,
    noted: Mutex<Vec<Noted>>,
}

impl WorkLog {
    /// An empty one.
    pub(super) fn new(context: &GpuContext) -> Result<Self, GpuError> {
        let bytes = (SLOTS * size_of::<Slot>()) as u64;
        Ok(Self {
            slots: storage_buffer(context, "work log", bytes)?,
            noted: Mutex::default(),
        })
    }

    /// Takes the counts of the dispatch that was just recorded.
    pub(super) fn note(
        &self,
        recorder: &mut FrameRecorder<'_>,
        buffers: &Buffers,
        (label, kernel, traffic): (&str, &Kernel, Traffic),
        groups: Workgroups<'_>,
    ) {
        let mut noted = self.noted.lock().unwrap_or_else(PoisonError::into_inner);
        let at = (noted.len() * size_of::<Slot>()) as u64;
        if noted.len() < SLOTS {
            let counts = size_of::<WorkCounts>() as u64;
            if let Some(counted) = buffers.written((Whose::Frame, COUNTS)) {
                recorder.copy((counted, 0), (&self.slots, at), counts);
                recorder.clear(counted, counts);
            }
            if let Workgroups::Indirect(counted, from) = groups {
                recorder.copy((counted, from), (&self.slots, at + counts), 12);
            }
        }
        noted.push(Noted {
            groups: match groups {
                Workgroups::Direct(groups) => Some(groups),
                Workgroups::Indirect(..) => None,
            },
            dispatched: Dispatched {
                label: label.to_owned(),
                pass: kernel.interface.name.clone(),
                threads: kernel
                    .workgroup_size
                    .iter()
                    .map(|n| u64::from(*n))
                    .product(),
                over_list: matches!(groups, Workgroups::Indirect(..)),
                traffic,
                counts: WorkCounts::default(),
            },
        });
    }

    /// What was noted since the last time. Waits for the device.
    pub(super) fn take(&self, context: &GpuContext) -> Result<Vec<Dispatched>, GpuError> {
        let noted = &mut *self.noted.lock().unwrap_or_else(PoisonError::into_inner);
        let noted = std::mem::take(noted);
        if noted.len() > SLOTS {
            log::warn!(
                "output.work: {} of the frame's {} dispatches are counted; render fewer samples",
                SLOTS,
                noted.len()
            );
        }
        let slots: Vec<Slot> =
            read_buffer(context, "work log", &self.slots, noted.len().min(SLOTS))?;
        let dispatches = noted.into_iter().zip(slots).map(|(noted, slot)| {
            let groups = noted.groups.unwrap_or(slot.groups);
            let threads: u64 = groups.iter().map(|n| u64::from(*n)).product();
            Dispatched {
                threads: noted.dispatched.threads * threads,
                counts: slot.counts,
                ..noted.dispatched
            }
        });
        Ok(dispatches.collect())
    }
}

/// The frame's buffers that `kernel` is bound to in `step`.
pub(super) fn traffic(
    step: &Step,
    kernel: &Kernel,
    given: &Resources<'_>,
    buffers: &Buffers,
) -> Traffic {
    let mut traffic = Traffic::default();
    for binding in &kernel.interface.bindings {
        let name = named(step, &binding.name);
        let found = meaning(&name, step.owner).filter(|_| given.get(&name).is_none());
        let Some(found) = found.filter(|found| found.place.1 != COUNTS) else {
            continue;
        };
        let part = match found.place.0 {
            Whose::Eye(_) | Whose::Frame => &mut traffic.images,
            Whose::Map(_) | Whose::Batch(..) => &mut traffic.maps,
        };
        let is_written = binding.kind == BindingKind::ReadWrite;
        part[usize::from(is_written)] += buffers.bytes_of(&found.place);
    }
    traffic
}
