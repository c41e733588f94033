//! Labelled buffers, textures and read-back.

use std::sync::mpsc::Receiver;
use std::sync::{MutexGuard, PoisonError};

use bytemuck::{NoUninit, Pod};
use wgpu::util::DeviceExt as _;

use super::context::{GpuContext, GpuError};

const STORAGE: wgpu::BufferUsages = wgpu::BufferUsages::STORAGE
    .union(wgpu::BufferUsages::COPY_SRC)
    .union(wgpu::BufferUsages::COPY_DST);
const EMPTY_STORAGE: wgpu::BufferUsages = STORAGE.union(wgpu::BufferUsages::INDIRECT);

/// Bytes that a storage buffer of `bytes` bytes is given: whole units of 16, and at least one, as WebGPU binds nothing smaller
/// than the struct it holds.
#[must_use]
pub fn allocated_bytes(bytes: u64) -> u64 {
    bytes.max(16).next_multiple_of(16)
}

/// An empty storage buffer of [`allocated_bytes`].
///
/// # Errors
/// [`GpuError::TooLarge`] if the adapter cannot bind it.
pub fn storage_buffer(
    context: &GpuContext,
    label: &str,
    bytes: u64,
) -> Result<wgpu::Buffer, GpuError> {
    empty_buffer(context, label, bytes, EMPTY_STORAGE)
}

fn empty_buffer(
    context: &GpuContext,
    label: &str,
    bytes: u64,
    usage: wgpu::BufferUsages,
) -> Result<wgpu::Buffer, GpuError> {
    check_size(context, label, bytes)?;
    context.count_made();
    context.guarded(label, || {
        Ok(context.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: allocated_bytes(bytes),
            usage,
            mapped_at_creation: false,
        }))
    })
}

/// A texture of one level; `size` is width and height in texels.
#[must_use]
pub fn flat_texture(
    label: &str,
    [width, height]: [u32; 2],
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::TextureDescriptor<'_> {
    wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 1,
        },
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    }
}

/// A storage buffer that holds `data`; an empty slice becomes 1,024 zero bytes, more than any record, so that it
/// can be bound.
///
/// # Errors
/// [`GpuError::TooLarge`] if the adapter cannot bind it.
pub fn storage_buffer_with_data<T: NoUninit>(
    context: &GpuContext,
    label: &str,
    data: &[T],
) -> Result<wgpu::Buffer, GpuError> {
    let bytes: &[u8] = bytemuck::cast_slice(data);
    check_size(context, label, bytes.len() as u64)?;
    context.count_made();
    context.guarded(label, || {
        Ok(context
            .device
            .create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: Some(label),
                contents: if bytes.is_empty() { &[0; 1024] } else { bytes },
                usage: STORAGE,
            }))
    })
}

/// A uniform buffer of `bytes` bytes.
pub fn uniform_buffer(context: &GpuContext, label: &str, bytes: u64) -> wgpu::Buffer {
    context.count_made();
    context.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes.next_multiple_of(16),
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

fn check_size(context: &GpuContext, label: &str, bytes: u64) -> Result<(), GpuError> {
    if bytes > context.max_binding_bytes {
        return Err(GpuError::TooLarge {
            what: label.to_owned(),
            bytes,
            limit: context.max_binding_bytes,
            mend: "use fewer photons, a smaller --size, a smaller scene, or another --adapter",
        });
    }
    Ok(())
}

/// Copies the first `count` elements of a buffer to the host. Waits for the device.
///
/// # Errors
/// [`GpuError::Lost`] or [`GpuError::Validation`], naming `what`.
pub fn read_buffer<T: Pod>(
    context: &GpuContext,
    what: &str,
    buffer: &wgpu::Buffer,
    count: usize,
) -> Result<Vec<T>, GpuError> {
    let bytes = (count * size_of::<T>()) as u64;
    if bytes == 0 {
        return Ok(Vec::new());
    }
    context.count_made();
    let staging = context.guarded(what, || {
        let staging = context.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read-back"),
            size: bytes.next_multiple_of(4),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = context.encoder("read-back");
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, staging.size());
        context.submit(encoder.finish());
        Ok(staging)
    })?;
    let mapping = Mapping::new(staging, bytes);
    context.wait(what)?;
    Ok(bytemuck::pod_collect_to_vec(&mapping.arrive(what)?))
}

