//! `XR_KHR_vulkan_enable2`: the first adapter, devices as asked for, and images of the runtime's own.

use std::ffi::c_void;

use ash::vk;
use ash::vk::Handle as _;
use openxr_sys as xr;
use xr::{Handle as _, Result as R};

use crate::{asked_for, fill, state};

/// Images per swapchain.
const IMAGES: usize = 2;

/// What the program made through the runtime.
pub(crate) struct Device {
    instance: ash::Instance,
    physical: vk::PhysicalDevice,
    device: Option<ash::Device>,
}

/// Images that the runtime owns.
pub(crate) struct Swapchain {
    images: Vec<(vk::Image, vk::DeviceMemory)>,
    acquired: usize,
}

fn loader(function: Option<xr::platform::VkGetInstanceProcAddr>) -> Option<ash::StaticFn> {
    // SAFETY: one C function under two Rust types.
    let get_instance_proc_addr = unsafe {
        std::mem::transmute::<xr::platform::VkGetInstanceProcAddr, vk::PFN_vkGetInstanceProcAddr>(
            function?,
        )
    };
    Some(ash::StaticFn {
        get_instance_proc_addr,
    })
}

pub(crate) unsafe extern "system" fn requirements(
    _: xr::Instance,
    _: xr::SystemId,
    out: *mut xr::GraphicsRequirementsVulkanKHR,
) -> R {
    (*out).min_api_version_supported = xr::Version::new(1, 0, 0);
    (*out).max_api_version_supported = xr::Version::new(1, 3, 0);
    R::SUCCESS
}

pub(crate) unsafe extern "system" fn create_instance(
    _: xr::Instance,
    info: *const xr::VulkanInstanceCreateInfoKHR,
    out: *mut xr::platform::VkInstance,
    result: *mut xr::platform::VkResult,
) -> R {
    let Some(loader) = loader((*info).pfn_get_instance_proc_addr) else {
        return R::ERROR_VALIDATION_FAILURE;
    };
    let entry = ash::Entry::from_static_fn(loader);
    match entry.create_instance(
        &*(*info)
            .vulkan_create_info
            .cast::<vk::InstanceCreateInfo<'_>>(),
        None,
    ) {
        Ok(instance) => {
            out.write(instance.handle().as_raw() as usize as *const c_void);
            result.write(vk::Result::SUCCESS.as_raw());
            state().vulkan = Some(Device {
                instance,
                physical: vk::PhysicalDevice::null(),
                device: None,
            });
        }
        Err(error) => result.write(error.as_raw()),
    }
    R::SUCCESS
}

pub(crate) unsafe extern "system" fn graphics_device(
    _: xr::Instance,
    _: *const xr::VulkanGraphicsDeviceGetInfoKHR,
    out: *mut xr::platform::VkPhysicalDevice,
) -> R {
    let mut state = state();
    let Some(vulkan) = &mut state.vulkan else {
        return R::ERROR_CALL_ORDER_INVALID;
    };
    let Some(first) = vulkan
        .instance
        .enumerate_physical_devices()
        .ok()
        .and_then(|all| all.first().copied())
    else {
        return R::ERROR_RUNTIME_FAILURE;
    };
    vulkan.physical = first;
    out.write(first.as_raw() as usize as *const c_void);
    R::SUCCESS
}

pub(crate) unsafe extern "system" fn create_device(
    _: xr::Instance,
    info: *const xr::VulkanDeviceCreateInfoKHR,
    out: *mut xr::platform::VkDevice,
    result: *mut xr::platform::VkResult,
) -> R {
    if asked_for("no_device") {
        result.write(vk::Result::ERROR_INITIALIZATION_FAILED.as_raw());
        return R::SUCCESS;
    }
    let mut state = state();
    let Some(vulkan) = &mut state.vulkan else {
        return R::ERROR_CALL_ORDER_INVALID;
    };
    let create_info = &*(*info)
        .vulkan_create_info
        .cast::<vk::DeviceCreateInfo<'_>>();
    match vulkan
        .instance
        .create_device(vulkan.physical, create_info, None)
    {
        Ok(device) => {
            out.write(device.handle().as_raw() as usize as *const c_void);
            result.write(vk::Result::SUCCESS.as_raw());
            vulkan.device = Some(device);
        }
        Err(error) => result.write(error.as_raw()),
    }
    R::SUCCESS
}

