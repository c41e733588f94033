//! An OpenXR runtime without a headset behind it, which fails in the ways that tests ask for, and (in
//! [`device_lost_layer`]) a Vulkan layer that loses the device.
//!
//! The OpenXR loader opens this shared object through a manifest. `FAKE_RUNTIME` in the environment says what it does:
//!
//! | value | before a session |
//! |---|---|
//! | `no_headset` | `xrGetSystem` finds none |
//! | `no_vulkan` | `XR_KHR_vulkan_enable2` is not offered |
//! | `no_stereo` | the one view configuration is mono |
//! | `no_device` | `vkCreateDevice` fails |
//! | `no_format` | no colour format that the program knows |
//! | `no_size` | recommends images of 0x0 pixels |
//! | `huge_size` | recommends, and takes, images of u32::MAX pixels a side |
//! | `three_views` | the stereo configuration has three views |
//! | `wild_name` | its names hold what steers a terminal |
//!
//! | value | in a session |
//! |---|---|
//! | `profiles`, `no_extensions` | with every extension that brings controllers, or none: says on standard error which bindings are suggested and what vibrates |
//! | `trackers` | with joints of hands and gaze, at the places that [`joint_at`] and [`GAZE`] say: in the frames that [`is_tracked`] names, else lost in one way or another |
//! | `no_trackers` | knows joints of hands and gaze, its headset does not |
//! | `refused_trackers` | its headset has joints of hands and gaze; making a tracker and binding the gaze fail |
//! | `wild_joints` | joints of hands at no place |
//! | `wild_hands` | hands that are tracked at no place, triggers pulled by NaN |
//! | `lost_on_the_way` | a stick ahead, and in the fourth frame an orientation that is no number |
//! | `wild_rates` | refresh rates that are no numbers, negative, infinite, and 75 Hz |
//! | `no_rates` | no refresh rate that makes sense |
//! | `wild_mask` | a visibility mask of 100,000 triangles, with indices and corners that make no sense |
//! | `one_view` | locates one view |
//! | `controller_model`, `bad_controller_model`, `huge_controller_model`, `plain_controller` | a controller in the right hand ([`controller_model`]) with a model, with one that is none, with one of 4 GiB, or without |
//! | `room_blended`, `room_layered`, `room_added` | shows the room: by ALPHA_BLEND, by `XR_FB_passthrough`, by ADDITIVE alone; loses its session once; says on standard error how each frame with a layer lies over it |
//! | `no_room` | knows `XR_FB_passthrough`, its headset does not |
//! | `refused_room` | its headset has `XR_FB_passthrough`; making it fails |
//! | `room_taken` | as `room_layered`; the session that follows the lost one fails to make the layer |
//!
//! | value | once [`SHOWN_BEFORE`] frames were shown |
//! |---|---|
//! | `loss_pending` | the session goes to LOSS_PENDING, once |
//! | `instance_loss_pending` | the event of that name |
//! | `session_lost` | `xrWaitFrame` says ERROR_SESSION_LOST, once; `xrGetSystem` finds no headset for a while |
//! | `locate_lost`, `acquire_lost` | `xrLocateViews` or `xrAcquireSwapchainImage` says it, once |
//! | `end_frame_lost` | `xrEndFrame` says ERROR_SESSION_LOST, once |
//! | `lost_for_good` | as `session_lost`, and the headset never comes back |
//! | `lost_again` | as `session_lost` at once, and so is every session that follows |
//! | `lost_and_changed` | as `session_lost` at once, and then other images are recommended |
//! | `changes` | the display refreshes at 72 Hz instead of 75, and the lenses hide a corner |
//! | `exiting` | STOPPING, IDLE, EXITING, as if the wearer had quit in the runtime's menu |
//! | `pause` | STOPPING, IDLE, then READY again |
//! | `unseen` | every second frame has `shouldRender` false, and a layer for it is an error |
//!
//! Anything else: frames without end. One session at a time; each has a handle and display times of its own, and an event of
//! the one before it comes first. Action sets that are there have different names.
//!
//! Only what stereolux calls is there, and calls are trusted to be valid, but that a session lives and that a layer of the room
//! is its own: that they are is checked against Monado under the validation layers.
//!
//! `unsafe`: everything here is a C interface that is handed pointers by a loader; each is valid for the call by
//! OpenXR's and Vulkan's rules of valid usage.
#![allow(unsafe_op_in_unsafe_fn, clippy::missing_safety_doc)]

pub mod controller_model;
pub mod device_lost_layer;
mod vulkan;

use std::collections::{BTreeMap, VecDeque};
use std::ffi::{CStr, c_char};
use std::sync::{Mutex, MutexGuard, PoisonError};

use openxr_sys as xr;
use xr::{Handle as _, Result as R, SessionState as S, pfn};

/// Frames with a layer before the failure.
pub const SHOWN_BEFORE: u64 = 5;

const INSTANCE: u64 = 1;
const SYSTEM: u64 = 2;
/// Pixels per eye.
const SIZE: u32 = 32;

pub(crate) struct State {
    events: VecDeque<Event>,
    next_handle: u64,
    /// What paths and actions are called, by handle.
    names: BTreeMap<u64, String>,
    /// What action sets are called, by handle.
    sets: BTreeMap<u64, String>,
    shown: u64,
    has_failed: bool,
    /// Calls of `xrGetSystem` since the session was lost.
    looked: u64,
    session: Session,
    session_before: u64,
    pub(crate) vulkan: Option<vulkan::Device>,
    pub(crate) swapchains: BTreeMap<u64, vulkan::Swapchain>,
}

