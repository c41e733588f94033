//! Recording of a frame's passes with a timestamp before and after each.

use std::collections::BTreeMap;
use std::time::Instant;

use super::buffers::Mapping;
use super::context::{GpuContext, GpuError};
use super::kernel::Kernel;
use super::texels::TexelCopy;

/// Queries of one set; wgpu's own limit.
const QUERIES: u32 = 4096;

/// Host milliseconds that have passed.
pub fn milliseconds_since(began: Instant) -> f64 {
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
    pub fn since(stage: &'static str, began: Instant) -> Self {
        let ended = Instant::now();
        Self {
            stage,
            began,
            ended,
        }
    }

    /// Milliseconds from its beginning to its end.
    pub fn ms(&self) -> f64 {
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

    /// Milliseconds of the passes whose names are wanted, together.
    pub fn sum_ms(&self, wanted: impl Fn(&str) -> bool) -> f64 {
        let passes = self.passes.iter().filter(|(name, _)| wanted(name));
        // `sum` begins with -0, which files would show.
        passes.fold(0.0, |total, (_, (ms, _))| total + ms)
    }

    /// Milliseconds of all passes together.
    pub fn total_ms(&self) -> f64 {
        self.sum_ms(|_| true)
    }
}

/// What a pair of timestamps encloses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Timed {
    /// A pass.
    Passes,
    /// Passes that follow each other and whose labels begin alike, up to the point: `left.stage`.
    Stages,
}

/// Query set and buffers for timing; made once and used by every frame.
pub struct Timer {
    timed: Timed,
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
}

impl Timer {
    /// A timer, or `None` if the adapter has no timestamps.
    pub fn new(context: &GpuContext, timed: Timed) -> Option<Self> {
        context.has_timestamps.then(|| {
            let bytes = u64::from(QUERIES) * 8;
            context.count_made();
            Self {
                timed,
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
            }
        })
    }
}

/// How many workgroups a dispatch has.
#[derive(Clone, Copy)]
pub enum Workgroups<'a> {
    /// So many along each axis.
    Direct([u32; 3]),
    /// As counted on the device: three words of a buffer, from this byte on.
    Indirect(&'a wgpu::Buffer, u64),
}

/// Records the passes of one submission.
pub struct FrameRecorder<'a> {
    context: &'a GpuContext,
    timer: Option<&'a Timer>,
    encoder: wgpu::CommandEncoder,
    /// The compute pass that dispatches go to until something else is recorded: wgpu makes a command buffer or two of each.
    open: Option<wgpu::ComputePass<'static>>,
    timed: Vec<String>,
    dispatched: Vec<String>,
    /// The stage that is being timed, and its first query.
    stage: Option<(String, u32)>,
    reads: Vec<Vec<(wgpu::Buffer, u64, u64)>>,
}

impl<'a> FrameRecorder<'a> {
    /// Starts a command buffer.
    pub fn new(context: &'a GpuContext, timer: Option<&'a Timer>, label: &str) -> Self {
        Self {
            context,
            timer,
            encoder: context.encoder(label),
            open: None,
            timed: Vec::new(),
            dispatched: Vec::new(),
            stage: None,
            reads: Vec::new(),
        }
    }

    /// Passes that still fit into the timer.
    pub fn room(&self) -> usize {
        (QUERIES / 2) as usize - self.timed.len()
    }

