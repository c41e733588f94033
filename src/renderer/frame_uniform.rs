//! What passes know of the frame and its eyes: `shaders/shared/frame.wesl`.

use glam::{DQuat, DVec3};

use super::Renderer;
use super::features::light_candidates;
use super::radii::most_correction;
use super::reconstruction::{pack_offset, pixel_offset};
use crate::renderer::records::frame::{
    Eye as EyeUniform, FRAME_ADAPTIVE_CAUSTIC_RADIUS, FRAME_ADAPTIVE_RADIUS, FRAME_DIRECT_FROM_MAP,
    FRAME_KERNEL_CONE, FRAME_KERNEL_EPANECHNIKOV, FRAME_PROGRESSIVE, FRAME_RUSSIAN_ROULETTE, Frame,
};
use crate::settings::{
    DirectLight, Eyes as EyeChoice, Kernel as DensityKernel, Method, PhotonSettings,
};
use crate::xr::View;

/// GGX alpha up to which eye paths follow a reflection. Wider lobes gather photons.
const FOLLOW_MAX_ALPHA: f32 = 0.05;

impl Renderer {
    /// What the passes of the next samples know. Its eyes look through the pixels' centres.
    pub(super) fn frame_uniform(
        &self,
        views: &[View; 2],
        frame_index: u32,
        first_sample: u32,
        photons: Option<(DVec3, u32)>,
    ) -> Frame {
        let origin = self.origin_in_world;
        let settings = &self.settings;
        let mut views = *views;
        if self.eye_choice == EyeChoice::Right {
            views[0] = views[1];
        }
        let mut flags = 0;
        if settings.path.russian_roulette {
            flags |= FRAME_RUSSIAN_ROULETTE;
        }
        if settings.photon.direct == DirectLight::Map {
            flags |= FRAME_DIRECT_FROM_MAP;
        }
        if settings.photon.progressive {
            flags |= FRAME_PROGRESSIVE;
        }
        flags |= match settings.photon.kernel {
            DensityKernel::Constant => 0,
            DensityKernel::Epanechnikov => FRAME_KERNEL_EPANECHNIKOV,
            DensityKernel::Cone => FRAME_KERNEL_CONE,
        };
        flags |= adaptive_radii(&settings.photon);
        let radius_now_m = |first_radius_m| self.progressive_pass.radius_m(first_radius_m) as f32;
        let (photon_origin, photon_frame_index) = photons.unwrap_or((origin, frame_index));
        Frame {
            left: eye_uniform(&views[0], origin),
            right: eye_uniform(&views[1], origin),
            left_from_right: (views[0].position_in_world - views[1].position_in_world)
                .as_vec3()
                .to_array(),
            flags,
            photon_offset: (photon_origin - origin).as_vec3().to_array(),
            photon_radius: radius_now_m(self.radius_m),
            width: self.image.size[0],
            height: self.image.size[1],
            seed: settings.seed,
            frame_index,
            first_sample,
            sample_count: settings.spp,
            max_depth: match settings.method {
                Method::Path => settings.path.max_depth,
                Method::Photon => settings.photon.max_depth,
            },
            caustic_radius: radius_now_m(self.caustic_radius_m),
            photon_frame_index,
            normal_min_cos: settings.photon.normal_min_cos as f32,
            reuse_max_view_dependence: settings.stereo.max_view_dependence as f32,
            follow_max_alpha: FOLLOW_MAX_ALPHA,
            reuse_max_lobe_shift: settings.stereo.max_lobe_shift as f32,
            nearest_photons: settings.photon.nearest,
            light_candidates: light_candidates(self.scene.light_count(), self.features(), settings),
            pixel_offset: 0,
            most_correction: most_correction(self.progressive_pass.index) as f32,
            padding: [0; 3],
        }
    }

    /// Hands `frame` to the device. Where frames are put together over time, its eyes are shifted by the frame's offset
    /// within the pixel: whatever goes through a pixel's centre then goes through that place, and is projected back to it.
    pub(super) fn write_frame_uniform(&self, frame: &Frame) {
        let offset = match self.reconstruction {
            Some(_) if self.settings.spp == 1 => pixel_offset(frame.frame_index),
            _ => [0.0; 2],
        };
        let shifted = Frame {
            left: shifted_eye(&frame.left, offset, self.image.size),
            right: shifted_eye(&frame.right, offset, self.image.size),
            pixel_offset: pack_offset(offset),
            ..*frame
        };
        self.context
            .queue
            .write_buffer(&self.frame_buffer, 0, bytemuck::bytes_of(&shifted));
    }
}

/// Flags of the radii that shrink where photons are dense: automatic ones; a caustic radius that follows a given one is given.
fn adaptive_radii(photon: &PhotonSettings) -> u32 {
    if !photon.adaptive_radius || photon.radius_m > 0.0 {
        0
    } else if photon.caustic_radius_m > 0.0 {
        FRAME_ADAPTIVE_RADIUS
    } else {
        FRAME_ADAPTIVE_RADIUS | FRAME_ADAPTIVE_CAUSTIC_RADIUS
    }
}

/// The eye whose pixel centres lie where `eye` has the places `offset` pixels from them.
fn shifted_eye(eye: &EyeUniform, offset: [f32; 2], size: [u32; 2]) -> EyeUniform {
    let across = (eye.tan_right - eye.tan_left) * (offset[0] / size[0] as f32);
    let down = (eye.tan_down - eye.tan_up) * (offset[1] / size[1] as f32);
    EyeUniform {
        tan_left: eye.tan_left + across,
        tan_right: eye.tan_right + across,
        tan_up: eye.tan_up + down,
        tan_down: eye.tan_down + down,
        ..*eye
    }
}

fn eye_uniform(view: &View, origin_in_world: DVec3) -> EyeUniform {
    let tangents = view.fov.tangents();
    let orientation: DQuat = view.orientation;
    EyeUniform {
        position: (view.position_in_world - origin_in_world)
            .as_vec3()
            .to_array(),
        tan_left: tangents.left as f32,
        axis_x: (orientation * DVec3::X).as_vec3().to_array(),
        tan_right: tangents.right as f32,
        axis_y: (orientation * DVec3::Y).as_vec3().to_array(),
        tan_up: tangents.up as f32,
        axis_z: (orientation * DVec3::Z).as_vec3().to_array(),
        tan_down: tangents.down as f32,
    }
}
