//! What the tests of moving scenes share.

use glam::{DAffine3, DVec3};
use stereolux::bvh::records::Triangle;
use stereolux::gpu::{GpuContext, Kernel, Resources};
use stereolux::renderer::SceneBuffers;

use super::bvh_reference::ExactInstance;
use super::trace_probe::{Random, TraceProbe, TraceQuery, ask, disagreements, probe};

/// Asks the shaders' `previous_point`.
pub struct PreviousProbe<'a> {
    context: &'a GpuContext,
    kernel: Kernel,
}

impl<'a> PreviousProbe<'a> {
    pub fn new(context: &'a GpuContext, on: &[&str]) -> Self {
        let kernel = probe(context, include_str!("previous_probe.wesl"), on);
        Self { context, kernel }
    }

    /// Positions relative to the previous frame's origin; `None` where the previous frame had no such instance.
    pub fn ask(
        &self,
        scene: &Resources<'_>,
        points: &[(u32, u32, [f32; 2])],
    ) -> Vec<Option<DVec3>> {
        let queries: Vec<[u32; 4]> = points
            .iter()
            .map(|&(instance, triangle, [v, w])| [instance, triangle, v.to_bits(), w.to_bits()])
            .collect();
        let count = queries.len();
        let answers: Vec<[f32; 4]> = ask(self.context, &self.kernel, scene, &queries, count);
        let point = |[x, y, z, exists]: [f32; 4]| {
            (exists == 1.0).then(|| DVec3::from([x, y, z].map(f64::from)))
        };
        answers.into_iter().map(point).collect()
    }
}

/// Random points of random triangles.
pub fn random_points(
    random: &mut Random,
    triangles: &[(u32, std::ops::Range<u32>)],
    count: usize,
) -> Vec<(u32, u32, [f32; 2])> {
    (0..count)
        .map(|_| {
            let (instance, range) = &triangles[random.below(triangles.len())];
            let triangle = range.start + random.below(range.len()) as u32;
            (*instance, triangle, random.weights())
        })
        .collect()
}

/// Point of a triangle by f64.
pub fn point_of(corners: [DVec3; 3], [v, w]: [f32; 2]) -> DVec3 {
    let (v, w) = (f64::from(v), f64::from(w));
    corners[0] + v * (corners[1] - corners[0]) + w * (corners[2] - corners[0])
}

/// Bound on the error of a point that f32 rows took to render space: a triangle's point takes 5 roundings of each of
/// three terms, a row 5 more with its coefficients rounded. 16 units of every magnitude that takes part cover both.
pub fn f32_bound(render_from_object: &DAffine3, corners_in_object: [DVec3; 3]) -> DVec3 {
    let reach = corners_in_object
        .iter()
        .fold(DVec3::ZERO, |most, corner| most.max(corner.abs()))
        * 3.0;
    let linear = render_from_object.matrix3;
    let rows = [linear.row(0), linear.row(1), linear.row(2)].map(|row| row.abs().dot(reach));
    16.0 / 16_777_216.0 * (DVec3::from_array(rows) + render_from_object.translation.abs())
}

/// Rays into and through the scene on which the device disagrees with exhaustive search, and how many hit.
pub fn wrong_hits(
    probe: &TraceProbe<'_>,
    scene: &SceneBuffers,
    exact: &[ExactInstance],
    triangles: &[Triangle],
    random: &mut Random,
    count: usize,
) -> (usize, usize) {
    let mut ends = Vec::new();
    for (placed, range) in exact {
        for triangle in range.clone().step_by(range.len().div_ceil(16).max(1)) {
            let v0 = glam::Vec3::from(triangles[triangle as usize].v0).as_dvec3();
            ends.push(placed.transform_point3(v0));
        }
    }
    let low = ends.iter().fold(DVec3::INFINITY, |a, b| a.min(*b));
    let high = ends.iter().fold(DVec3::NEG_INFINITY, |a, b| a.max(*b));
    let size = (high - low).max_element().max(1e-3);
    let queries: Vec<_> = (0..count)
        .map(|_| {
            let target = ends[random.below(ends.len())] + 0.05 * size * random.vector();
            let origin = 0.5 * (low + high) + size * random.vector();
            TraceQuery::ray(origin.as_vec3(), (target - origin).normalize().as_vec3())
        })
        .collect();
    let answers = probe.run_in(&scene.resources(), &queries);
    disagreements(exact, triangles, &queries, &answers, DVec3::ZERO)
}
