//! Runs the shaders' BSDF code for tests.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};
use stereolux::gpu::buffers::storage_buffer_with_data;
use stereolux::gpu::{GpuContext, Kernel, Resources, ShaderLibrary};
use stereolux::renderer::packing::{PackedTextures, pack_materials};
use stereolux::scene::{Material, Scene};

use super::trace_probe::{ask, probe_in, probe_source};

/// A pair of directions at a material, or the direction to sample for.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct BsdfQuery {
    pub wo: [f32; 3],
    pub material: u32,
    pub wi: [f32; 3],
    pub flags: u32,
}

impl BsdfQuery {
    pub fn pair(wo: [f32; 3], material: usize, wi: [f32; 3], flags: u32) -> Self {
        Self {
            wo,
            material: material as u32,
            wi,
            flags,
        }
    }

    /// For samples.
    pub fn from(wo: [f32; 3], material: usize, flags: u32) -> Self {
        Self::pair(wo, material, [0.0; 3], flags)
    }
}

/// [`BsdfQuery::flags`]: the ray meets the back.
pub const BACK: u32 = 1;
/// [`BsdfQuery::flags`]: photons instead of radiance.
pub const PHOTONS: u32 = 2;

/// What the shader answers.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct BsdfAnswer {
    /// Value, or weight of the sample.
    pub value: [f32; 3],
    pub pdf: f32,
    pub wi: [f32; 3],
    pub flags: u32,
}

pub const DELTA: u32 = 1;
pub const TRANSMITTED: u32 = 2;
pub const NONE: u32 = 0x80;

/// The probe, compiled for eval and for sampling.
pub struct BsdfProbe<'a> {
    context: &'a GpuContext,
    eval: Kernel,
    sample: Kernel,
    materials: wgpu::Buffer,
}

impl<'a> BsdfProbe<'a> {
    /// By the shaders as they are.
    pub fn embedded(context: &'a GpuContext, on: &[&str], materials: &[Material]) -> Self {
        Self::new(context, &ShaderLibrary::embedded(), on, materials)
    }

    pub fn new(
        context: &'a GpuContext,
        library: &ShaderLibrary,
        on: &[&str],
        materials: &[Material],
    ) -> Self {
        let [eval, sample] = [&[][..], &["probe_sampling"]].map(|modes| {
            let source = probe_source(include_str!("bsdf_probe.wesl"), modes);
            probe_in(context, library.clone(), source, on)
        });
        let scene = Scene {
            materials: materials.to_vec(),
            ..Scene::default()
        };
        let packed = pack_materials(&scene, &PackedTextures::default()).unwrap();
        let materials = storage_buffer_with_data(context, "materials", &packed).unwrap();
        Self {
            context,
            eval,
            sample,
            materials,
        }
    }

    fn run(
        &self,
        kernel: &Kernel,
        queries: &[BsdfQuery],
        samples_per_query: u32,
        seed: u32,
    ) -> Vec<BsdfAnswer> {
        let count = queries.len() * samples_per_query as usize;
        let settings =
            storage_buffer_with_data(self.context, "probe", &[samples_per_query, seed, 0, 0])
                .unwrap();
        let resources = Resources::new()
            .with("materials", &self.materials)
            .with("probe", &settings);
        ask(self.context, kernel, &resources, queries, count)
    }

    /// Values and densities, one per query.
    pub fn evaluate(&self, queries: &[BsdfQuery]) -> Vec<BsdfAnswer> {
        self.run(&self.eval, queries, 1, 0)
    }

    /// `count` samples for one direction.
    pub fn samples(&self, query: BsdfQuery, count: u32, seed: u32) -> Vec<BsdfAnswer> {
        self.run(&self.sample, &[query], count, seed)
    }
}

/// Direction in the local frame at an angle from the normal, f32.
pub fn at_angle(degrees: f64, azimuth: f64) -> [f32; 3] {
    let theta = degrees.to_radians();
    let (x, y) = (theta.sin() * azimuth.cos(), theta.sin() * azimuth.sin());
    DVec3::new(x, y, theta.cos()).as_vec3().to_array()
}

/// f64 from the f32 triple that the shader got.
pub fn wide(v: [f32; 3]) -> DVec3 {
    Vec3::from_array(v).as_dvec3()
}