/// What begins anew with each session.
struct Session {
    /// 0: there is none.
    handle: u64,
    waited: u64,
    is_running: bool,
    is_lost: bool,
    /// Of `XR_FB_passthrough`: the room and its layer; 0: there is none.
    room: u64,
    room_layer: u64,
}

impl Session {
    const fn new(handle: u64) -> Self {
        Self {
            handle,
            waited: 0,
            is_running: false,
            is_lost: false,
            room: 0,
            room_layer: 0,
        }
    }
}

enum Event {
    /// Of the session with this handle.
    State(u64, S),
    InstanceLossPending,
    RefreshRate,
    VisibilityMask,
}

static STATE: Mutex<State> = Mutex::new(State {
    events: VecDeque::new(),
    next_handle: 100,
    names: BTreeMap::new(),
    sets: BTreeMap::new(),
    shown: 0,
    has_failed: false,
    looked: 0,
    session: Session::new(0),
    session_before: 0,
    vulkan: None,
    swapchains: BTreeMap::new(),
});

pub(crate) fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

impl State {
    pub(crate) fn handle(&mut self) -> u64 {
        self.next_handle += 1;
        self.next_handle
    }

    unsafe fn name(&mut self, text: *const c_char) -> u64 {
        let name = CStr::from_ptr(text).to_string_lossy().into_owned();
        let handle = self.handle();
        self.names.insert(handle, name);
        handle
    }

    fn enter(&mut self, states: &[S]) {
        let session = self.session.handle;
        let events = states.iter().map(|state| Event::State(session, *state));
        self.events.extend(events);
    }

    /// True when enough frames were shown and `behaviour` is asked for, once for all that are.
    fn fails_now(&mut self, behaviour: &str) -> bool {
        asked_for(behaviour)
            && self.shown >= SHOWN_BEFORE
            && !std::mem::replace(&mut self.has_failed, true)
    }

    /// Whether a call for `session` may go on.
    fn check(&self, session: xr::Session) -> Result<(), R> {
        if session.into_raw() != self.session.handle {
            Err(R::ERROR_HANDLE_INVALID)
        } else if self.session.is_lost {
            Err(R::ERROR_SESSION_LOST)
        } else {
            Ok(())
        }
    }
}

/// Ends a call for a session that is not there.
macro_rules! check {
    ($state:ident, $session:ident) => {
        if let Err(error) = $state.check($session) {
            return error;
        }
    };
}

/// The one behaviour that is asked for.
fn asked() -> String {
    std::env::var("FAKE_RUNTIME").unwrap_or_default()
}

/// Between two frames: of 90 Hz, or of 72 that no extension tells.
fn period_ns() -> i64 {
    if asked_for("slow_display") {
        13_888_889
    } else {
        11_111_111
    }
}

fn asked_for(what: &str) -> bool {
    asked() == what
}

/// Fills `out` by OpenXR's two-call idiom.
pub(crate) unsafe fn fill<T>(
    items: &[T],
    capacity: u32,
    count: *mut u32,
    mut write: impl FnMut(usize, &T),
) -> R {
    count.write(items.len() as u32);
    if capacity == 0 {
        return R::SUCCESS;
    }
    if (capacity as usize) < items.len() {
        return R::ERROR_SIZE_INSUFFICIENT;
    }
    for (index, item) in items.iter().enumerate() {
        write(index, item);
    }
    R::SUCCESS
}

fn put_text(out: &mut [c_char], text: &str) {
    for (to, from) in out.iter_mut().zip(text.bytes().chain([0])) {
        *to = from as c_char;
    }
}

/// The loader's entry point.
#[unsafe(no_mangle)]
pub unsafe extern "system" fn xrNegotiateLoaderRuntimeInterface(
    _: *const xr::NegotiateLoaderInfo,
    request: *mut xr::NegotiateRuntimeRequest,
) -> R {
    (*request).runtime_interface_version = 1;
    (*request).runtime_api_version = xr::Version::new(1, 0, 34);
    (*request).get_instance_proc_addr = Some(get_instance_proc_addr);
    R::SUCCESS
}

