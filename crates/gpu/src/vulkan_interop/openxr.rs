//! Vulkan through an OpenXR runtime: `XR_KHR_vulkan_enable2` decides about instance, adapter and device, wgpu works on
//! them, and the runtime's swapchain images become wgpu textures.
//!
//! Layouts. A runtime hands out colour images in `COLOR_ATTACHMENT_OPTIMAL` and depth images in
//! `DEPTH_STENCIL_ATTACHMENT_OPTIMAL` and wants them back like that (XR_KHR_vulkan_enable2, "Swapchain Image Layout").
//! wgpu's states for a texture that a render pass writes, `COLOR_TARGET` and `DEPTH_STENCIL_WRITE`, are exactly these
//! two layouts (`derive_image_layout` in wgpu-hal's `vulkan/conv.rs`), and it inserts barriers only where the state
//! changes. [`wrap_image`] declares the images to be in that state from the start and with that usage alone, so wgpu
//! never moves them out of it: no barrier, and no layout to restore.
//!
//! Queue. OpenXR wants `xrBeginFrame`, `xrEndFrame`, `xrAcquireSwapchainImage` and `xrReleaseSwapchainImage` not to
//! run while another thread uses the queue. Renderers of parts to come are made on threads of their own: whoever uses the queue
//! takes its turn ([`crate::QueueTurn`]).

use std::ffi::c_void;

use ash::vk;
use ash::vk::Handle as _;
use openxr as xr;
use wgpu::hal::vulkan as hal;

use crate::buffers::flat_texture;

type Vulkan = wgpu::hal::api::Vulkan;

/// What a session is created of.
pub type SessionParts = (
    xr::Session<xr::Vulkan>,
    xr::FrameWaiter,
    xr::FrameStream<xr::Vulkan>,
);

/// Finds the system's OpenXR loader.
///
/// # Errors
/// There is none, or it lacks an entry point.
pub fn load_entry() -> Result<xr::Entry, xr::EntryError> {
    // SAFETY: the library of this name is the OpenXR loader by the specification's naming; a host where it is something
    // else is broken beyond what a program can check.
    unsafe { xr::Entry::load(&()) }
}

/// Vulkan's `vkGetInstanceProcAddr` under the type that the OpenXR bindings give it.
fn instance_proc_addr(entry: &ash::Entry) -> xr::sys::platform::VkGetInstanceProcAddr {
    // SAFETY: one C function under two Rust types; a dispatchable Vulkan handle is a pointer in both.
    unsafe {
        std::mem::transmute::<vk::PFN_vkGetInstanceProcAddr, xr::sys::platform::VkGetInstanceProcAddr>(
            entry.static_fn().get_instance_proc_addr,
        )
    }
}

