//! Runs the shaders' light code for tests, and makes small scenes for it.

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DVec3, Vec3};
use stereolux::bvh::records::{Instance, Triangle};
use stereolux::gpu::buffers::storage_buffer_with_data;
use stereolux::gpu::{GpuContext, Kernel, Resources};
use stereolux::renderer::packing::{
    LightKinds, LightSources, PackedLights, emitter_ordinals, pack_environment, pack_lights,
    pack_materials, pack_textures, pack_vertices,
};
use stereolux::scene::{LightKind, Material, Mesh, Node, PunctualLight, Scene};

use super::trace_probe::{ask, probe, probe_source};

/// What densities are asked for.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct LightQuery {
    pub from_position: [f32; 3],
    pub instance: u32,
    pub position: [f32; 3],
    pub triangle: u32,
    pub geometric_normal: [f32; 3],
    pub reserved: u32,
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    a: [f32; 4],
    b: [f32; 4],
    c: [f32; 4],
}

/// A direction towards a light.
#[derive(Clone, Copy, Debug)]
pub struct Towards {
    pub direction: DVec3,
    pub distance: f64,
    pub radiance: [f64; 3],
    pub pdf: f64,
    pub is_delta: bool,
}

/// A photon.
#[derive(Clone, Copy, Debug)]
pub struct Photon {
    pub origin: DVec3,
    pub direction: DVec3,
    pub flux: [f64; 3],
    pub pdf_position: f64,
    pub pdf_direction: f64,
}

/// A scene's buffers, without a hierarchy.
pub struct SceneUpload {
    buffers: Vec<(&'static str, wgpu::Buffer)>,
    pub lights: PackedLights,
}

/// The probe with a scene's buffers.
pub struct LightProbe<'a> {
    context: &'a GpuContext,
    kernels: [Kernel; 3],
    scene: SceneUpload,
    pub lights: PackedLights,
}

fn xyz(v: [f32; 4]) -> DVec3 {
    Vec3::new(v[0], v[1], v[2]).as_dvec3()
}

/// Rows of a 3x4 matrix.
fn rows(m: DAffine3) -> [[f32; 4]; 3] {
    let (linear, t) = (m.matrix3.transpose(), m.translation);
    [0, 1, 2].map(|axis| linear.col(axis).extend(t[axis]).as_vec4().to_array())
}

impl SceneUpload {
    /// Packs and uploads; render space has its origin at `origin`.
    pub fn new(context: &GpuContext, scene: &Scene, origin: DVec3) -> Self {
        // Triangles stay in file order: the hierarchy has its own tests.
        let mut first_triangle = Vec::new();
        let (mut triangles, mut triangle_vertices) = (Vec::new(), Vec::new());
        let mut leaf_of_triangle = Vec::new();
        let mut first_vertex = 0;
        for mesh in &scene.meshes {
            let first = triangles.len() as u32;
            first_triangle.push(first);
            leaf_of_triangle.push((first..first + mesh.triangles.len() as u32).collect());
            let ordinals = emitter_ordinals(scene, mesh);
            for (index, triangle) in mesh.triangles.iter().enumerate() {
                let [v0, v1, v2] = triangle.vertices.map(|v| mesh.positions[v as usize]);
                triangles.push(Triangle {
                    v0,
                    material: triangle.material,
                    v1,
                    emitter: ordinals[index],
                    v2,
                    flags: 0,
                });
                let [a, b, c] = triangle.vertices.map(|v| v + first_vertex);
                triangle_vertices.push([a, b, c, index as u32]);
            }
            first_vertex += mesh.positions.len() as u32;
        }
        let environment = scene.environment.as_ref().and_then(pack_environment);
        let sources = LightSources {
            scene,
            environment: environment.as_ref(),
            leaf_of_triangle: &leaf_of_triangle,
            kinds: LightKinds::default(),
        };
        let lights = pack_lights(&sources, origin);
        let instances: Vec<Instance> = scene
            .instances()
            .iter()
            .zip(&lights.first_emitter)
            .map(|(instance, first_emitter)| {
                let render_from_object =
                    DAffine3::from_translation(-origin) * instance.world_from_object;
                let forward = rows(render_from_object);
                let back = rows(render_from_object.inverse());
                Instance {
                    render_from_object_0: forward[0],
                    render_from_object_1: forward[1],
                    render_from_object_2: forward[2],
                    object_from_render_0: back[0],
                    object_from_render_1: back[1],
                    object_from_render_2: back[2],
                    blas_root: 0,
                    first_emitter: *first_emitter,
                    flags: u32::from(render_from_object.matrix3.determinant() < 0.0),
                    node: instance.node as u32,
                }
            })
            .collect();
        let textures = pack_textures(scene, 1 << 24, true).unwrap();
        let mut buffers = Vec::new();
        macro_rules! upload {
            ($name:literal, $data:expr) => {
                buffers.push((
                    $name,
                    storage_buffer_with_data(context, $name, $data).unwrap(),
                ));
            };
        }
        upload!("materials", &pack_materials(scene, &textures).unwrap());
        upload!("texture_infos", &textures.infos);
        upload!("texels", &textures.texels);
        upload!("vertices", &pack_vertices(scene));
        upload!("triangles", &triangles);
        upload!("triangle_vertices", &triangle_vertices);
        upload!("instances", &instances);
        upload!("lights", lights.words());
        upload!("light_alias", &lights.alias);
        let (texels, cdf) = environment
            .as_ref()
            .map(|e| (e.texels.clone(), e.cdf.clone()))
            .unwrap_or_default();
        upload!("environment_map", &texels);
        upload!("environment_cdf", &cdf);
        Self { buffers, lights }
    }