unsafe extern "system" fn get_instance_proc_addr(
    _: xr::Instance,
    name: *const c_char,
    out: *mut Option<pfn::VoidFunction>,
) -> R {
    macro_rules! table {
        ($name:expr, $($kind:ident = $function:expr),* $(,)?) => {
            match $name {
                $(concat!("xr", stringify!($kind)) => {
                    let typed: pfn::$kind = $function;
                    // SAFETY: one function pointer under another type; the caller casts it back.
                    Some(std::mem::transmute::<pfn::$kind, pfn::VoidFunction>(typed))
                })*
                // The other functions of the core do nothing, with success: the ABI lets a C function ignore what it
                // is passed.
                "xrDestroyInstance" | "xrDestroySpace" | "xrDestroyAction" | "xrAttachSessionActionSets" | "xrSyncActions" | "xrWaitSwapchainImage"
                | "xrReleaseSwapchainImage" | "xrDestroyHandTrackerEXT" | "xrResultToString" | "xrStructureTypeToString" => {
                    Some(std::mem::transmute::<unsafe extern "system" fn() -> R, pfn::VoidFunction>(succeed))
                }
                // Bindings want every function of the core to be there.
                _ => Some(std::mem::transmute::<unsafe extern "system" fn() -> R, pfn::VoidFunction>(refuse)),
            }
        };
    }
    let name = CStr::from_ptr(name).to_str().unwrap_or_default();
    let function = table!(
        name,
        GetInstanceProcAddr = get_instance_proc_addr,
        EnumerateInstanceExtensionProperties = enumerate_extensions,
        CreateInstance = create_instance,
        GetInstanceProperties = instance_properties,
        GetSystem = get_system,
        GetSystemProperties = system_properties,
        EnumerateViewConfigurations = view_configurations,
        EnumerateViewConfigurationViews = view_configuration_views,
        EnumerateEnvironmentBlendModes = blend_modes,
        PollEvent = poll_event,
        StringToPath = string_to_path,
        CreateActionSet = create_action_set,
        DestroyActionSet = destroy_action_set,
        CreateAction = create_action,
        SuggestInteractionProfileBindings = suggest_bindings,
        GetActionStateBoolean = boolean_state,
        GetActionStateVector2f = vector_state,
        CreateSession = create_session,
        DestroySession = destroy_session,
        BeginSession = begin_session,
        EndSession = end_session,
        RequestExitSession = request_exit,
        CreateReferenceSpace = create_space,
        CreateActionSpace = create_action_space,
        LocateSpace = locate_space,
        GetActionStateFloat = float_state,
        ApplyHapticFeedback = apply_haptics,
        WaitFrame = wait_frame,
        BeginFrame = begin_frame,
        EndFrame = end_frame,
        LocateViews = locate_views,
        EnumerateSwapchainFormats = swapchain_formats,
        CreateSwapchain = vulkan::create_swapchain,
        DestroySwapchain = vulkan::destroy_swapchain,
        EnumerateSwapchainImages = vulkan::swapchain_images,
        AcquireSwapchainImage = vulkan::acquire_image,
        GetVulkanGraphicsRequirements2KHR = vulkan::requirements,
        CreateVulkanInstanceKHR = vulkan::create_instance,
        GetVulkanGraphicsDevice2KHR = vulkan::graphics_device,
        CreateVulkanDeviceKHR = vulkan::create_device,
        EnumerateDisplayRefreshRatesFB = refresh_rates,
        GetDisplayRefreshRateFB = refresh_rate,
        RequestDisplayRefreshRateFB = request_refresh_rate,
        GetVisibilityMaskKHR = visibility_mask,
        CreatePassthroughFB = create_passthrough,
        CreatePassthroughLayerFB = create_passthrough_layer,
        DestroyPassthroughFB = destroy_passthrough,
        DestroyPassthroughLayerFB = destroy_passthrough_layer,
        GetControllerModelKeyMSFT = controller_model::key,
        LoadControllerModelMSFT = controller_model::load,
        CreateHandTrackerEXT = create_hand_tracker,
        LocateHandJointsEXT = locate_hand_joints,
    );
    out.write(function);
    R::SUCCESS
}

unsafe extern "system" fn succeed() -> R {
    R::SUCCESS
}

unsafe extern "system" fn refuse() -> R {
    R::ERROR_FUNCTION_UNSUPPORTED
}

unsafe extern "system" fn enumerate_extensions(
    _: *const c_char,
    capacity: u32,
    count: *mut u32,
    out: *mut xr::ExtensionProperties,
) -> R {
    const VULKAN: &str = "XR_KHR_vulkan_enable2";
    let offered: &[&str] = match asked().as_str() {
        "no_vulkan" => &["XR_KHR_opengl_enable"],
        "wild_rates" | "no_rates" => &[VULKAN, "XR_FB_display_refresh_rate"],
        "profiles" => &[
            VULKAN,
            "XR_META_touch_controller_plus",
            "XR_EXT_hand_interaction",
        ],
        "changes" => &[
            VULKAN,
            "XR_FB_display_refresh_rate",
            "XR_KHR_visibility_mask",
        ],
        "trackers" | "no_trackers" | "refused_trackers" | "wild_joints" => &[
            VULKAN,
            "XR_EXT_hand_tracking",
            "XR_EXT_eye_gaze_interaction",
        ],
        "room_layered" | "refused_room" | "room_taken" | "no_room" => {
            &[VULKAN, "XR_FB_passthrough"]
        }
        "wild_mask" => &[VULKAN, "XR_KHR_visibility_mask"],
        _ if controller_model::is_offered() => &[VULKAN, "XR_MSFT_controller_model"],
        _ => &[VULKAN],
    };
    fill(offered, capacity, count, |index, name| {
        put_text(&mut (*out.add(index)).extension_name, name);
        (*out.add(index)).extension_version = 1;
    })
}

unsafe extern "system" fn create_instance(
    _: *const xr::InstanceCreateInfo,
    out: *mut xr::Instance,
) -> R {
    out.write(xr::Instance::from_raw(INSTANCE));
    R::SUCCESS
}

fn named(name: &str) -> String {
    if asked_for("wild_name") {
        format!("{name}\u{1b}]0;owned\u{7}\u{9b}2J")
    } else {
        name.to_owned()
    }
}

unsafe extern "system" fn instance_properties(
    _: xr::Instance,
    out: *mut xr::InstanceProperties,
) -> R {
    (*out).runtime_version = xr::Version::new(0, 1, 0);
    put_text(&mut (*out).runtime_name, &named("Fake runtime"));
    R::SUCCESS
}

unsafe extern "system" fn get_system(
    _: xr::Instance,
    _: *const xr::SystemGetInfo,
    out: *mut xr::SystemId,
) -> R {
    let mut state = state();
    if state.has_failed {
        state.looked += 1;
    }
    let is_away = asked_for("session_lost") && (1..=3).contains(&state.looked)
        || asked_for("lost_for_good") && state.has_failed;
    if asked_for("no_headset") || is_away {
        return R::ERROR_FORM_FACTOR_UNAVAILABLE;
    }
    out.write(xr::SystemId::from_raw(SYSTEM));
    R::SUCCESS
}

