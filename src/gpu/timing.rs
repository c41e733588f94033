//! Recording of a frame's passes with a timestamp before and after each.

use std::collections::BTreeMap;
use std::time::Instant;

use super::buffers::map_and_copy;
use super::context::{GpuContext, GpuError};
use super::kernel::{Bound, Kernel};
use super::texels::TexelCopy;

/// Queries of one set; wgpu's own limit.
const QUERIES: u32 = 4096;

/// Host milliseconds that have passed.
pub(crate) fn milliseconds_since(began: Instant) -> f64 {
    began.elapsed().as_secs_f64() * 1e3
}

/// A stage of a frame on the host.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HostSpan {
    /// Its name, as in `cpu_ms` of `stats.jsonl`.
    pub stage: &'static str,
    /// Its beginning.
    pub began: Instant,
    /// Its end.
    pub ended: Instant,
}

impl HostSpan {
    /// A stage that ends now.
    pub(crate) fn since(stage: &'static str, began: Instant) -> Self {
        let ended = Instant::now();
        Self {
            stage,
            began,
            ended,
        }
    }

    /// Milliseconds from its beginning to its end.
    pub(crate) fn ms(&self) -> f64 {
        (self.ended - self.began).as_secs_f64() * 1e3
    }
}

/// A submission whose passes were timed. The device wrote all its ticks between the two host times.
#[derive(Debug, Clone, PartialEq)]
pub struct Submission {
    /// What the host did: recording's end to the ticks' arrival.
    pub host: HostSpan,
    /// Nanoseconds per tick.
    pub ns_per_tick: f64,
    /// Name, first and last tick of each pass, in their order.
    pub passes: Vec<(String, [u64; 2])>,
}

/// Device milliseconds by pass name. A pass that ran several times is summed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PassTimes {
    /// Milliseconds and number of dispatches by name.
    pub passes: BTreeMap<String, (f64, u32)>,
    /// Names of all dispatches, timed or not, in their order.
    pub dispatched: Vec<String>,
    /// All submissions one by one, if somebody asks for them.
    pub submissions: Option<Vec<Submission>>,
}

impl PassTimes {
    fn add(&mut self, name: &str, milliseconds: f64) {
        let entry = self.passes.entry(name.to_owned()).or_default();
        entry.0 += milliseconds;
        entry.1 += 1;
    }

    /// Milliseconds of all passes together.
    pub fn total_ms(&self) -> f64 {
        self.passes.values().map(|(ms, _)| ms).sum()
    }
}

/// Query set and buffers for timing; made once and used by every frame.
pub struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    staging: wgpu::Buffer,
}

impl Timer {
    /// A timer, or `None` if the adapter has no timestamps.
    pub fn new(context: &GpuContext) -> Option<Self> {
        context.has_timestamps.then(|| {
            let bytes = u64::from(QUERIES) * 8;
            Self {
                queries: context.device.create_query_set(&wgpu::QuerySetDescriptor {
                    label: Some("pass timestamps"),
                    ty: wgpu::QueryType::Timestamp,
                    count: QUERIES,
                }),
                resolved: context.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("pass timestamps"),
                    size: bytes,
                    usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                    mapped_at_creation: false,
                }),
                staging: context.device.create_buffer(&wgpu::BufferDescriptor {
                    label: Some("pass timestamps read-back"),
                    size: bytes,
                    usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                    mapped_at_creation: false,
                }),
            }
        })
    }
}

/// Records the passes of one submission.
pub struct FrameRecorder<'a> {
    context: &'a GpuContext,
    timer: Option<&'a Timer>,
    encoder: wgpu::CommandEncoder,
    timed: Vec<String>,
    dispatched: Vec<String>,
}