/// A staging buffer that is mapped as soon as the device is done with it.
pub(super) struct Mapping {
    pub(super) buffer: wgpu::Buffer,
    bytes: u64,
    mapped: Receiver<Result<(), wgpu::BufferAsyncError>>,
}

impl Mapping {
    /// Asks for the first `bytes` bytes.
    pub(super) fn new(buffer: wgpu::Buffer, bytes: u64) -> Self {
        let (sender, mapped) = std::sync::mpsc::channel();
        buffer.map_async(wgpu::MapMode::Read, .., move |result| {
            // Nobody listens any more where a wait failed.
            let _ = sender.send(result);
        });
        Self {
            buffer,
            bytes,
            mapped,
        }
    }

    /// The bytes; the device must have finished.
    pub(super) fn arrive(self, what: &str) -> Result<Vec<u8>, GpuError> {
        let fail = |reason: String| GpuError::Validation {
            pass: what.to_owned(),
            reason,
        };
        self.mapped
            .recv()
            .map_err(|error| fail(error.to_string()))?
            .map_err(|error| fail(error.to_string()))?;
        let bytes = {
            let view = self
                .buffer
                .slice(..)
                .get_mapped_range()
                .map_err(|error| fail(error.to_string()))?;
            view[..self.bytes as usize].to_vec()
        };
        self.buffer.unmap();
        Ok(bytes)
    }
}

impl GpuContext {
    /// A read-back buffer of at least `bytes` bytes that no submission uses.
    pub(super) fn staging(&self, bytes: u64) -> wgpu::Buffer {
        let mut free = self.free_staging();
        // The smallest that fits: a counter's read would have the next picture allocate another.
        let sizes = free.iter().map(wgpu::Buffer::size).enumerate();
        if let Some((at, _)) = sizes
            .filter(|(_, size)| *size >= bytes)
            .min_by_key(|(_, size)| *size)
        {
            return free.swap_remove(at);
        }
        self.count_made();
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("counters read-back"),
            size: bytes.next_power_of_two().max(4096),
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Keeps a buffer of [`GpuContext::staging`] for later submissions.
    pub(super) fn give_staging_back(&self, buffer: wgpu::Buffer) {
        self.free_staging().push(buffer);
    }

    fn free_staging(&self) -> MutexGuard<'_, Vec<wgpu::Buffer>> {
        let free = self.free_staging.lock();
        free.unwrap_or_else(PoisonError::into_inner)
    }
}

/// A buffer that is made anew, larger, when an upload no longer fits.
pub struct GrowingBuffer {
    label: &'static str,
    usage: wgpu::BufferUsages,
    buffer: Option<wgpu::Buffer>,
}

impl GrowingBuffer {
    /// A storage buffer; nothing allocated yet.
    pub const fn new(label: &'static str) -> Self {
        Self::with_usage(label, EMPTY_STORAGE)
    }

    /// As [`GrowingBuffer::new`], for another use.
    pub const fn with_usage(label: &'static str, usage: wgpu::BufferUsages) -> Self {
        Self {
            label,
            usage: usage.union(wgpu::BufferUsages::COPY_DST),
            buffer: None,
        }
    }