unsafe extern "system" fn system_properties(
    _: xr::Instance,
    _: xr::SystemId,
    out: *mut xr::SystemProperties,
) -> R {
    (*out).system_id = xr::SystemId::from_raw(SYSTEM);
    (*out).vendor_id = 0;
    put_text(&mut (*out).system_name, &named("Fake headset"));
    (*out).graphics_properties = xr::SystemGraphicsProperties {
        max_swapchain_image_height: 4096,
        max_swapchain_image_width: 4096,
        max_layer_count: 16,
    };
    (*out).tracking_properties = xr::SystemTrackingProperties {
        orientation_tracking: xr::TRUE,
        position_tracking: xr::TRUE,
    };
    let has_trackers = (!asked_for("no_trackers")).into();
    let mut chained = (*out).next.cast::<xr::BaseOutStructure>();
    while let Some(structure) = chained.as_mut() {
        if structure.ty == xr::SystemHandTrackingPropertiesEXT::TYPE {
            let of_hands = chained.cast::<xr::SystemHandTrackingPropertiesEXT>();
            (*of_hands).supports_hand_tracking = has_trackers;
        } else if structure.ty == xr::SystemEyeGazeInteractionPropertiesEXT::TYPE {
            let of_gaze = chained.cast::<xr::SystemEyeGazeInteractionPropertiesEXT>();
            (*of_gaze).supports_eye_gaze_interaction = has_trackers;
        } else if structure.ty == xr::SystemPassthroughPropertiesFB::TYPE {
            let of_room = chained.cast::<xr::SystemPassthroughPropertiesFB>();
            (*of_room).supports_passthrough = has_layered_room().into();
        }
        chained = structure.next;
    }
    R::SUCCESS
}

unsafe extern "system" fn view_configurations(
    _: xr::Instance,
    _: xr::SystemId,
    capacity: u32,
    count: *mut u32,
    out: *mut xr::ViewConfigurationType,
) -> R {
    let kind = if asked_for("no_stereo") {
        xr::ViewConfigurationType::PRIMARY_MONO
    } else {
        xr::ViewConfigurationType::PRIMARY_STEREO
    };
    fill(&[kind], capacity, count, |_, kind| out.write(*kind))
}

unsafe extern "system" fn view_configuration_views(
    _: xr::Instance,
    _: xr::SystemId,
    _: xr::ViewConfigurationType,
    capacity: u32,
    count: *mut u32,
    out: *mut xr::ViewConfigurationView,
) -> R {
    let (recommended, most) = if asked_for("no_size") {
        (0, 4096)
    } else if asked_for("huge_size") {
        (u32::MAX, u32::MAX)
    } else if asked_for("lost_and_changed") && state().has_failed {
        (SIZE + 1, 4096)
    } else {
        (SIZE, 4096)
    };
    let views = if asked_for("three_views") { 3 } else { 2 };
    fill(&vec![(); views], capacity, count, |index, ()| {
        let view = &mut *out.add(index);
        view.recommended_image_rect_width = recommended;
        view.recommended_image_rect_height = recommended;
        view.max_image_rect_width = most;
        view.max_image_rect_height = most;
        view.recommended_swapchain_sample_count = 1;
        view.max_swapchain_sample_count = 1;
    })
}

unsafe extern "system" fn blend_modes(
    _: xr::Instance,
    _: xr::SystemId,
    _: xr::ViewConfigurationType,
    capacity: u32,
    count: *mut u32,
    out: *mut xr::EnvironmentBlendMode,
) -> R {
    use xr::EnvironmentBlendMode as Mode;
    let modes: &[Mode] = if asked_for("room_blended") {
        &[Mode::ADDITIVE, Mode::OPAQUE, Mode::ALPHA_BLEND]
    } else if asked_for("room_added") {
        &[Mode::ADDITIVE]
    } else {
        &[Mode::OPAQUE]
    };
    fill(modes, capacity, count, |index, mode| {
        out.add(index).write(*mode);
    })
}

unsafe extern "system" fn poll_event(_: xr::Instance, out: *mut xr::EventDataBuffer) -> R {
    let mut state = state();
    let session = xr::Session::from_raw(state.session.handle);
    match state.events.pop_front() {
        None => return R::EVENT_UNAVAILABLE,
        Some(Event::State(session, entered)) => {
            out.cast::<xr::EventDataSessionStateChanged>().write(
                xr::EventDataSessionStateChanged {
                    ty: xr::EventDataSessionStateChanged::TYPE,
                    next: std::ptr::null(),
                    session: xr::Session::from_raw(session),
                    state: entered,
                    time: xr::Time::from_nanos(1),
                },
            );
        }
        Some(Event::RefreshRate) => {
            out.cast::<xr::EventDataDisplayRefreshRateChangedFB>()
                .write(xr::EventDataDisplayRefreshRateChangedFB {
                    ty: xr::EventDataDisplayRefreshRateChangedFB::TYPE,
                    next: std::ptr::null(),
                    from_display_refresh_rate: 75.0,
                    to_display_refresh_rate: 72.0,
                });
        }
        Some(Event::VisibilityMask) => {
            out.cast::<xr::EventDataVisibilityMaskChangedKHR>().write(
                xr::EventDataVisibilityMaskChangedKHR {
                    ty: xr::EventDataVisibilityMaskChangedKHR::TYPE,
                    next: std::ptr::null(),
                    session,
                    view_configuration_type: xr::ViewConfigurationType::PRIMARY_STEREO,
                    view_index: 0,
                },
            );
        }
        Some(Event::InstanceLossPending) => {
            out.cast::<xr::EventDataInstanceLossPending>().write(
                xr::EventDataInstanceLossPending {
                    ty: xr::EventDataInstanceLossPending::TYPE,
                    next: std::ptr::null(),
                    loss_time: xr::Time::from_nanos(1),
                },
            );
        }
    }
    R::SUCCESS
}