/// The adapter that the runtime dictates, on a Vulkan instance made through the runtime. The instance has wgpu's usual
/// extensions, those for windows among them, and wgpu asks for swapchains of every device: a window can show what the
/// device renders.
///
/// # Errors
/// One line: no Vulkan loader, or what the runtime or the driver says.
pub fn adapter_of_runtime(
    runtime: &xr::Instance,
    system: xr::SystemId,
) -> Result<(wgpu::Instance, wgpu::Adapter), String> {
    let flags = crate::context::instance_flags();
    // SAFETY: as for the OpenXR loader; wgpu loads the same library.
    let entry = unsafe { ash::Entry::load() }.map_err(|error| format!("no Vulkan: {error}"))?;
    // SAFETY: a plain query.
    let version = unsafe { entry.try_enumerate_instance_version() }
        .map_err(|error| format!("vkEnumerateInstanceVersion: {error}"))?
        .unwrap_or(vk::API_VERSION_1_0);
    let extensions = hal::Instance::desired_extensions(&entry, version, flags)
        .map_err(|error| format!("Vulkan extensions: {error}"))?;
    let names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
    let application = vk::ApplicationInfo::default()
        .application_name(c"stereolux")
        .application_version(1)
        .engine_name(c"wgpu-hal")
        // What wgpu asks for itself: 1.3, or 1.0 where the loader knows no more.
        .api_version(if version < vk::API_VERSION_1_1 {
            vk::API_VERSION_1_0
        } else {
            vk::API_VERSION_1_3
        });
    let create_info = vk::InstanceCreateInfo::default()
        .application_info(&application)
        .enabled_extension_names(&names);
    // SAFETY: the create info and all that it points to live until the call returns.
    let raw = unsafe {
        runtime.create_vulkan_instance(
            system,
            instance_proc_addr(&entry),
            std::ptr::from_ref(&create_info).cast::<c_void>(),
        )
    }
    .map_err(|error| format!("xrCreateVulkanInstanceKHR: {error}"))?
    .map_err(|code| format!("vkCreateInstance: {}", vk::Result::from_raw(code)))?;
    // SAFETY: the handle was just created through this entry.
    let instance = unsafe {
        ash::Instance::load(
            entry.static_fn(),
            vk::Instance::from_raw(raw as usize as u64),
        )
    };
    // SAFETY: the instance came from the runtime's own call.
    let physical = unsafe { runtime.vulkan_graphics_device(system, raw) }
        .map_err(|error| format!("xrGetVulkanGraphicsDevice2KHR: {error}"));
    // SAFETY: created from this entry with these extensions and flags; wgpu owns it from here on and destroys it.
    let instance = unsafe {
        hal::Instance::from_raw(
            entry,
            instance,
            version,
            0,
            None,
            extensions,
            flags,
            wgpu::MemoryBudgetThresholds::default(),
            false,
            None,
        )
    }
    .map_err(|error| format!("Vulkan instance: {error}"))?;
    let physical = vk::PhysicalDevice::from_raw(physical? as usize as u64);
    let exposed = instance
        .expose_adapter(physical)
        .ok_or("the runtime's Vulkan device is older than wgpu supports")?;
    // SAFETY: the instance is a valid one, and nobody else uses it.
    let instance = unsafe { wgpu::Instance::from_hal::<Vulkan>(instance) };
    // SAFETY: the adapter was exposed by that very instance.
    let adapter = unsafe { instance.create_adapter_from_hal(exposed) };
    Ok((instance, adapter))
}

/// Opens the adapter of [`adapter_of_runtime`] through the runtime, which may add what it needs itself. Crate-private, as its
/// neighbours: callers owe that adapter, runtime and system belong together.
///
/// # Errors
/// One line.
pub fn open_device(
    runtime: &xr::Instance,
    system: xr::SystemId,
    adapter: &wgpu::Adapter,
    descriptor: &wgpu::DeviceDescriptor<'_>,
) -> Result<(wgpu::Device, wgpu::Queue), String> {
    // SAFETY: the guard is dropped before the adapter.
    let exposed = unsafe { adapter.as_hal::<Vulkan>() }.ok_or("the adapter is not Vulkan's")?;
    let shared = exposed.shared_instance();
    let physical = exposed.raw_physical_device();
    // SAFETY: a plain query on a live instance.
    let families = unsafe {
        shared
            .raw_instance()
            .get_physical_device_queue_family_properties(physical)
    };
    // A family that does both is guaranteed wherever there is graphics at all; usually it is the first.
    let family = families
        .iter()
        .position(|family| {
            family
                .queue_flags
                .contains(vk::QueueFlags::GRAPHICS | vk::QueueFlags::COMPUTE)
        })
        .ok_or("no queue for graphics and compute")? as u32;
    let extensions = exposed.required_device_extensions(descriptor.required_features);
    let names: Vec<_> = extensions.iter().map(|name| name.as_ptr()).collect();
    let mut features = exposed.physical_device_features(&extensions, descriptor.required_features);
    let queues = [vk::DeviceQueueCreateInfo::default()
        .queue_family_index(family)
        .queue_priorities(&[1.0])];
    let create_info = features.add_to_device_create(
        vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&names),
    );
    // SAFETY: the create info and all that it points to live until the call returns; the physical device is the one
    // that the runtime named.
    let raw = unsafe {
        runtime.create_vulkan_device(
            system,
            instance_proc_addr(shared.entry()),
            physical.as_raw() as usize as *const c_void,
            std::ptr::from_ref(&create_info).cast::<c_void>(),
        )
    }
    .map_err(|error| format!("xrCreateVulkanDeviceKHR: {error}"))?
    .map_err(|code| format!("vkCreateDevice: {}", vk::Result::from_raw(code)))?;
    // SAFETY: the handle was just created on this instance.
    let device = unsafe {
        ash::Device::load(
            shared.raw_instance().fp_v1_0(),
            vk::Device::from_raw(raw as usize as u64),
        )
    };
    // SAFETY: created on this adapter with its required extensions, its features and this family; wgpu owns it now.
    let open = unsafe {
        exposed.device_from_raw(
            device,
            None,
            &extensions,
            descriptor.required_features,
            &descriptor.required_limits,
            &descriptor.memory_hints,
            family,
            0,
        )
    }
    .map_err(|error| error.to_string())?;
    // SAFETY: `open` stems from this adapter with the features of `descriptor`.
    unsafe { adapter.create_device_from_hal(open, descriptor) }.map_err(|error| error.to_string())
}

