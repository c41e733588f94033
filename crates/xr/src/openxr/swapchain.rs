//! One eye's images: a colour swapchain, and a depth swapchain where depth is submitted.

use openxr as xr;

use super::runtime::{RuntimeError, failed};
use stereolux_gpu::vulkan_interop::openxr as interop;
use stereolux_gpu::{GpuContext, QueueTurn};
use stereolux_settings::ImageFormat;

/// Colour formats that a tone-mapped image goes into, with Vulkan's numbers. Both keep the eye's 8 bits of lightness:
/// sRGB by its curve, half floats by 11 bits everywhere. 8-bit formats without the curve band in the dark, and 16-bit
/// normalised ones need a device feature that few need otherwise.
const COLORS: &[(u32, wgpu::TextureFormat, ImageFormat)] = &[
    (43, wgpu::TextureFormat::Rgba8UnormSrgb, ImageFormat::Srgb),
    (50, wgpu::TextureFormat::Bgra8UnormSrgb, ImageFormat::Srgb),
    (97, wgpu::TextureFormat::Rgba16Float, ImageFormat::Half),
];
/// Vulkan's number of 32-bit float depth.
const D32_SFLOAT: u32 = 126;

/// The call that failed, and how.
pub(super) type Failed = (&'static str, xr::sys::Result);

/// A swapchain with its images as textures.
struct Images {
    textures: Vec<wgpu::Texture>,
    handle: xr::Swapchain<xr::Vulkan>,
    is_acquired: bool,
    queue_turn: QueueTurn,
}

impl Images {
    fn new(
        session: &xr::Session<xr::Vulkan>,
        context: &GpuContext,
        [width, height]: [u32; 2],
        raw_format: u32,
        format: wgpu::TextureFormat,
        label: &str,
    ) -> Result<Self, RuntimeError> {
        let usage_flags = if format.is_depth_stencil_format() {
            xr::SwapchainUsageFlags::DEPTH_STENCIL_ATTACHMENT
        } else {
            xr::SwapchainUsageFlags::COLOR_ATTACHMENT
        };
        let handle = session
            .create_swapchain(&xr::SwapchainCreateInfo {
                create_flags: xr::SwapchainCreateFlags::EMPTY,
                usage_flags: usage_flags | xr::SwapchainUsageFlags::SAMPLED,
                format: raw_format,
                sample_count: 1,
                width,
                height,
                face_count: 1,
                array_size: 1,
                mip_count: 1,
            })
            .map_err(failed("xrCreateSwapchain"))?;
        let textures = handle
            .enumerate_images()
            .map_err(failed("xrEnumerateSwapchainImages"))?
            .into_iter()
            .map(|image| {
                interop::wrap_image(&context.device, image, format, [width, height], label)
            })
            .collect::<Option<Vec<_>>>()
            .ok_or_else(|| RuntimeError::Vulkan("the device is not Vulkan's".to_owned()))?;
        Ok(Self {
            textures,
            handle,
            is_acquired: false,
            queue_turn: context.queue_turn(),
        })
    }

    fn acquire(&mut self) -> Result<wgpu::TextureView, Failed> {
        let turn = self.queue_turn.take();
        let index = self
            .handle
            .acquire_image()
            .map_err(|error| ("xrAcquireSwapchainImage", error))?;
        drop(turn);
        self.is_acquired = true;
        self.handle
            .wait_image(xr::Duration::INFINITE)
            .map_err(|error| ("xrWaitSwapchainImage", error))?;
        self.textures
            .get(index as usize)
            .map(|texture| texture.create_view(&wgpu::TextureViewDescriptor::default()))
            .ok_or((
                "xrAcquireSwapchainImage",
                xr::sys::Result::ERROR_RUNTIME_FAILURE,
            ))
    }

    fn release(&mut self) -> Result<(), Failed> {
        if !std::mem::take(&mut self.is_acquired) {
            return Ok(());
        }
        let _turn = self.queue_turn.take();
        self.handle
            .release_image()
            .map_err(|error| ("xrReleaseSwapchainImage", error))
    }
}

/// One eye's swapchains.
pub(super) struct EyeSwapchains {
    color: Images,
    depth: Option<Images>,
    format: wgpu::TextureFormat,
}

impl EyeSwapchains {
    /// Both eyes' swapchains, in the first usable format of the runtime's own order.
    pub(super) fn pair(
        session: &xr::Session<xr::Vulkan>,
        context: &GpuContext,
        size: [u32; 2],
        wanted: ImageFormat,
        with_depth: bool,
    ) -> Result<[Self; 2], RuntimeError> {
        let offered = session
            .enumerate_swapchain_formats()
            .map_err(failed("xrEnumerateSwapchainFormats"))?;
        let (raw, format, _) = *offered
            .iter()
            .find_map(|raw| {
                COLORS.iter().find(|(known, _, kind)| {
                    known == raw && (wanted == ImageFormat::Auto || wanted == *kind)
                })
            })
            .ok_or_else(|| {
                RuntimeError::Vulkan(format!(
                    "the runtime offers no {} colour format (its formats: {offered:?})",
                    match wanted {
                        ImageFormat::Auto => "sRGB or half-float",
                        ImageFormat::Srgb => "sRGB",
                        ImageFormat::Half => "half-float",
                    }
                ))
            })?;
        let with_depth = with_depth && offered.contains(&D32_SFLOAT);
        let eye = |name: &str| {
            Ok::<_, RuntimeError>(Self {
                color: Images::new(
                    session,
                    context,
                    size,
                    raw,
                    format,
                    &format!("{name} submitted colour"),
                )?,
                depth: with_depth
                    .then(|| {
                        Images::new(
                            session,
                            context,
                            size,
                            D32_SFLOAT,
                            wgpu::TextureFormat::Depth32Float,
                            &format!("{name} submitted depth"),
                        )
                    })
                    .transpose()?,
                format,
            })
        };
        Ok([eye("left")?, eye("right")?])
    }

    pub(super) fn format(&self) -> wgpu::TextureFormat {
        self.format
    }

    pub(super) fn color(&self) -> &xr::Swapchain<xr::Vulkan> {
        &self.color.handle
    }

    pub(super) fn depth(&self) -> Option<&xr::Swapchain<xr::Vulkan>> {
        self.depth.as_ref().map(|depth| &depth.handle)
    }

    /// Waits for the next images.
    pub(super) fn acquire(
        &mut self,
    ) -> Result<(wgpu::TextureView, Option<wgpu::TextureView>), Failed> {
        let color = self.color.acquire()?;
        let depth = self.depth.as_mut().map(Images::acquire).transpose()?;
        Ok((color, depth))
    }

    /// Gives the images back; what renders them has been submitted.
    pub(super) fn release(&mut self) -> Result<(), Failed> {
        self.color.release()?;
        self.depth.as_mut().map_or(Ok(()), Images::release)
    }

    /// Drops the textures; the swapchains stay.
    pub(super) fn forget_images(&mut self) {
        self.color.textures.clear();
        if let Some(depth) = &mut self.depth {
            depth.textures.clear();
        }
    }
}
