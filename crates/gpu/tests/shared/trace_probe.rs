//! Runs the shaders' traversal for tests, and builds the scenes they trace.

use std::borrow::Cow;

use bytemuck::{Pod, Zeroable};
use glam::{DAffine3, DVec3, Vec3};
use stereolux_bvh::records::Triangle;
use stereolux_bvh::{InstanceSource, MeshHierarchies, TopLevel};
use stereolux_gpu::buffers::{read_buffer, storage_buffer, storage_buffer_with_data};
use stereolux_gpu::{
    FrameRecorder, GpuContext, Kernel, PassTimes, Resources, ShaderFeatures, ShaderLibrary,
    Workgroups,
};
use stereolux_scene::{Mesh, MeshTriangle};

use super::bvh_reference::{ExactInstance, brute_force, exact_instances};
use super::bvh_shapes as shapes;
pub use super::bvh_shapes::Random;

pub const MISS: u32 = u32::MAX;

/// A ray, or a surface point and the direction in which to leave it.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct TraceQuery {
    pub origin: [f32; 3],
    pub t_max: f32,
    pub direction: [f32; 3],
    pub instance: u32,
    pub weights: [f32; 2],
    pub triangle: u32,
    pub padding: u32,
}

impl TraceQuery {
    pub fn ray(origin: Vec3, direction: Vec3) -> Self {
        Self {
            origin: origin.to_array(),
            t_max: 1e30,
            direction: direction.to_array(),
            ..Self::default()
        }
    }
}

#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub struct TraceAnswer {
    pub t: f32,
    pub instance: u32,
    pub triangle: u32,
    pub is_occluded: u32,
    pub weights: [f32; 2],
    pub padding_0: [u32; 2],
    pub position: [f32; 3],
    pub padding_1: u32,
    pub error: [f32; 3],
    pub padding_2: u32,
    pub normal: [f32; 3],
    pub padding_3: u32,
}

/// A scene on the device and in f64.
pub struct TraceScene {
    pub meshes: MeshHierarchies,
    pub top: TopLevel,
    /// Exact transforms relative to the origin, and each instance's triangles.
    pub exact: Vec<ExactInstance>,
    buffers: [wgpu::Buffer; 4],
}

impl TraceScene {
    pub fn new(
        context: &GpuContext,
        meshes: &[Mesh],
        placed: &[(DAffine3, u32)],
        origin_in_world: DVec3,
    ) -> Self {
        let meshes = MeshHierarchies::build(meshes, &[]).unwrap();
        meshes.validate().unwrap();
        let sources: Vec<_> = placed
            .iter()
            .map(|&(world_from_object, mesh)| InstanceSource {
                world_from_object,
                mesh,
                node: 0,
                first_emitter: 0,
            })
            .collect();
        let top = TopLevel::build(origin_in_world, &sources, &meshes).unwrap();
        top.validate().unwrap();
        let exact = exact_instances(&sources, &meshes, origin_in_world);
        let buffers = [
            storage_buffer_with_data(context, "top_nodes", top.nodes()).unwrap(),
            storage_buffer_with_data(context, "mesh_nodes", &meshes.nodes).unwrap(),
            storage_buffer_with_data(context, "instances", top.instances()).unwrap(),
            storage_buffer_with_data(context, "triangles", &meshes.triangles).unwrap(),
        ];
        Self {
            meshes,
            top,
            exact,
            buffers,
        }
    }

    /// Corners of a triangle of an instance in render space, f64.
    pub fn corners(&self, instance: u32, triangle: u32) -> [DVec3; 3] {
        corners_of(
            &self.exact,
            &self.meshes.triangles,
            instance as usize,
            triangle as usize,
        )
    }
}

/// Shader features by the words that a test lists.
pub fn features(on: &[&str]) -> ShaderFeatures {
    let mut features = ShaderFeatures::default();
    for word in on {
        // Its message names a word that is no feature's.
        *features.by_word_mut(word).ok_or(*word).unwrap() = true;
    }
    features
}