    /// These buffers and others.
    pub fn with<'b>(&'b self, mut resources: Resources<'b>) -> Resources<'b> {
        for (name, buffer) in &self.buffers {
            resources = resources.with(name, buffer);
        }
        resources
    }
}

impl<'a> LightProbe<'a> {
    pub fn new(context: &'a GpuContext, on: &[&str], scene: &Scene, origin: DVec3) -> Self {
        let kernels = [&[][..], &["probe_emit"], &["probe_pdf"]].map(|modes| {
            let source = probe_source(include_str!("lights_probe.wesl"), modes);
            probe(context, source, on)
        });
        let upload = SceneUpload::new(context, scene, origin);
        Self {
            context,
            kernels,
            lights: upload.lights.clone(),
            scene: upload,
        }
    }

    fn run(&self, mode: usize, queries: &[LightQuery], count: u32, seed: u32) -> Vec<Answer> {
        let kernel = &self.kernels[mode];
        let settings =
            storage_buffer_with_data(self.context, "probe", &[count, seed, 0, 0]).unwrap();
        let resources = self.scene.with(Resources::new().with("probe", &settings));
        ask(self.context, kernel, &resources, queries, count as usize)
    }

    /// Directions towards lights as seen from a point of render space. Draws without a sample have pdf 0.
    pub fn towards(&self, position: DVec3, count: u32, seed: u32) -> Vec<Towards> {
        let query = LightQuery {
            from_position: position.as_vec3().to_array(),
            ..LightQuery::default()
        };
        self.run(0, &[query], count, seed)
            .iter()
            .map(|answer| Towards {
                direction: xyz(answer.a),
                distance: f64::from(answer.a[3]),
                radiance: xyz(answer.b).to_array(),
                pdf: f64::from(answer.b[3]),
                is_delta: answer.c[0] != 0.0,
            })
            .collect()
    }

    /// Photons.
    pub fn photons(&self, count: u32, seed: u32) -> Vec<Photon> {
        self.run(1, &[LightQuery::default()], count, seed)
            .iter()
            .map(|answer| Photon {
                origin: xyz(answer.a),
                direction: xyz(answer.b),
                flux: xyz(answer.c).to_array(),
                pdf_position: f64::from(answer.a[3]),
                pdf_direction: f64::from(answer.c[3]),
            })
            .collect()
    }

    /// Radiance and density per query.
    pub fn densities(&self, queries: &[LightQuery]) -> Vec<([f64; 3], f64)> {
        self.run(2, queries, queries.len() as u32, 0)
            .iter()
            .map(|answer| (xyz(answer.b).to_array(), f64::from(answer.b[3])))
            .collect()
    }
}

/// A node at a place in the world.
pub fn node(world_from_node: DAffine3) -> Node {
    Node {
        parent_from_node: world_from_node,
        ..Node::default()
    }
}

/// Adds a mesh of separate triangles, all of one material, and places it.
pub fn add_triangles(
    scene: &mut Scene,
    corners: &[[DVec3; 3]],
    material: Material,
    world_from_object: DAffine3,
) {
    let all = corners.iter().flatten();
    let positions = all.map(|corner| corner.as_vec3().to_array()).collect();
    let normals = vec![[0.0, 1.0, 0.0]; 3 * corners.len()];
    let triangles = (0..corners.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]);
    scene.meshes.push(Mesh {
        uv0: [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]].repeat(corners.len()),
        ..Mesh::plain(positions, normals, triangles, scene.materials.len() as u32)
    });
    scene.materials.push(material);
    scene.roots.push(scene.nodes.len());
    scene.nodes.push(Node {
        mesh: Some(scene.meshes.len() - 1),
        ..node(world_from_object)
    });
}

/// Adds a punctual light and places it.
pub fn add_light(
    scene: &mut Scene,
    kind: LightKind,
    intensity: [f32; 3],
    world_from_light: DAffine3,
) {
    scene.lights.push(PunctualLight {
        name: String::new(),
        kind,
        intensity,
    });
    scene.roots.push(scene.nodes.len());
    scene.nodes.push(Node {
        light: Some(scene.lights.len() - 1),
        ..node(world_from_light)
    });
}

/// A black material that emits.
pub fn glowing(emission: [f32; 3]) -> Material {
    Material {
        emission,
        ..Material::lambert("glowing", [0.0; 3])
    }
}