    /// The pass that `label` is to be dispatched in: a timed one begins anew, any other goes on with the open one.
    fn begin(&mut self, label: &str) -> &mut wgpu::ComputePass<'static> {
        self.dispatched.push(label.to_owned());
        let is_of_stage = self.times_stages();
        let slot = if is_of_stage {
            self.enter_stage(label)
        } else {
            self.next_slot(label)
        };
        let open = self.open.take().filter(|_| slot.is_none());
        let timestamp_writes = slot.map(|(timer, slot)| wgpu::ComputePassTimestampWrites {
            query_set: &timer.queries,
            beginning_of_pass_write_index: Some(slot),
            end_of_pass_write_index: (!is_of_stage).then_some(slot + 1),
        });
        self.open.insert(open.unwrap_or_else(|| {
            let descriptor = wgpu::ComputePassDescriptor {
                label: Some(label),
                timestamp_writes,
            };
            self.encoder
                .begin_compute_pass(&descriptor)
                .forget_lifetime()
        }))
    }

    /// What records, apart from dispatches.
    fn encoder(&mut self) -> &mut wgpu::CommandEncoder {
        self.open = None;
        &mut self.encoder
    }

    /// Dispatches `kernel` under the name `label`.
    pub fn dispatch(
        &mut self,
        label: &str,
        kernel: &Kernel,
        bound: &wgpu::BindGroup,
        dispatch_index: u32,
        groups: Workgroups<'_>,
    ) {
        if self.context.admits(label) == Some(false) {
            return;
        }
        let pass = self.begin(label);
        kernel.set(pass, bound, dispatch_index);
        pass.insert_debug_marker(label);
        match groups {
            Workgroups::Direct([x, y, z]) => pass.dispatch_workgroups(x, y, z),
            Workgroups::Indirect(counted, at) => pass.dispatch_workgroups_indirect(counted, at),
        }
        self.cut();
    }

    /// Where passes can be given up: submits what is recorded and waits for it. An error is that of the next submission.
    fn cut(&mut self) {
        if self.context.admits("").is_none() {
            return;
        }
        let device = &self.context.device;
        let next = device.create_command_encoder(&Default::default());
        let recorded = std::mem::replace(self.encoder(), next);
        let index = self.context.submit(recorded.finish());
        if let Err(error) = self.context.retire("pass", index) {
            log::debug!("between passes: {error}");
        }
    }

    /// Zeroes the first `bytes` bytes of a buffer.
    pub fn clear(&mut self, buffer: &wgpu::Buffer, bytes: u64) {
        self.encoder().clear_buffer(buffer, 0, Some(bytes));
    }

    /// Copies `bytes` bytes between places (a buffer and its first byte).
    pub fn copy(&mut self, from: (&wgpu::Buffer, u64), to: (&wgpu::Buffer, u64), bytes: u64) {
        self.encoder()
            .copy_buffer_to_buffer(from.0, from.1, to.0, to.1, bytes);
    }

    /// Copies a buffer into the texture that holds its copy; timed as `label` where the adapter can time copies.
    pub fn copy_to_texels(&mut self, label: &str, from: &wgpu::Buffer, bytes: u64, to: &TexelCopy) {
        let slot = if self.context.times_copies && !self.times_stages() {
            self.next_slot(label)
        } else {
            None
        };
        if let Some((timer, slot)) = slot {
            self.encoder().write_timestamp(&timer.queries, slot);
        }
        to.record(self.encoder(), from, 0..bytes);
        if let Some((timer, slot)) = slot {
            self.encoder().write_timestamp(&timer.queries, slot + 1);
        }
    }

    fn times_stages(&self) -> bool {
        self.timer.is_some_and(|timer| timer.timed == Timed::Stages)
    }

    /// The queries of the stage that `label` begins; none within one.
    fn enter_stage(&mut self, label: &str) -> Option<(&'a Timer, u32)> {
        let stage = label.split_once('.').map_or(label, |(stage, _)| stage);
        if self.stage.as_ref().is_some_and(|(open, _)| open == stage) {
            return None;
        }
        self.leave_stage();
        let (timer, slot) = self.next_slot(&format!("{stage}.stage"))?;
        self.stage = Some((stage.to_owned(), slot));
        Some((timer, slot))
    }

    /// Ends the stage by an empty pass, since its last pass was not known to be the last.
    fn leave_stage(&mut self) {
        if let (Some((_, slot)), Some(timer)) = (self.stage.take(), self.timer) {
            self.encoder()
                .begin_compute_pass(&wgpu::ComputePassDescriptor {
                    label: Some("end of a stage"),
                    timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                        query_set: &timer.queries,
                        beginning_of_pass_write_index: None,
                        end_of_pass_write_index: Some(slot + 1),
                    }),
                });
        }
    }

    /// The next two queries, noted as `label`'s; none where there is no timer or it is full.
    fn next_slot(&mut self, label: &str) -> Option<(&'a Timer, u32)> {
        let slot = 2 * self.timed.len() as u32;
        let timer = self.timer.filter(|_| slot + 1 < QUERIES)?;
        self.timed.push(label.to_owned());
        Some((timer, slot))
    }

    /// Asks for `ranges` (buffer, first byte, bytes; multiples of 4) as they are after the passes recorded so far: together
    /// they are one of the ticket's values.
    pub fn read(&mut self, ranges: &[(&wgpu::Buffer, u64, u64)]) {
        let owned = ranges
            .iter()
            .map(|(buffer, first, bytes)| ((*buffer).clone(), *first, *bytes));
        self.reads.push(owned.collect());
    }

    /// Submits, waits, and adds the device times to `times`. The wait is counted.
    ///
    /// # Errors
    /// As [`FrameRecorder::send`].
    pub fn submit(self, stage: &'static str, times: &mut PassTimes) -> Result<(), GpuError> {
        let context = self.context;
        let ticket = self.send(stage)?;
        context.count_wait();
        ticket.arrive(context, times).map(drop)
    }

    /// Submits without waiting.
    ///
    /// # Errors
    /// [`GpuError::Validation`] or [`GpuError::Lost`], naming `stage` (wgpu's own words name the pass by its label).
    pub fn send(mut self, stage: &'static str) -> Result<Ticket, GpuError> {
        self.leave_stage();
        self.open = None;
        let Self {
            context,
            timer,
            mut encoder,
            open: _,
            timed,
            dispatched,
            stage: _,
            reads,
        } = self;
        let tick_bytes = 16 * timed.len() as u64;
        let read_bytes = reads
            .iter()
            .map(|value| value.iter().map(|(_, _, bytes)| bytes).sum());
        let read_bytes: Vec<u64> = read_bytes.collect();
        let bytes = tick_bytes + read_bytes.iter().sum::<u64>();
        let began = Instant::now();
        let (index, staging) = context.guarded(stage, || {
            let staging = (bytes > 0).then(|| context.staging(bytes));
            if let Some(staging) = &staging {
                if let Some(timer) = timer.filter(|_| tick_bytes > 0) {
                    let queries = 0..2 * timed.len() as u32;
                    encoder.resolve_query_set(&timer.queries, queries, &timer.resolved, 0);
                    encoder.copy_buffer_to_buffer(&timer.resolved, 0, staging, 0, tick_bytes);
                }
                let mut at = tick_bytes;
                for (buffer, first, bytes) in reads.iter().flatten() {
                    encoder.copy_buffer_to_buffer(buffer, *first, staging, at, *bytes);
                    at += bytes;
                }
            }
            Ok((context.submit(encoder.finish()), staging))
        })?;
        Ok(Ticket {
            stage,
            index,
            began,
            timed,
            dispatched,
            read_bytes,
            staging: staging.map(|staging| Mapping::new(staging, bytes)),
        })
    }

    /// A pass that does nothing, for its ticks alone.
    pub fn nothing(&mut self, label: &str) {
        self.begin(label);
    }
}