/// Whether the runtime dictates the adapter of `device`, one of [`open_device`], as it did then. Callers owe that runtime and
/// device belong together.
///
/// # Errors
/// The runtime's.
pub fn dictates_adapter_of(
    runtime: &xr::Instance,
    system: xr::SystemId,
    device: &wgpu::Device,
) -> xr::Result<bool> {
    // SAFETY: the guard is dropped at the end of this function.
    let Some(open) = (unsafe { device.as_hal::<Vulkan>() }) else {
        return Err(xr::sys::Result::ERROR_GRAPHICS_DEVICE_INVALID);
    };
    let instance = open.shared_instance().raw_instance().handle();
    // SAFETY: the Vulkan instance was made through this runtime, and the guard keeps it.
    let dictated = unsafe {
        runtime.vulkan_graphics_device(system, instance.as_raw() as usize as *const c_void)
    }?;
    Ok(dictated as usize as u64 == open.raw_physical_device().as_raw())
}

/// A session on a device of [`open_device`]. The device lives at least as long as the session. Callers owe that runtime,
/// system and device belong together.
///
/// # Errors
/// The runtime's.
pub fn create_session(
    runtime: &xr::Instance,
    system: xr::SystemId,
    device: &wgpu::Device,
) -> xr::Result<SessionParts> {
    // SAFETY: the guard is dropped at the end of this function; the clone below keeps the device alive.
    let Some(open) = (unsafe { device.as_hal::<Vulkan>() }) else {
        return Err(xr::sys::Result::ERROR_GRAPHICS_DEVICE_INVALID);
    };
    let info = xr::vulkan::SessionCreateInfo {
        instance: open.shared_instance().raw_instance().handle().as_raw() as usize as *const c_void,
        physical_device: open.raw_physical_device().as_raw() as usize as *const c_void,
        device: open.raw_device().handle().as_raw() as usize as *const c_void,
        queue_family_index: open.queue_family_index(),
        queue_index: open.queue_index(),
    };
    // SAFETY: instance, adapter and device were made through this runtime for this system, and the guard keeps them
    // until the session is gone.
    unsafe {
        runtime.create_session_with_guard::<xr::Vulkan>(system, &info, Box::new(device.clone()))
    }
}

/// An image of a runtime's swapchain as a wgpu texture that render passes write and nothing else touches.
///
/// Callers owe that `image` is an image of this device with this format and size. The texture must be gone, and the device
/// polled, before the swapchain is destroyed; the session sees to it.
pub fn wrap_image(
    device: &wgpu::Device,
    image: u64,
    format: wgpu::TextureFormat,
    size: [u32; 2],
    label: &str,
) -> Option<wgpu::Texture> {
    let state = if format.is_depth_stencil_format() {
        wgpu::TextureUses::DEPTH_STENCIL_WRITE
    } else {
        wgpu::TextureUses::COLOR_TARGET
    };
    let descriptor = flat_texture(label, size, format, wgpu::TextureUsages::RENDER_ATTACHMENT);
    let raw_descriptor = wgpu::hal::TextureDescriptor {
        label: None,
        size: descriptor.size,
        mip_level_count: descriptor.mip_level_count,
        sample_count: descriptor.sample_count,
        dimension: descriptor.dimension,
        format,
        usage: state,
        memory_flags: wgpu::hal::MemoryFlags::empty(),
        view_formats: Vec::new(),
    };
    // SAFETY: the guard is dropped at the end of this function.
    let open = unsafe { device.as_hal::<Vulkan>() }?;
    // SAFETY: the runtime made the image as described. A drop callback, though empty, says that image and memory are
    // the runtime's, so that wgpu destroys neither.
    let raw = unsafe {
        open.texture_from_raw(
            vk::Image::from_raw(image),
            &raw_descriptor,
            Some(Box::new(|| {})),
            hal::TextureMemory::External,
        )
    };
    // SAFETY: the texture stems from this device, and the runtime hands it out in this state; see the module's text.
    Some(unsafe { device.create_texture_from_hal::<Vulkan>(raw, &descriptor, state) })
}