unsafe extern "system" fn string_to_path(
    _: xr::Instance,
    text: *const c_char,
    out: *mut xr::Path,
) -> R {
    out.write(xr::Path::from_raw(state().name(text)));
    R::SUCCESS
}

unsafe extern "system" fn create_action_set(
    _: xr::Instance,
    info: *const xr::ActionSetCreateInfo,
    out: *mut xr::ActionSet,
) -> R {
    let name = CStr::from_ptr((*info).action_set_name.as_ptr()).to_string_lossy();
    let mut state = state();
    if state.sets.values().any(|known| *known == name) {
        return R::ERROR_NAME_DUPLICATED;
    }
    let handle = state.handle();
    state.sets.insert(handle, name.into_owned());
    out.write(xr::ActionSet::from_raw(handle));
    R::SUCCESS
}

unsafe extern "system" fn destroy_action_set(set: xr::ActionSet) -> R {
    state().sets.remove(&set.into_raw());
    R::SUCCESS
}

unsafe extern "system" fn create_action(
    _: xr::ActionSet,
    info: *const xr::ActionCreateInfo,
    out: *mut xr::Action,
) -> R {
    let name = (*info).action_name.as_ptr();
    out.write(xr::Action::from_raw(state().name(name)));
    R::SUCCESS
}

unsafe extern "system" fn suggest_bindings(
    _: xr::Instance,
    suggested: *const xr::InteractionProfileSuggestedBinding,
) -> R {
    let names = &state().names;
    let name = |handle: u64| names.get(&handle).map_or("?", String::as_str);
    if asked_for("refused_trackers")
        && name((*suggested).interaction_profile.into_raw()).ends_with("gaze_interaction")
    {
        return R::ERROR_PATH_UNSUPPORTED;
    }
    if !asked_for("profiles") && !asked_for("no_extensions") && !asked_for("trackers") {
        return R::SUCCESS;
    }
    let count = (*suggested).count_suggested_bindings as usize;
    for at in 0..count {
        let binding = (*suggested).suggested_bindings.add(at).read();
        eprintln!(
            "suggested: {} {} {}",
            name((*suggested).interaction_profile.into_raw()),
            name(binding.action.into_raw()),
            name(binding.binding.into_raw())
        );
    }
    R::SUCCESS
}

/// Functions that give an action's value and whether it is active; it has not changed.
macro_rules! action_states {
    ($($name:ident: $kind:ty = $answer:expr;)+) => {$(
        unsafe extern "system" fn $name(
            _: xr::Session,
            _: *const xr::ActionStateGetInfo,
            out: *mut $kind,
        ) -> R {
            ((*out).current_state, (*out).is_active) = $answer;
            (*out).changed_since_last_sync = xr::FALSE;
            (*out).last_change_time = xr::Time::from_nanos(0);
            R::SUCCESS
        }
    )+};
}

action_states! {
    boolean_state: xr::ActionStateBoolean = (xr::FALSE, xr::FALSE);
    vector_state: xr::ActionStateVector2f = {
        let walks = asked_for("lost_on_the_way");
        let y = if walks { 0.5 } else { 0.0 };
        (xr::Vector2f { x: 0.0, y }, walks.into())
    };
    float_state: xr::ActionStateFloat = (f32::NAN, asked_for("wild_hands").into());
}

unsafe extern "system" fn create_session(
    _: xr::Instance,
    _: *const xr::SessionCreateInfo,
    out: *mut xr::Session,
) -> R {
    let mut state = state();
    if state.session.handle != 0 {
        return R::ERROR_LIMIT_REACHED;
    }
    let handle = state.handle();
    state.session = Session::new(handle);
    if state.has_failed {
        // Late, of a session that is not there any more.
        let before = state.session_before;
        state.events.push_back(Event::State(before, S::EXITING));
    }
    state.enter(&[S::IDLE, S::READY]);
    out.write(xr::Session::from_raw(handle));
    R::SUCCESS
}

unsafe extern "system" fn destroy_session(session: xr::Session) -> R {
    let mut state = state();
    if session.into_raw() != state.session.handle {
        return R::ERROR_HANDLE_INVALID;
    }
    state.session_before = state.session.handle;
    state.session = Session::new(0);
    R::SUCCESS
}

unsafe extern "system" fn begin_session(session: xr::Session, _: *const xr::SessionBeginInfo) -> R {
    let mut state = state();
    check!(state, session);
    if std::mem::replace(&mut state.session.is_running, true) {
        return R::ERROR_SESSION_RUNNING;
    }
    state.enter(&[S::SYNCHRONIZED, S::VISIBLE, S::FOCUSED]);
    R::SUCCESS
}

unsafe extern "system" fn end_session(session: xr::Session) -> R {
    let mut state = state();
    check!(state, session);
    if !std::mem::replace(&mut state.session.is_running, false) {
        return R::ERROR_SESSION_NOT_RUNNING;
    }
    // The end of the pause, or of everything.
    let next = if asked_for("pause") && state.shown == SHOWN_BEFORE {
        S::READY
    } else {
        S::EXITING
    };
    state.enter(&[S::IDLE, next]);
    R::SUCCESS
}

unsafe extern "system" fn request_exit(session: xr::Session) -> R {
    let mut state = state();
    check!(state, session);
    if !state.session.is_running {
        return R::ERROR_SESSION_NOT_RUNNING;
    }
    state.enter(&[S::VISIBLE, S::SYNCHRONIZED, S::STOPPING]);
    R::SUCCESS
}

unsafe extern "system" fn create_space(
    _: xr::Session,
    _: *const xr::ReferenceSpaceCreateInfo,
    out: *mut xr::Space,
) -> R {
    out.write(xr::Space::from_raw(state().handle()));
    R::SUCCESS
}