/// A submission on its way.
pub struct Ticket {
    stage: &'static str,
    index: wgpu::SubmissionIndex,
    began: Instant,
    timed: Vec<String>,
    dispatched: Vec<String>,
    read_bytes: Vec<u64>,
    staging: Option<Mapping>,
}

impl Ticket {
    /// Waits until the device has finished it, adds its times to `times` and returns what [`FrameRecorder::read`] asked
    /// for, in that order. The wait is the frame's end, and is not counted.
    ///
    /// # Errors
    /// As [`FrameRecorder::send`].
    pub fn arrive(
        self,
        context: &GpuContext,
        times: &mut PassTimes,
    ) -> Result<Vec<Vec<u8>>, GpuError> {
        context.retire(self.stage, self.index)?;
        times.dispatched.extend(self.dispatched);
        let Some(staging) = self.staging else {
            return Ok(Vec::new());
        };
        let buffer = staging.buffer.clone();
        let bytes = staging.arrive(self.stage)?;
        context.give_staging_back(buffer);
        let host = HostSpan::since(self.stage, self.began);
        let ns_per_tick = f64::from(context.queue.get_timestamp_period());
        let (ticks, mut values) = bytes.split_at(16 * self.timed.len());
        let ticks: Vec<[u64; 2]> = bytemuck::pod_collect_to_vec(ticks);
        let mut passes = Vec::new();
        for (name, [first, last]) in self.timed.into_iter().zip(ticks) {
            // A device may reset its clock between two queries; such a pair says nothing.
            let ticks = last.saturating_sub(first);
            times.add(&name, ticks as f64 * (ns_per_tick * 1e-6));
            if times.submissions.is_some() {
                passes.push((name, [first, first + ticks]));
            }
        }
        if let Some(submissions) = times.submissions.as_mut().filter(|_| !passes.is_empty()) {
            submissions.push(Submission {
                host,
                ns_per_tick,
                passes,
            });
        }
        let mut take = |bytes: u64| {
            let (value, rest) = values.split_at(bytes as usize);
            values = rest;
            value.to_vec()
        };
        Ok(self.read_bytes.into_iter().map(&mut take).collect())
    }
}