/// A probe beside the embedded shaders, with the features that `on` lists.
pub fn probe(context: &GpuContext, source: impl Into<Cow<'static, str>>, on: &[&str]) -> Kernel {
    probe_in(context, ShaderLibrary::embedded(), source, on)
}

/// The same beside other shaders.
pub fn probe_in(
    context: &GpuContext,
    mut library: ShaderLibrary,
    source: impl Into<Cow<'static, str>>,
    on: &[&str],
) -> Kernel {
    library.insert("tests/probe", source);
    Kernel::new(context, &library, "tests/probe", &features(on)).unwrap()
}

/// A probe's source in the named modes: they are true in its `@if`s, the others false.
pub fn probe_source(source: &str, modes: &[&str]) -> String {
    const MODES: [&str; 6] = [
        "probe_emit",
        "probe_no_offset",
        "probe_occlusion",
        "probe_pdf",
        "probe_respawn",
        "probe_sampling",
    ];
    assert!(modes.iter().all(|mode| MODES.contains(mode)), "{modes:?}");
    MODES.iter().fold(source.to_owned(), |text, mode| {
        text.replace(
            mode,
            if modes.contains(mode) {
                "true"
            } else {
                "false"
            },
        )
    })
}

/// Runs a probe over `queries`, with what else it reads in `scene`, and returns `count` answers.
pub fn ask<Q: Pod, A: Pod>(
    context: &GpuContext,
    kernel: &Kernel,
    scene: &Resources<'_>,
    queries: &[Q],
    count: usize,
) -> Vec<A> {
    let queries = storage_buffer_with_data(context, "queries", queries).unwrap();
    let answers = storage_buffer(context, "answers", (count * size_of::<A>()) as u64).unwrap();
    let resources = scene
        .clone()
        .with("queries", &queries)
        .with("answers", &answers);
    let bound = kernel.interface.bind(context, &resources).unwrap();
    let mut recorder = FrameRecorder::new(context, None, "probe");
    let groups = Workgroups::Direct(kernel.groups_for(count as u32));
    recorder.dispatch("probe", kernel, &bound, 0, groups);
    recorder.submit("probe", &mut PassTimes::default()).unwrap();
    read_buffer(context, "answers", &answers, count).unwrap()
}

/// The probe, compiled for one question.
pub struct TraceProbe<'a> {
    context: &'a GpuContext,
    kernel: Kernel,
}

impl<'a> TraceProbe<'a> {
    pub fn new(context: &'a GpuContext, library: &ShaderLibrary, modes: &[&str]) -> Self {
        let source = probe_source(include_str!("bvh_probe.wesl"), modes);
        let kernel = probe_in(context, library.clone(), source, &[]);
        Self { context, kernel }
    }

    pub fn run(&self, scene: &TraceScene, queries: &[TraceQuery]) -> Vec<TraceAnswer> {
        let [top_nodes, mesh_nodes, instances, triangles] = &scene.buffers;
        let resources = Resources::new()
            .with("top_nodes", top_nodes)
            .with("mesh_nodes", mesh_nodes)
            .with("instances", instances)
            .with("triangles", triangles);
        self.run_in(&resources, queries)
    }

    /// The same in a scene that a renderer holds.
    pub fn run_in(&self, scene: &Resources<'_>, queries: &[TraceQuery]) -> Vec<TraceAnswer> {
        ask(self.context, &self.kernel, scene, queries, queries.len())
    }
}

/// Corners of a triangle of an instance in render space, f64.
pub fn corners_of(
    exact: &[ExactInstance],
    triangles: &[Triangle],
    instance: usize,
    triangle: usize,
) -> [DVec3; 3] {
    let triangle = &triangles[triangle];
    [triangle.v0, triangle.v1, triangle.v2]
        .map(|v| exact[instance].0.transform_point3(Vec3::from(v).as_dvec3()))
}

