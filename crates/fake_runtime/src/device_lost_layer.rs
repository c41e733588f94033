//! A Vulkan layer that loses the device: from the submission numbered `FAKE_DEVICE_LOST_AFTER` on, submitting and
//! waiting return `VK_ERROR_DEVICE_LOST`, as drivers do after a hang or when the adapter is unplugged.
//!
//! The loader opens it through a manifest, by `VK_INSTANCE_LAYERS` (the loader's document "LoaderLayerInterface.md",
//! interface version 2). One instance and one device at a time are enough here.

use std::ffi::{CStr, c_char, c_void};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use ash::vk;

static SUBMISSIONS: AtomicU64 = AtomicU64::new(0);
static IS_LOST: AtomicBool = AtomicBool::new(false);

/// What comes after this layer.
struct Next {
    instance: Option<vk::PFN_vkGetInstanceProcAddr>,
    instance_handle: vk::Instance,
    device: Option<vk::PFN_vkGetDeviceProcAddr>,
    device_handle: vk::Device,
}

static NEXT: Mutex<Next> = Mutex::new(Next {
    instance: None,
    instance_handle: vk::Instance::null(),
    device: None,
    device_handle: vk::Device::null(),
});

fn next() -> MutexGuard<'static, Next> {
    NEXT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// `VkNegotiateLayerInterface`.
#[repr(C)]
pub struct NegotiateLayerInterface {
    s_type: u32,
    next: *mut c_void,
    version: u32,
    get_instance_proc_addr: Option<vk::PFN_vkGetInstanceProcAddr>,
    get_device_proc_addr: Option<vk::PFN_vkGetDeviceProcAddr>,
    get_physical_device_proc_addr: Option<vk::PFN_vkGetInstanceProcAddr>,
}

/// `VkLayerInstanceCreateInfo` and `VkLayerDeviceCreateInfo`, as far as they are alike.
#[repr(C)]
struct LayerCreateInfo {
    s_type: vk::StructureType,
    next: *const c_void,
    /// 0: `link` it is.
    function: u32,
    link: *mut Link,
}

/// `VkLayerInstanceLink` and `VkLayerDeviceLink`; the last field of the first is another function.
#[repr(C)]
struct Link {
    next: *mut Link,
    get_instance_proc_addr: vk::PFN_vkGetInstanceProcAddr,
    get_device_proc_addr: vk::PFN_vkGetDeviceProcAddr,
}

/// Takes this layer's link off the chain behind `p_next`.
unsafe fn take_link(mut p_next: *const c_void, s_type: vk::StructureType) -> Option<*mut Link> {
    while !p_next.is_null() {
        let info = p_next.cast::<LayerCreateInfo>().cast_mut();
        if (*info).s_type == s_type && (*info).function == 0 {
            let link = (*info).link;
            (*info).link = (*link).next;
            return Some(link);
        }
        p_next = (*info).next;
    }
    None
}

/// The loader's entry point.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn vkNegotiateLoaderLayerInterfaceVersion(
    interface: *mut NegotiateLayerInterface,
) -> vk::Result {
    (*interface).version = 2;
    (*interface).get_instance_proc_addr = Some(instance_proc_addr);
    (*interface).get_device_proc_addr = Some(device_proc_addr);
    (*interface).get_physical_device_proc_addr = None;
    vk::Result::SUCCESS
}

macro_rules! void {
    ($kind:ident, $function:expr) => {{
        let typed: vk::$kind = $function;
        // SAFETY: one function pointer under another type; the caller casts it back.
        Some(std::mem::transmute::<vk::$kind, unsafe extern "system" fn()>(typed))
    }};
}

unsafe extern "system" fn instance_proc_addr(
    instance: vk::Instance,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    match CStr::from_ptr(name).to_bytes() {
        b"vkGetInstanceProcAddr" => void!(PFN_vkGetInstanceProcAddr, instance_proc_addr),
        b"vkCreateInstance" => void!(PFN_vkCreateInstance, create_instance),
        b"vkCreateDevice" => void!(PFN_vkCreateDevice, create_device),
        _ => own(name).or_else(|| {
            let function = next().instance?;
            function(instance, name)
        }),
    }
}

unsafe extern "system" fn device_proc_addr(
    device: vk::Device,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    own(name).or_else(|| {
        let function = next().device?;
        function(device, name)
    })
}

/// What this layer answers itself.
unsafe fn own(name: *const c_char) -> vk::PFN_vkVoidFunction {
    match CStr::from_ptr(name).to_bytes() {
        b"vkGetDeviceProcAddr" => void!(PFN_vkGetDeviceProcAddr, device_proc_addr),
        b"vkQueueSubmit" => void!(PFN_vkQueueSubmit, queue_submit),
        b"vkWaitForFences" => void!(PFN_vkWaitForFences, wait_for_fences),
        b"vkGetFenceStatus" => void!(PFN_vkGetFenceStatus, fence_status),
        b"vkWaitSemaphores" | b"vkWaitSemaphoresKHR" => {
            void!(PFN_vkWaitSemaphores, wait_semaphores)
        }
        b"vkGetSemaphoreCounterValue" | b"vkGetSemaphoreCounterValueKHR" => {
            void!(PFN_vkGetSemaphoreCounterValue, semaphore_value)
        }
        b"vkDeviceWaitIdle" => void!(PFN_vkDeviceWaitIdle, device_wait_idle),
        b"vkQueueWaitIdle" => void!(PFN_vkQueueWaitIdle, queue_wait_idle),
        _ => None,
    }
}