    /// Uploads `data`; true if the buffer is another one now, so that it must be bound again.
    ///
    /// # Errors
    /// As [`storage_buffer`].
    pub fn upload<T: NoUninit>(
        &mut self,
        context: &GpuContext,
        data: &[T],
    ) -> Result<bool, GpuError> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let fits = self
            .buffer
            .as_ref()
            .is_some_and(|buffer| buffer.size() >= bytes.len() as u64);
        if !fits {
            // A quarter more, so that a scene that grows by one instance does not reallocate every frame.
            let capacity =
                (bytes.len() as u64 + bytes.len() as u64 / 4).min(context.max_binding_bytes);
            let capacity = capacity.max(bytes.len() as u64).max(256);
            self.buffer = Some(empty_buffer(context, self.label, capacity, self.usage)?);
        }
        if let Some(buffer) = &self.buffer
            && !bytes.is_empty()
        {
            context.queue.write_buffer(buffer, 0, bytes);
        }
        Ok(!fits)
    }

    /// Uploads only `range` of `data`, if the buffer holds `data` otherwise; all of it where it does not fit. True as
    /// [`GrowingBuffer::upload`].
    ///
    /// # Errors
    /// As [`storage_buffer`].
    pub fn upload_range<T: NoUninit>(
        &mut self,
        context: &GpuContext,
        data: &[T],
        range: std::ops::Range<usize>,
    ) -> Result<bool, GpuError> {
        let fits = self
            .buffer
            .as_ref()
            .filter(|buffer| buffer.size() >= size_of_val(data) as u64);
        let (Some(buffer), Some(part)) = (fits, data.get(range.clone())) else {
            return self.upload(context, data);
        };
        if !part.is_empty() {
            let offset = (range.start * size_of::<T>()) as u64;
            context
                .queue
                .write_buffer(buffer, offset, bytemuck::cast_slice(part));
        }
        Ok(false)
    }

    /// The buffer, if anything was uploaded.
    pub fn buffer(&self) -> Option<&wgpu::Buffer> {
        self.buffer.as_ref()
    }
}

/// A storage buffer that keeps what it holds when it grows or shrinks.
pub struct ArrayBuffer {
    label: &'static str,
    buffer: wgpu::Buffer,
}

impl ArrayBuffer {
    /// As [`storage_buffer_with_data`].
    ///
    /// # Errors
    /// As [`storage_buffer_with_data`].
    pub fn with_data<T: NoUninit>(
        context: &GpuContext,
        label: &'static str,
        data: &[T],
    ) -> Result<Self, GpuError> {
        let buffer = storage_buffer_with_data(context, label, data)?;
        Ok(Self { label, buffer })
    }

    /// Makes room for `bytes` bytes: with a quarter to spare where it has too few or more than double. The device copies what
    /// there is. True if the buffer is another one now, so that it must be bound again.
    ///
    /// # Errors
    /// As [`storage_buffer`].
    pub fn fit(&mut self, context: &GpuContext, bytes: u64) -> Result<bool, GpuError> {
        /// What an empty array has.
        const LEAST: u64 = 1024;
        let bytes = bytes.max(LEAST);
        let size = self.buffer.size();
        if bytes <= size && size <= 2 * bytes {
            return Ok(false);
        }
        let roomy = (bytes + bytes / 4).min(context.max_binding_bytes);
        let buffer = storage_buffer(context, self.label, roomy.max(bytes))?;
        context.guarded(self.label, || {
            let mut encoder = context.encoder(self.label);
            let kept = size.min(buffer.size());
            encoder.copy_buffer_to_buffer(&self.buffer, 0, &buffer, 0, kept);
            context.submit(encoder.finish());
            Ok(())
        })?;
        self.buffer = buffer;
        Ok(true)
    }

    /// Writes `data`'s elements of `range` to where they lie in it.
    pub fn write<T: NoUninit>(
        &self,
        context: &GpuContext,
        data: &[T],
        range: std::ops::Range<usize>,
    ) -> std::ops::Range<u64> {
        let first = (range.start * size_of::<T>()) as u64;
        let bytes: &[u8] = bytemuck::cast_slice(&data[range]);
        if !bytes.is_empty() {
            context.queue.write_buffer(&self.buffer, first, bytes);
        }
        first..first + bytes.len() as u64
    }

    /// The buffer.
    pub fn buffer(&self) -> &wgpu::Buffer {
        &self.buffer
    }
}