/// Rays on which the device and the exhaustive search differ by more than rounding explains, and how many hit.
pub fn disagreements(
    exact: &[ExactInstance],
    triangles: &[Triangle],
    queries: &[TraceQuery],
    answers: &[TraceAnswer],
    offset: DVec3,
) -> (usize, usize) {
    let (mut wrong, mut hits) = (0, 0);
    for (query, answer) in queries.iter().zip(answers) {
        let origin = Vec3::from(query.origin).as_dvec3() + offset;
        let direction = Vec3::from(query.direction).as_dvec3();
        // Within 1e-4 of a border (barycentric) either answer is right. Rounding moves a crossing by some 1e-6 m here,
        // which is 1e-5 of the smaller triangles; needles are all border and take part as what must not break others.
        let all = brute_force(exact, triangles, origin, direction, 1e-4);
        let clear: Vec<_> = all
            .iter()
            .filter(|hit| {
                let [a, b, c] = corners_of(exact, triangles, hit.instance, hit.triangle);
                let longest = (b - a).length().max((c - a).length()).max((c - b).length());
                (b - a).cross(c - a).length() > 1e-2 * longest * longest
            })
            .collect();
        if clear.len() != all.len() || all.iter().any(|hit| hit.inside < 1e-4) {
            continue;
        }
        hits += usize::from(!all.is_empty());
        let agrees = if answer.instance == MISS {
            all.is_empty()
        } else {
            // t: coordinates up to 20 m, errors of tens of rounding units, slopes down to 1e-2.
            all.first()
                .is_some_and(|first| (f64::from(answer.t) - first.t).abs() < 1e-4 * (1.0 + first.t))
                && all.iter().any(|hit| {
                    (hit.instance, hit.triangle)
                        == (answer.instance as usize, answer.triangle as usize)
                })
        };
        wrong += usize::from(!agrees || (answer.is_occluded == 1) == all.is_empty());
    }
    (wrong, hits)
}

/// A mesh of triangles that share no vertices.
pub fn mesh_of(triangles: &[[Vec3; 3]]) -> Mesh {
    let (positions, triangles) = shapes::unshared(triangles);
    Mesh {
        positions,
        triangles,
        ..Mesh::default()
    }
}

/// Small random triangles in a cube of side 2.
pub fn soup(random: &mut Random, count: usize, size: f64) -> Mesh {
    mesh_of(&shapes::soup(random, count, size))
}

/// A closed sphere around the origin whose radius varies between 1 - `bump` and 1 + `bump`, its vertices shared.
pub fn sphere(random: &mut Random, segments: u32, rings: u32, bump: f64) -> Mesh {
    let mut positions = vec![[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]];
    for ring in 1..rings {
        for segment in 0..segments {
            let theta = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
            let phi = std::f64::consts::TAU * f64::from(segment) / f64::from(segments);
            let radius = 1.0 + bump * random.signed();
            let p = radius
                * DVec3::new(
                    theta.sin() * phi.cos(),
                    theta.cos(),
                    theta.sin() * phi.sin(),
                );
            positions.push(p.as_vec3().to_array());
        }
    }
    let at = |ring: u32, segment: u32| 2 + (ring - 1) * segments + segment % segments;
    let mut triangles = Vec::new();
    for s in 0..segments {
        triangles.push([0, at(1, s + 1), at(1, s)]);
        triangles.push([1, at(rings - 1, s), at(rings - 1, s + 1)]);
        for ring in 1..rings - 1 {
            triangles.push([at(ring, s), at(ring, s + 1), at(ring + 1, s)]);
            triangles.push([at(ring, s + 1), at(ring + 1, s + 1), at(ring + 1, s)]);
        }
    }
    Mesh {
        positions,
        triangles: triangles
            .into_iter()
            .map(|vertices| MeshTriangle {
                vertices,
                material: 0,
            })
            .collect(),
        ..Mesh::default()
    }
}