unsafe extern "system" fn create_action_space(
    _: xr::Session,
    info: *const xr::ActionSpaceCreateInfo,
    out: *mut xr::Space,
) -> R {
    let mut state = state();
    let space = state.handle();
    // A space is called as its action and the hand.
    let name = |handle: u64| state.names.get(&handle).cloned();
    if let Some(action) = name((*info).action.into_raw()) {
        let hand = name((*info).subaction_path.into_raw()).unwrap_or_default();
        state.names.insert(space, action + &hand);
    }
    out.write(xr::Space::from_raw(space));
    R::SUCCESS
}

/// Hands that nobody tracks, or that are no place at all; gaze.
unsafe extern "system" fn locate_space(
    space: xr::Space,
    _: xr::Space,
    _: xr::Time,
    out: *mut xr::SpaceLocation,
) -> R {
    let state = state();
    let is_gaze = |name: &String| name == "gaze";
    if asked_for("trackers") && state.names.get(&space.into_raw()).is_some_and(is_gaze) {
        (*out).pose = GAZE;
        // Between two good frames a guess: valid, and not tracked.
        (*out).location_flags = if is_tracked(state.session.waited) {
            valid() | tracked()
        } else {
            valid()
        };
        return R::SUCCESS;
    }
    if let Some(velocity) = (*out).next.cast::<xr::SpaceVelocity>().as_mut() {
        velocity.velocity_flags = xr::SpaceVelocityFlags::EMPTY;
    }
    let name = state.names.get(&space.into_raw());
    if name.is_some_and(|name| controller_model::is_at_grip(name)) {
        (*out).pose = controller_model::GRIP;
        (*out).location_flags = valid() | tracked();
        if let Some(velocity) = (*out).next.cast::<xr::SpaceVelocity>().as_mut() {
            // How fast it turns nobody knows.
            velocity.velocity_flags = xr::SpaceVelocityFlags::LINEAR_VALID;
            velocity.linear_velocity = controller_model::VELOCITY;
            velocity.angular_velocity = controller_model::VELOCITY;
        }
        return R::SUCCESS;
    }
    let is_wild = asked_for("wild_hands");
    (*out).location_flags = if is_wild {
        valid()
    } else {
        xr::SpaceLocationFlags::EMPTY
    };
    (*out).pose = posef([0.0; 4], [f32::NAN, f32::INFINITY, 0.0]);
    R::SUCCESS
}

fn valid() -> xr::SpaceLocationFlags {
    xr::SpaceLocationFlags::POSITION_VALID | xr::SpaceLocationFlags::ORIENTATION_VALID
}

fn tracked() -> xr::SpaceLocationFlags {
    xr::SpaceLocationFlags::POSITION_TRACKED | xr::SpaceLocationFlags::ORIENTATION_TRACKED
}

/// Where the gaze of `trackers` is: ahead of the head's start and turned left by 2 asin 0.6.
pub const GAZE: xr::Posef = posef([0.0, 0.6, 0.0, 0.8], [0.0, 0.25, -0.125]);

pub(crate) const fn posef([x, y, z, w]: [f32; 4], at: [f32; 3]) -> xr::Posef {
    let [at_x, at_y, at_z] = at;
    xr::Posef {
        orientation: xr::Quaternionf { x, y, z, w },
        position: xr::Vector3f {
            x: at_x,
            y: at_y,
            z: at_z,
        },
    }
}

/// Where a joint of `trackers` is; `hand` is 0 for the left and 1 for the right one, and all joints turn as [`GAZE`].
#[must_use]
pub fn joint_at(hand: usize, joint: usize) -> xr::Posef {
    let x = if hand == 0 { -0.25 } else { 0.25 };
    xr::Posef {
        orientation: GAZE.orientation,
        ..posef([0.0; 4], [x, joint as f32 / 64.0, -0.5])
    }
}

/// Whether `trackers` tracks all in a frame; the first waited for is 1.
#[must_use]
pub fn is_tracked(frame: u64) -> bool {
    frame % 3 == 1
}

/// A tracker's handle says which hand it is of.
unsafe extern "system" fn create_hand_tracker(
    _: xr::Session,
    info: *const xr::HandTrackerCreateInfoEXT,
    out: *mut xr::HandTrackerEXT,
) -> R {
    if asked_for("no_trackers") || asked_for("refused_trackers") {
        return R::ERROR_FEATURE_UNSUPPORTED;
    }
    out.write(xr::HandTrackerEXT::from_raw((*info).hand.into_raw() as u64));
    R::SUCCESS
}

unsafe extern "system" fn locate_hand_joints(
    tracker: xr::HandTrackerEXT,
    _: *const xr::HandJointsLocateInfoEXT,
    out: *mut xr::HandJointLocationsEXT,
) -> R {
    if (*out).joint_count as usize != xr::HAND_JOINT_COUNT_EXT {
        return R::ERROR_VALIDATION_FAILURE;
    }
    let hand = usize::from(tracker.into_raw() == xr::HandEXT::RIGHT.into_raw() as u64);
    let frame = state().session.waited;
    // Lost: not active in one frame, one joint unknown in the next.
    let is_active = is_tracked(frame) || frame % 3 == 2;
    (*out).is_active = is_active.into();
    for joint in 0..xr::HAND_JOINT_COUNT_EXT {
        let mut pose = joint_at(hand, joint);
        if asked_for("wild_joints") {
            pose.position.y = f32::NAN;
        }
        let is_known = is_tracked(frame) || joint != 25;
        (*out)
            .joint_locations
            .add(joint)
            .write(xr::HandJointLocationEXT {
                location_flags: if is_active && is_known {
                    valid()
                } else {
                    xr::SpaceLocationFlags::EMPTY
                },
                pose,
                radius: 0.0078125,
            });
    }
    R::SUCCESS
}