impl<'a> FrameRecorder<'a> {
    /// Starts a command buffer.
    pub fn new(context: &'a GpuContext, timer: Option<&'a Timer>, label: &str) -> Self {
        Self {
            context,
            timer,
            encoder: context
                .device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) }),
            timed: Vec::new(),
            dispatched: Vec::new(),
        }
    }

    /// Passes that still fit into the timer.
    pub fn room(&self) -> usize {
        (QUERIES / 2) as usize - self.timed.len()
    }

    fn begin(&mut self, label: &str) -> wgpu::ComputePass<'_> {
        self.dispatched.push(label.to_owned());
        let timestamp_writes =
            self.next_slot(label)
                .map(|(timer, slot)| wgpu::ComputePassTimestampWrites {
                    query_set: &timer.queries,
                    beginning_of_pass_write_index: Some(slot),
                    end_of_pass_write_index: Some(slot + 1),
                });
        self.encoder
            .begin_compute_pass(&wgpu::ComputePassDescriptor {
                label: Some(label),
                timestamp_writes,
            })
    }

    /// Dispatches `kernel` over `groups` workgroups under the name `label`.
    pub fn dispatch(
        &mut self,
        label: &str,
        kernel: &Kernel,
        bound: &Bound,
        dispatch_index: u32,
        groups: [u32; 3],
    ) {
        let mut pass = self.begin(label);
        kernel.set(&mut pass, bound, dispatch_index);
        pass.dispatch_workgroups(groups[0], groups[1], groups[2]);
    }

    /// Dispatches `kernel` over the workgroups that `arguments` holds at byte `offset`.
    pub fn dispatch_indirect(
        &mut self,
        label: &str,
        kernel: &Kernel,
        bound: &Bound,
        dispatch_index: u32,
        arguments: &wgpu::Buffer,
        offset: u64,
    ) {
        let mut pass = self.begin(label);
        kernel.set(&mut pass, bound, dispatch_index);
        pass.dispatch_workgroups_indirect(arguments, offset);
    }

    /// Zeroes a whole buffer.
    pub fn clear(&mut self, buffer: &wgpu::Buffer) {
        self.encoder.clear_buffer(buffer, 0, None);
    }

    /// Copies the first `bytes` bytes from one buffer to another.
    pub fn copy(&mut self, from: &wgpu::Buffer, to: &wgpu::Buffer, bytes: u64) {
        self.encoder.copy_buffer_to_buffer(from, 0, to, 0, bytes);
    }

    /// Copies a buffer into the texture that holds its copy; timed as `label` where the adapter can time copies.
    pub fn copy_to_texels(&mut self, label: &str, from: &wgpu::Buffer, to: &TexelCopy) {
        let slot = if self.context.times_copies {
            self.next_slot(label)
        } else {
            None
        };
        if let Some((timer, slot)) = slot {
            self.encoder.write_timestamp(&timer.queries, slot);
        }
        to.record(&mut self.encoder, from, 0..from.size());
        if let Some((timer, slot)) = slot {
            self.encoder.write_timestamp(&timer.queries, slot + 1);
        }
    }

    /// The next two queries, noted as `label`'s; none where there is no timer or it is full.
    fn next_slot(&mut self, label: &str) -> Option<(&'a Timer, u32)> {
        let slot = 2 * self.timed.len() as u32;
        let timer = self.timer.filter(|_| slot + 1 < QUERIES)?;
        self.timed.push(label.to_owned());
        Some((timer, slot))
    }

    /// Submits, waits, and adds the device times to `times`.
    ///
    /// # Errors
    /// [`GpuError::Validation`] or [`GpuError::Lost`], naming `stage` (wgpu's own words name the pass by its label).
    pub fn submit(self, stage: &'static str, times: &mut PassTimes) -> Result<(), GpuError> {
        let Self {
            context,
            timer,
            mut encoder,
            timed,
            dispatched,
        } = self;
        times.dispatched.extend(dispatched);
        let count = 2 * timed.len() as u32;
        let timer = timer.filter(|_| count > 0);
        let began = Instant::now();
        context.guarded(stage, || {
            if let Some(timer) = timer {
                encoder.resolve_query_set(&timer.queries, 0..count, &timer.resolved, 0);
                encoder.copy_buffer_to_buffer(
                    &timer.resolved,
                    0,
                    &timer.staging,
                    0,
                    u64::from(count) * 8,
                );
            }
            context.queue.submit([encoder.finish()]);
            Ok(())
        })?;
        let Some(timer) = timer else {
            return context.wait(stage);
        };
        let ticks: Vec<u64> = map_and_copy(context, stage, &timer.staging, u64::from(count) * 8)?;
        let host = HostSpan::since(stage, began);
        let ns_per_tick = f64::from(context.queue.get_timestamp_period());
        let mut passes = Vec::new();
        for (name, pair) in timed.into_iter().zip(ticks.chunks_exact(2)) {
            // A device may reset its clock between two queries; such a pair says nothing.
            let ticks = pair[1].saturating_sub(pair[0]);
            times.add(&name, ticks as f64 * (ns_per_tick * 1e-6));
            if times.submissions.is_some() {
                passes.push((name, [pair[0], pair[0] + ticks]));
            }
        }
        if let Some(submissions) = &mut times.submissions {
            submissions.push(Submission {
                host,
                ns_per_tick,
                passes,
            });
        }
        Ok(())
    }

    /// A pass that does nothing, for its ticks alone.
    pub fn nothing(&mut self, label: &str) {
        self.begin(label);
    }
}