/// What a projection layer shows of one eye.
pub struct LayerView<'a> {
    /// Eye in the layer's space.
    pub pose: xr::Posef,
    /// Its field of view.
    pub fov: xr::Fovf,
    /// Colour image.
    pub color: &'a xr::Swapchain<xr::Vulkan>,
    /// Depth image, reversed: 0 at infinity, 1 at `near_m`.
    pub depth: Option<&'a xr::Swapchain<xr::Vulkan>>,
}

/// How the projection layer lies over what is behind it.
pub struct Over<'a> {
    /// How frames are blended with the room.
    pub blend_mode: xr::EnvironmentBlendMode,
    /// Whether the images' alpha counts; their colours are premultiplied.
    pub with_alpha: bool,
    /// The room, as a layer of its own below.
    pub room: Option<&'a xr::PassthroughLayerFB>,
}

/// Ends a frame with one projection layer, its depth with it if both eyes have one.
///
/// # Errors
/// The runtime's.
pub fn end_frame_with_layer(
    stream: &mut xr::FrameStream<xr::Vulkan>,
    time: xr::Time,
    over: &Over<'_>,
    space: &xr::Space,
    [width, height]: [u32; 2],
    near_m: f32,
    eyes: [LayerView<'_>; 2],
) -> xr::Result<()> {
    let sub_image = |swapchain| {
        xr::SwapchainSubImage::new()
            .swapchain(swapchain)
            .image_array_index(0)
            .image_rect(xr::Rect2Di {
                offset: xr::Offset2Di { x: 0, y: 0 },
                extent: xr::Extent2Di {
                    width: width as i32,
                    height: height as i32,
                },
            })
    };
    let depths = eyes.each_ref().map(|eye| {
        eye.depth
            .map(|depth| xr::sys::CompositionLayerDepthInfoKHR {
                ty: xr::sys::CompositionLayerDepthInfoKHR::TYPE,
                next: std::ptr::null(),
                sub_image: sub_image(depth).into_raw(),
                min_depth: 0.0,
                max_depth: 1.0,
                near_z: f32::INFINITY,
                far_z: near_m,
            })
    });
    let view = |index: usize| {
        let eye = &eyes[index];
        let mut raw = xr::CompositionLayerProjectionView::new()
            .pose(eye.pose)
            .fov(eye.fov)
            .sub_image(sub_image(eye.color))
            .into_raw();
        if let Some(depth) = &depths[index] {
            raw.next = std::ptr::from_ref(depth).cast::<c_void>();
        }
        // SAFETY: `raw` points to `depths` and swapchains that outlive the call below.
        unsafe { xr::CompositionLayerProjectionView::from_raw(raw) }
    };
    let views = [view(0), view(1)];
    let flags = if over.with_alpha {
        xr::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA
    } else {
        xr::CompositionLayerFlags::EMPTY
    };
    let layer = xr::CompositionLayerProjection::new()
        .layer_flags(flags)
        .space(space)
        .views(&views);
    let Some(room) = over.room else {
        return stream.end(time, over.blend_mode, &[&layer]);
    };
    let room = xr::sys::CompositionLayerPassthroughFB {
        ty: xr::sys::CompositionLayerPassthroughFB::TYPE,
        next: std::ptr::null(),
        flags: xr::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA,
        space: <xr::sys::Space as xr::sys::Handle>::NULL,
        layer_handle: room.as_raw(),
    };
    // SAFETY: a layer's base is a view of the members that every layer begins with, and the runtime tells layers apart by
    // their type; `room` outlives the call below.
    let room = unsafe { &*(&raw const room).cast::<xr::CompositionLayerBase<'_, xr::Vulkan>>() };
    stream.end(time, over.blend_mode, &[room, &layer])
}

/// Where `space` is in `base` at `time`, and how it moves. The bindings' own call leaves the flags that the runtime fills in
/// as they were in memory, which the validation layer refuses; here they begin as none.
///
/// # Errors
/// The runtime's.
pub fn relate(
    space: &xr::Space,
    base: &xr::Space,
    time: xr::Time,
) -> xr::Result<(xr::sys::SpaceLocation, xr::sys::SpaceVelocity)> {
    let none = xr::Vector3f::default();
    let mut velocity = xr::sys::SpaceVelocity {
        ty: xr::sys::SpaceVelocity::TYPE,
        next: std::ptr::null_mut(),
        velocity_flags: xr::SpaceVelocityFlags::EMPTY,
        linear_velocity: none,
        angular_velocity: none,
    };
    let mut location = xr::sys::SpaceLocation {
        ty: xr::sys::SpaceLocation::TYPE,
        next: (&raw mut velocity).cast(),
        location_flags: xr::SpaceLocationFlags::EMPTY,
        pose: xr::Posef::IDENTITY,
    };
    // SAFETY: both spaces are alive and of one session, and both structures are whole, typed and chained; they outlive the
    // call.
    let result = unsafe {
        let locate = space.instance().fp().locate_space;
        locate(space.as_raw(), base.as_raw(), time, &raw mut location)
    };
    if result.into_raw() < 0 {
        return Err(result);
    }
    location.next = std::ptr::null_mut();
    Ok((location, velocity))
}

/// What the headset can do, by the extensions that the instance was made with.
#[derive(Clone, Copy, Debug)]
pub struct Supports {
    /// It tracks joints of hands.
    pub hand_joints: bool,
    /// It tracks the gaze.
    pub gaze: bool,
    /// It shows the room.
    pub passthrough: bool,
}

/// Asks what the headset can do.
///
/// # Errors
/// The runtime's.
pub fn supports(runtime: &xr::Instance, system: xr::SystemId) -> xr::Result<Supports> {
    let mut joints = xr::sys::SystemHandTrackingPropertiesEXT {
        ty: xr::sys::SystemHandTrackingPropertiesEXT::TYPE,
        next: std::ptr::null_mut(),
        supports_hand_tracking: xr::sys::FALSE,
    };
    let mut gaze = xr::sys::SystemEyeGazeInteractionPropertiesEXT {
        ty: xr::sys::SystemEyeGazeInteractionPropertiesEXT::TYPE,
        next: std::ptr::null_mut(),
        supports_eye_gaze_interaction: xr::sys::FALSE,
    };
    let mut room = xr::sys::SystemPassthroughPropertiesFB {
        ty: xr::sys::SystemPassthroughPropertiesFB::TYPE,
        next: std::ptr::null(),
        supports_passthrough: xr::sys::FALSE,
    };
    let extensions = runtime.exts();
    let mut chain: *mut c_void = std::ptr::null_mut();
    if extensions.ext_hand_tracking.is_some() {
        chain = (&raw mut joints).cast();
    }
    if extensions.ext_eye_gaze_interaction.is_some() {
        gaze.next = chain;
        chain = (&raw mut gaze).cast();
    }
    if extensions.fb_passthrough.is_some() {
        room.next = chain;
        chain = (&raw mut room).cast();
    }
    let mut properties = xr::sys::SystemProperties::out(chain.cast());
    // SAFETY: the chain holds structures of extensions in use alone, each whole and typed; all outlive the call, and what
    // the runtime leaves of `properties` is never read.
    let result = unsafe {
        let get = runtime.fp().get_system_properties;
        get(runtime.as_raw(), system, properties.as_mut_ptr())
    };
    if result.into_raw() < 0 {
        return Err(result);
    }
    Ok(Supports {
        hand_joints: joints.supports_hand_tracking.into(),
        gaze: gaze.supports_eye_gaze_interaction.into(),
        passthrough: room.supports_passthrough.into(),
    })
}

/// Binary glTF of the controller at `hand`, a top-level user path (`XR_MSFT_controller_model`), no more than `most_bytes`;
/// `None` while the runtime has none.
///
/// # Errors
/// The runtime's; `ERROR_SIZE_INSUFFICIENT` for a larger one.
pub fn controller_model(
    session: &xr::Session<xr::Vulkan>,
    hand: xr::Path,
    most_bytes: u32,
) -> xr::Result<Option<Vec<u8>>> {
    let Some(extension) = &session.instance().exts().msft_controller_model else {
        return Err(xr::sys::Result::ERROR_EXTENSION_NOT_PRESENT);
    };
    let check = |result: xr::sys::Result| match result.into_raw() {
        ..0 => Err(result),
        _ => Ok(()),
    };
    let mut state = xr::sys::ControllerModelKeyStateMSFT {
        ty: xr::sys::ControllerModelKeyStateMSFT::TYPE,
        next: std::ptr::null_mut(),
        model_key: xr::sys::ControllerModelKeyMSFT::NULL,
    };
    // SAFETY: the session is alive, and the structure is whole, typed and outlives the call.
    check(unsafe {
        let get_key = extension.get_controller_model_key;
        get_key(session.as_raw(), hand, &raw mut state)
    })?;
    if state.model_key == xr::sys::ControllerModelKeyMSFT::NULL {
        return Ok(None);
    }
    let load = extension.load_controller_model;
    let mut count = 0;
    // SAFETY: a capacity of 0 asks how much there is; nothing but `count` is written.
    check(unsafe {
        let no_buffer = std::ptr::null_mut();
        load(
            session.as_raw(),
            state.model_key,
            0,
            &raw mut count,
            no_buffer,
        )
    })?;
    if count > most_bytes {
        return Err(xr::sys::Result::ERROR_SIZE_INSUFFICIENT);
    }
    let mut glb = vec![0; count as usize];
    // SAFETY: `glb` has as many bytes as the capacity says and, as `count`, outlives the call.
    check(unsafe {
        let (capacity, buffer) = (count, glb.as_mut_ptr());
        load(
            session.as_raw(),
            state.model_key,
            capacity,
            &raw mut count,
            buffer,
        )
    })?;
    glb.truncate(count as usize);
    Ok(Some(glb))
}

/// Where a hand's joints are in `base` at `time`; `None` while the hand is not tracked. Flags begin as none, as in
/// [`relate`]. Callers owe that both are of one session.
///
/// # Errors
/// The runtime's.
pub fn locate_joints(
    tracker: &xr::HandTracker,
    base: &xr::Space,
    time: xr::Time,
) -> xr::Result<Option<xr::HandJointLocations>> {
    let Some(extension) = &base.instance().exts().ext_hand_tracking else {
        return Err(xr::sys::Result::ERROR_EXTENSION_NOT_PRESENT);
    };
    let mut joints = [xr::HandJointLocation::default(); xr::HAND_JOINT_COUNT];
    let info = xr::sys::HandJointsLocateInfoEXT {
        ty: xr::sys::HandJointsLocateInfoEXT::TYPE,
        next: std::ptr::null(),
        base_space: base.as_raw(),
        time,
    };
    let mut locations = xr::sys::HandJointLocationsEXT {
        ty: xr::sys::HandJointLocationsEXT::TYPE,
        next: std::ptr::null_mut(),
        is_active: xr::sys::FALSE,
        joint_count: xr::HAND_JOINT_COUNT as u32,
        joint_locations: joints.as_mut_ptr(),
    };
    // SAFETY: tracker and space are alive and of one session; the structures are whole and typed, `joints` has as many
    // elements as `joint_count` says, and all outlive the call.
    let result = unsafe {
        let locate = extension.locate_hand_joints;
        locate(tracker.as_raw(), &raw const info, &raw mut locations)
    };
    if result.into_raw() < 0 {
        return Err(result);
    }
    Ok(bool::from(locations.is_active).then_some(joints))
}