unsafe extern "system" fn apply_haptics(
    session: xr::Session,
    info: *const xr::HapticActionInfo,
    event: *const xr::HapticBaseHeader,
) -> R {
    let state = state();
    check!(state, session);
    if asked_for("profiles") {
        let name = |handle: u64| state.names.get(&handle).map_or("?", String::as_str);
        let event = event.cast::<xr::HapticVibration>().read();
        eprintln!(
            "vibrates: {} {} {} ns {}",
            name((*info).action.into_raw()),
            name((*info).subaction_path.into_raw()),
            event.duration.as_nanos(),
            event.amplitude
        );
    }
    R::SUCCESS
}

unsafe extern "system" fn wait_frame(
    session: xr::Session,
    _: *const xr::FrameWaitInfo,
    out: *mut xr::FrameState,
) -> R {
    let mut state = state();
    if !state.session.is_running {
        return R::ERROR_SESSION_NOT_RUNNING;
    }
    let behaviours = [
        "session_lost",
        "lost_for_good",
        "lost_and_changed",
        "room_blended",
        "room_layered",
        "room_taken",
    ];
    state.session.is_lost |= behaviours.into_iter().any(|lost| state.fails_now(lost))
        || asked_for("lost_again") && state.shown >= SHOWN_BEFORE;
    check!(state, session);
    state.session.waited += 1;
    let waited = state.session.waited as i64;
    (*out).predicted_display_time = xr::Time::from_nanos(1_000_000_000 + waited * period_ns());
    (*out).predicted_display_period = xr::Duration::from_nanos(period_ns());
    (*out).should_render = xr::Bool32::from_raw(u32::from(is_seen(&state)));
    R::SUCCESS
}

fn is_seen(state: &State) -> bool {
    !asked_for("unseen") || state.session.waited.is_multiple_of(2)
}

unsafe extern "system" fn begin_frame(session: xr::Session, _: *const xr::FrameBeginInfo) -> R {
    state().check(session).err().unwrap_or(R::SUCCESS)
}

/// What asks for how frames lie over the room.
const OVER_ROOMS: [&str; 6] = [
    "room_blended",
    "room_layered",
    "room_added",
    "no_room",
    "refused_room",
    "room_taken",
];

/// Whether the headset shows the room by `XR_FB_passthrough`, as far as it says.
fn has_layered_room() -> bool {
    let behaviours = ["room_layered", "refused_room", "room_taken"];
    behaviours.into_iter().any(asked_for)
}

unsafe extern "system" fn create_passthrough(
    session: xr::Session,
    info: *const xr::PassthroughCreateInfoFB,
    out: *mut xr::PassthroughFB,
) -> R {
    let mut state = state();
    check!(state, session);
    if (*info).flags != xr::PassthroughFlagsFB::IS_RUNNING_AT_CREATION {
        return R::ERROR_VALIDATION_FAILURE;
    }
    if asked_for("refused_room") {
        return R::ERROR_FEATURE_UNSUPPORTED;
    }
    state.session.room = state.handle();
    out.write(xr::PassthroughFB::from_raw(state.session.room));
    R::SUCCESS
}

unsafe extern "system" fn create_passthrough_layer(
    session: xr::Session,
    info: *const xr::PassthroughLayerCreateInfoFB,
    out: *mut xr::PassthroughLayerFB,
) -> R {
    let mut state = state();
    check!(state, session);
    if (*info).flags != xr::PassthroughFlagsFB::IS_RUNNING_AT_CREATION
        || (*info).purpose != xr::PassthroughLayerPurposeFB::RECONSTRUCTION
    {
        return R::ERROR_VALIDATION_FAILURE;
    }
    if (*info).passthrough.into_raw() != state.session.room {
        return R::ERROR_HANDLE_INVALID;
    }
    if asked_for("room_taken") && state.has_failed {
        return R::ERROR_FEATURE_UNSUPPORTED;
    }
    state.session.room_layer = state.handle();
    out.write(xr::PassthroughLayerFB::from_raw(state.session.room_layer));
    R::SUCCESS
}

unsafe extern "system" fn destroy_passthrough(room: xr::PassthroughFB) -> R {
    forget(&mut state().session.room, room.into_raw())
}

unsafe extern "system" fn destroy_passthrough_layer(layer: xr::PassthroughLayerFB) -> R {
    forget(&mut state().session.room_layer, layer.into_raw())
}

fn forget(known: &mut u64, handle: u64) -> R {
    if handle == 0 || handle != *known {
        return R::ERROR_HANDLE_INVALID;
    }
    *known = 0;
    R::SUCCESS
}

/// Whether a layer is of the room that the session shows, if it is of a room at all.
unsafe fn is_of_session(layer: *const xr::CompositionLayerBaseHeader, session: &Session) -> bool {
    if (*layer).ty != xr::CompositionLayerPassthroughFB::TYPE {
        return true;
    }
    let room = layer.cast::<xr::CompositionLayerPassthroughFB>();
    session.room_layer != 0 && (*room).layer_handle.into_raw() == session.room_layer
}