unsafe fn image(
    vulkan: &Device,
    device: &ash::Device,
    info: &xr::SwapchainCreateInfo,
) -> Result<(vk::Image, vk::DeviceMemory), vk::Result> {
    let image = device.create_image(
        &vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk::Format::from_raw(info.format as i32))
            .extent(vk::Extent3D {
                width: info.width,
                height: info.height,
                depth: 1,
            })
            .mip_levels(1)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .usage(vk::ImageUsageFlags::COLOR_ATTACHMENT | vk::ImageUsageFlags::SAMPLED),
        None,
    )?;
    let needs = device.get_image_memory_requirements(image);
    let memory_type = vulkan
        .instance
        .get_physical_device_memory_properties(vulkan.physical)
        .memory_types_as_slice()
        .iter()
        .enumerate()
        .position(|(index, kind)| {
            needs.memory_type_bits >> index & 1 == 1
                && kind
                    .property_flags
                    .contains(vk::MemoryPropertyFlags::DEVICE_LOCAL)
        })
        .ok_or(vk::Result::ERROR_OUT_OF_DEVICE_MEMORY)?;
    let memory = device.allocate_memory(
        &vk::MemoryAllocateInfo::default()
            .allocation_size(needs.size)
            .memory_type_index(memory_type as u32),
        None,
    )?;
    device.bind_image_memory(image, memory, 0)?;
    Ok((image, memory))
}

pub(crate) unsafe extern "system" fn create_swapchain(
    _: xr::Session,
    info: *const xr::SwapchainCreateInfo,
    out: *mut xr::Swapchain,
) -> R {
    let mut state = state();
    let Some(vulkan) = &state.vulkan else {
        return R::ERROR_CALL_ORDER_INVALID;
    };
    let Some(device) = &vulkan.device else {
        return R::ERROR_CALL_ORDER_INVALID;
    };
    let Ok(images) = (0..IMAGES)
        .map(|_| image(vulkan, device, &*info))
        .collect::<Result<Vec<_>, _>>()
    else {
        return R::ERROR_RUNTIME_FAILURE;
    };
    let handle = state.handle();
    let made = Swapchain {
        images,
        acquired: 0,
    };
    state.swapchains.insert(handle, made);
    out.write(xr::Swapchain::from_raw(handle));
    R::SUCCESS
}

pub(crate) unsafe extern "system" fn destroy_swapchain(swapchain: xr::Swapchain) -> R {
    let mut state = state();
    let Some(Swapchain { images, .. }) = state.swapchains.remove(&swapchain.into_raw()) else {
        return R::ERROR_HANDLE_INVALID;
    };
    if let Some(device) = state
        .vulkan
        .as_ref()
        .and_then(|vulkan| vulkan.device.as_ref())
    {
        for (image, memory) in images {
            device.destroy_image(image, None);
            device.free_memory(memory, None);
        }
    }
    R::SUCCESS
}

pub(crate) unsafe extern "system" fn swapchain_images(
    swapchain: xr::Swapchain,
    capacity: u32,
    count: *mut u32,
    out: *mut xr::SwapchainImageBaseHeader,
) -> R {
    let state = state();
    let Some(found) = state.swapchains.get(&swapchain.into_raw()) else {
        return R::ERROR_HANDLE_INVALID;
    };
    let out = out.cast::<xr::SwapchainImageVulkanKHR>();
    fill(&found.images, capacity, count, |index, (image, _)| {
        (*out.add(index)).image = image.as_raw();
    })
}

pub(crate) unsafe extern "system" fn acquire_image(
    swapchain: xr::Swapchain,
    _: *const xr::SwapchainImageAcquireInfo,
    out: *mut u32,
) -> R {
    let mut state = state();
    state.session.is_lost |= state.fails_now("acquire_lost");
    if state.session.is_lost {
        return R::ERROR_SESSION_LOST;
    }
    let Some(found) = state.swapchains.get_mut(&swapchain.into_raw()) else {
        return R::ERROR_HANDLE_INVALID;
    };
    out.write((found.acquired % IMAGES) as u32);
    found.acquired += 1;
    R::SUCCESS
}