unsafe extern "system" fn create_instance(
    info: *const vk::InstanceCreateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    out: *mut vk::Instance,
) -> vk::Result {
    let Some(link) = take_link(
        (*info).p_next,
        vk::StructureType::LOADER_INSTANCE_CREATE_INFO,
    ) else {
        return vk::Result::ERROR_INITIALIZATION_FAILED;
    };
    let following = (*link).get_instance_proc_addr;
    let Some(create) = following(vk::Instance::null(), c"vkCreateInstance".as_ptr()) else {
        return vk::Result::ERROR_INITIALIZATION_FAILED;
    };
    let create =
        std::mem::transmute::<unsafe extern "system" fn(), vk::PFN_vkCreateInstance>(create);
    let result = create(info, allocator, out);
    if result == vk::Result::SUCCESS {
        let mut next = next();
        next.instance = Some(following);
        next.instance_handle = *out;
    }
    result
}

unsafe extern "system" fn create_device(
    physical: vk::PhysicalDevice,
    info: *const vk::DeviceCreateInfo<'_>,
    allocator: *const vk::AllocationCallbacks<'_>,
    out: *mut vk::Device,
) -> vk::Result {
    let Some(link) = take_link((*info).p_next, vk::StructureType::LOADER_DEVICE_CREATE_INFO) else {
        return vk::Result::ERROR_INITIALIZATION_FAILED;
    };
    let (following, device) = ((*link).get_instance_proc_addr, (*link).get_device_proc_addr);
    let instance = next().instance_handle;
    let Some(create) = following(instance, c"vkCreateDevice".as_ptr()) else {
        return vk::Result::ERROR_INITIALIZATION_FAILED;
    };
    let create = std::mem::transmute::<unsafe extern "system" fn(), vk::PFN_vkCreateDevice>(create);
    let result = create(physical, info, allocator, out);
    if result == vk::Result::SUCCESS {
        let mut next = next();
        next.device = Some(device);
        next.device_handle = *out;
    }
    result
}

/// The next layer's function of this name, on the one device.
unsafe fn following(name: &CStr) -> vk::PFN_vkVoidFunction {
    let next = next();
    let function = next.device?;
    function(next.device_handle, name.as_ptr())
}

/// Functions that call the next layer's of that name unless the device is lost.
macro_rules! unless_lost {
    ($($own:ident($($argument:ident: $of:ty),+) is $kind:ident $name:literal;)+) => {$(
        unsafe extern "system" fn $own($($argument: $of),+) -> vk::Result {
            if IS_LOST.load(Ordering::SeqCst) {
                return vk::Result::ERROR_DEVICE_LOST;
            }
            match following($name) {
                None => vk::Result::ERROR_INITIALIZATION_FAILED,
                Some(function) => {
                    let function = std::mem::transmute::<unsafe extern "system" fn(), vk::$kind>(function);
                    function($($argument),+)
                }
            }
        }
    )+};
}

unless_lost! {
    submit_on(queue: vk::Queue, count: u32, submits: *const vk::SubmitInfo<'_>, fence: vk::Fence)
        is PFN_vkQueueSubmit c"vkQueueSubmit";
    wait_for_fences(device: vk::Device, count: u32, fences: *const vk::Fence, all: vk::Bool32, timeout: u64)
        is PFN_vkWaitForFences c"vkWaitForFences";
    fence_status(device: vk::Device, fence: vk::Fence) is PFN_vkGetFenceStatus c"vkGetFenceStatus";
    wait_semaphores(device: vk::Device, info: *const vk::SemaphoreWaitInfo<'_>, timeout: u64)
        is PFN_vkWaitSemaphores c"vkWaitSemaphores";
    semaphore_value(device: vk::Device, semaphore: vk::Semaphore, value: *mut u64)
        is PFN_vkGetSemaphoreCounterValue c"vkGetSemaphoreCounterValue";
    device_wait_idle(device: vk::Device) is PFN_vkDeviceWaitIdle c"vkDeviceWaitIdle";
    queue_wait_idle(queue: vk::Queue) is PFN_vkQueueWaitIdle c"vkQueueWaitIdle";
}

unsafe extern "system" fn queue_submit(
    queue: vk::Queue,
    count: u32,
    submits: *const vk::SubmitInfo<'_>,
    fence: vk::Fence,
) -> vk::Result {
    let after = std::env::var("FAKE_DEVICE_LOST_AFTER")
        .ok()
        .and_then(|text| text.parse().ok());
    if after.is_some_and(|after| SUBMISSIONS.fetch_add(1, Ordering::SeqCst) >= after) {
        // A wait that answers `VK_ERROR_DEVICE_LOST` says that nothing is in use any more, as success would (Vulkan 1.3,
        // "Lost Device"); the driver below would go on with earlier submissions.
        if !IS_LOST.load(Ordering::SeqCst) {
            let device = next().device_handle;
            // It is lost whatever this answers.
            let _ = device_wait_idle(device);
        }
        IS_LOST.store(true, Ordering::SeqCst);
    }
    submit_on(queue, count, submits, fence)
}