unsafe extern "system" fn end_frame(session: xr::Session, info: *const xr::FrameEndInfo) -> R {
    let mut state = state();
    let waited = state.session.waited as i64;
    if (*info).display_time.as_nanos() != 1_000_000_000 + waited * period_ns() {
        return R::ERROR_TIME_INVALID;
    }
    if (*info).layer_count > 0 {
        if !is_seen(&state) {
            return R::ERROR_VALIDATION_FAILURE;
        }
        state.session.is_lost |= state.fails_now("end_frame_lost");
        check!(state, session);
        let layers = std::slice::from_raw_parts((*info).layers, (*info).layer_count as usize);
        if !(layers.iter()).all(|layer| is_of_session(*layer, &state.session)) {
            return R::ERROR_HANDLE_INVALID;
        }
        if OVER_ROOMS.into_iter().any(asked_for) {
            let kinds: Vec<_> = layers.iter().map(|layer| (**layer).ty).collect();
            let flags = layers.iter().map(|layer| (**layer).layer_flags);
            let has_alpha: Vec<_> = flags
                .map(|flags| flags.contains(xr::CompositionLayerFlags::BLEND_TEXTURE_SOURCE_ALPHA))
                .collect();
            let mode = (*info).environment_blend_mode;
            eprintln!("over the room: {mode:?}, layers {kinds:?}, alpha {has_alpha:?}");
        }
        state.shown += 1;
    }
    if state.fails_now("loss_pending") {
        state.enter(&[S::LOSS_PENDING]);
    } else if state.fails_now("instance_loss_pending") {
        state.events.push_back(Event::InstanceLossPending);
    } else if state.fails_now("changes") {
        state.events.push_back(Event::RefreshRate);
        state.events.push_back(Event::VisibilityMask);
    } else if state.fails_now("exiting") || state.fails_now("pause") {
        state.enter(&[S::VISIBLE, S::SYNCHRONIZED, S::STOPPING]);
    }
    R::SUCCESS
}

unsafe extern "system" fn locate_views(
    session: xr::Session,
    _: *const xr::ViewLocateInfo,
    located: *mut xr::ViewState,
    capacity: u32,
    count: *mut u32,
    out: *mut xr::View,
) -> R {
    let mut state = state();
    state.session.is_lost |= state.fails_now("locate_lost");
    check!(state, session);
    (*located).view_state_flags =
        xr::ViewStateFlags::POSITION_VALID | xr::ViewStateFlags::ORIENTATION_VALID;
    let is_nowhere = asked_for("lost_on_the_way") && state.session.waited == 4;
    let eyes: &[f32] = if asked_for("one_view") {
        &[-0.032]
    } else {
        &[-0.032, 0.032]
    };
    fill(eyes, capacity, count, |index, x| {
        let turn = if is_nowhere { f32::NAN } else { 0.0 };
        (*out.add(index)).pose = posef([turn, 0.0, 0.0, 1.0], [*x, 0.0, 0.0]);
        (*out.add(index)).fov = xr::Fovf {
            angle_left: -0.7,
            angle_right: 0.7,
            angle_up: 0.7,
            angle_down: -0.7,
        };
    })
}

unsafe extern "system" fn swapchain_formats(
    _: xr::Session,
    capacity: u32,
    count: *mut u32,
    out: *mut i64,
) -> R {
    // VK_FORMAT_R8G8B8A8_SRGB; or only VK_FORMAT_R8G8B8A8_UNORM.
    let format = if asked_for("no_format") { 37 } else { 43 };
    fill(&[format], capacity, count, |_, format| out.write(*format))
}

unsafe extern "system" fn refresh_rates(
    _: xr::Session,
    capacity: u32,
    count: *mut u32,
    out: *mut f32,
) -> R {
    let usable = (asked_for("wild_rates") || asked_for("changes")).then_some(75.0);
    let wild = [f32::NAN, -90.0, 0.0, f32::INFINITY, 1e30];
    let rates: Vec<f32> = wild.into_iter().chain(usable).collect();
    fill(&rates, capacity, count, |index, rate| {
        out.add(index).write(*rate);
    })
}

unsafe extern "system" fn refresh_rate(_: xr::Session, out: *mut f32) -> R {
    out.write(f32::NAN);
    R::SUCCESS
}

unsafe extern "system" fn request_refresh_rate(_: xr::Session, rate: f32) -> R {
    if rate == 75.0 {
        R::SUCCESS
    } else {
        R::ERROR_DISPLAY_REFRESH_RATE_UNSUPPORTED_FB
    }
}

unsafe extern "system" fn visibility_mask(
    _: xr::Session,
    _: xr::ViewConfigurationType,
    _: u32,
    _: xr::VisibilityMaskTypeKHR,
    mask: *mut xr::VisibilityMaskKHR,
) -> R {
    let mask = &mut *mask;
    if asked_for("changes") {
        let corner = [[-1.0, 1.0], [1.0, 1.0], [-1.0, -1.0]];
        let hidden = if state().has_failed { &corner[..] } else { &[] };
        mask.vertex_count_output = hidden.len() as u32;
        mask.index_count_output = hidden.len() as u32;
        if mask.vertex_capacity_input > 0 {
            for (index, &[x, y]) in hidden.iter().enumerate() {
                mask.vertices.add(index).write(xr::Vector2f { x, y });
                mask.indices.add(index).write(index as u32);
            }
        }
        return R::SUCCESS;
    }
    const TRIANGLES: u32 = 100_000;
    mask.vertex_count_output = 4;
    mask.index_count_output = 3 * TRIANGLES;
    if mask.vertex_capacity_input == 0 || mask.index_capacity_input == 0 {
        return R::SUCCESS;
    }
    // The last corner is no place; of the triangles every second names a corner that is not there.
    let corners = [[-1.0, 1.0], [-0.9, 1.0], [-1.0, 0.9], [f32::NAN, 0.0]];
    for (index, [x, y]) in corners.into_iter().enumerate() {
        mask.vertices.add(index).write(xr::Vector2f { x, y });
    }
    for index in 0..3 * TRIANGLES {
        let corner = if index % 6 == 5 { u32::MAX } else { index % 3 };
        mask.indices.add(index as usize).write(corner);
    }
    R::SUCCESS
}
