//! The traversal's twin on the CPU, and a search over every triangle in f64 to judge both by.
//!
//! [`trace`] follows `shaders/shared/traversal.wesl` line by line in f32, without alpha. [`brute_force`] shares no
//! arithmetic with it.

use glam::{BVec3, DAffine3, DVec3, Vec2, Vec3, Vec4};
use stereolux_bvh::records::{BvhNode, INSTANCE_NUMBER_SHIFT, Instance, Triangle};
use stereolux_bvh::{InstanceSource, MAX_INDEX, MESH_STACK, MeshHierarchies, TOP_STACK};

/// The arrays that the shader sees.
#[derive(Clone, Copy, Debug)]
pub struct Arrays<'a> {
    /// Nodes of the instance hierarchy, root first.
    pub top_nodes: &'a [BvhNode],
    /// Nodes of all mesh hierarchies.
    pub mesh_nodes: &'a [BvhNode],
    /// Placed meshes.
    pub instances: &'a [Instance],
    /// Triangles in leaf order.
    pub triangles: &'a [Triangle],
}

/// A ray in render space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Metres.
    pub origin: Vec3,
    /// Hits at t >= t_max do not count.
    pub t_max: f32,
    /// Any length but 0; t counts in multiples of it.
    pub direction: Vec3,
}

/// A surface that a ray meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in multiples of the direction's length.
    pub t: f32,
    /// Index of the instance.
    pub instance: u32,
    /// Index of the triangle in leaf order.
    pub triangle: u32,
    /// Barycentric weights of v1 and v2.
    pub weights: Vec2,
}

const U: f32 = f32::EPSILON / 2.0;
const TRANSFORM_GAMMA: f32 = 6.0 * U;
const MESH_PAD: f32 = 16.0 * U;
const TOP_PAD: f32 = 64.0 * U;
const SLAB_SLACK: f32 = 1.0 + 64.0 * U;
const FARTHEST: f32 = 1e30;
const STACK: usize = (MESH_STACK + TOP_STACK) as usize;

#[derive(Clone, Copy)]
struct SlabRay {
    reciprocal: Vec3,
    near_origin: Vec3,
    far_origin: Vec3,
}

impl SlabRay {
    fn new(origin: Vec3, direction: Vec3, pad_units: f32) -> Self {
        let sign = Vec3::select(direction.cmpge(Vec3::ZERO), Vec3::ONE, Vec3::NEG_ONE);
        let magnitude = direction
            .abs()
            .max(Vec3::splat(1e-10 * direction.abs().max_element()));
        let pad = pad_units * origin.abs().max_element();
        Self {
            reciprocal: sign / magnitude,
            near_origin: origin + sign * pad,
            far_origin: origin - sign * pad,
        }
    }

    fn enter(&self, min: [f32; 3], max: [f32; 3], t_limit: f32) -> Option<f32> {
        let (min, max) = (Vec3::from(min), Vec3::from(max));
        let is_positive: BVec3 = self.reciprocal.cmpge(Vec3::ZERO);
        let near = (Vec3::select(is_positive, min, max) - self.near_origin) * self.reciprocal;
        let far = (Vec3::select(is_positive, max, min) - self.far_origin) * self.reciprocal;
        let t_near = near.max_element().max(0.0);
        let t_far = far.min_element().min(t_limit) * SLAB_SLACK;
        (t_near <= t_far).then_some(t_near)
    }
}

fn permute(v: Vec3, axis: usize) -> Vec3 {
    match axis {
        0 => Vec3::new(v.y, v.z, v.x),
        1 => Vec3::new(v.z, v.x, v.y),
        _ => v,
    }
}

#[derive(Clone, Copy)]
struct ShearRay {
    origin: Vec3,
    error: Vec3,
    shear: Vec2,
    reciprocal_z: f32,
    axis: usize,
}

impl ShearRay {
    fn new(origin: Vec3, direction: Vec3, error: Vec3) -> Self {
        let axis = direction.abs().max_position();
        let d = permute(direction, axis);
        Self {
            origin,
            error: permute(error, axis),
            shear: Vec2::new(d.x / d.z, d.y / d.z),
            reciprocal_z: 1.0 / d.z,
            axis,
        }
    }

    fn cross(&self, triangle: &Triangle, t_limit: f32) -> Option<(f32, Vec2)> {
        let [a, b, c] = [triangle.v0, triangle.v1, triangle.v2]
            .map(|vertex| permute(Vec3::from(vertex) - self.origin, self.axis));
        let z = Vec3::new(a.z, b.z, c.z);
        let x = Vec3::new(a.x, b.x, c.x) - self.shear.x * z;
        let y = Vec3::new(a.y, b.y, c.y) - self.shear.y * z;
        let p = Vec3::new(x.z, x.x, x.y) * Vec3::new(y.y, y.z, y.x);
        let q = Vec3::new(y.z, y.x, y.y) * Vec3::new(x.y, x.z, x.x);
        if !(p.cmpge(q).all() || p.cmple(q).all()) {
            return None;
        }
        let areas = (p - q).abs();
        let determinant = areas.x + areas.y + areas.z;
        if determinant.is_nan() || determinant <= 1e-37 {
            return None;
        }
        let weights = areas / determinant;
        let t = weights.dot(z) * self.reciprocal_z;
        if !(t > 0.0 && t <= t_limit) {
            return None;
        }
        let x_max = x.abs().max_element();
        let y_max = y.abs().max_element();
        let z_max = z.abs().max_element();
        let origin_error = self.error.x + self.error.y + self.error.z;
        let margin =
            (8.0 * origin_error + 32.0 * U * (x_max + y_max + z_max)) * self.reciprocal_z.abs();
        if (z * self.reciprocal_z).min_element() <= margin {
            let x_error = 5.0 * U * (x_max + z_max) + self.error.x + self.error.z;
            let y_error = 5.0 * U * (y_max + z_max) + self.error.y + self.error.z;
            let area_error = 2.0 * (x_max * y_error + y_max * x_error + 2.0 * U * x_max * y_max);
            let t_error = (3.0 * area_error * z_max / determinant + 8.0 * U * z_max + self.error.z)
                * self.reciprocal_z.abs();
            if t <= t_error {
                return None;
            }
        }
        Some((t, Vec2::new(weights.y, weights.z)))
    }
}

fn rows(rows: [[f32; 4]; 3], vector: Vec4) -> Vec3 {
    Vec3::from(rows.map(|row| Vec4::from(row).dot(vector)))
}

/// The nearest surface with 0 < t < t_max, or with `stop_at_first` any.
pub fn trace(arrays: &Arrays<'_>, ray: &Ray, stop_at_first: bool) -> Option<Hit> {
    let mut best: Option<Hit> = None;
    let mut t_best = ray.t_max.min(FARTHEST);
    let mut stack = [(0u32, 0u32); STACK];
    let mut depth = 0;
    let mut mesh_floor = 0;
    let mut current: Option<(u32, ShearRay)> = None;
    let top_slabs = SlabRay::new(ray.origin, ray.direction, TOP_PAD);
    let mut slabs = top_slabs;
    let mut entry = (0u32, 0u32);
    loop {
        let (index, count) = entry;
        match (count, &current) {
            (0, _) => {
                let nodes = if current.is_some() {
                    arrays.mesh_nodes
                } else {
                    arrays.top_nodes
                };
                let node = &nodes[index as usize];
                let left = slabs.enter(node.left_min, node.left_max, t_best);
                let right = slabs.enter(node.right_min, node.right_max, t_best);
                let left_entry = (node.left_index, node.left_count);
                let right_entry = (node.right_index, node.right_count);
                let next = match (left, right) {
                    (Some(left), Some(right)) => {
                        let (near, far) = if right < left {
                            (right_entry, left_entry)
                        } else {
                            (left_entry, right_entry)
                        };
                        stack[depth] = far;
                        depth += 1;
                        Some(near)
                    }
                    (Some(_), None) => Some(left_entry),
                    (None, Some(_)) => Some(right_entry),
                    (None, None) => None,
                };
                if let Some(next) = next {
                    entry = next;
                    continue;
                }
            }
            (_, None) => {
                let instance = &arrays.instances[index as usize];
                mesh_floor = depth;
                let matrix = [
                    instance.object_from_render_0,
                    instance.object_from_render_1,
                    instance.object_from_render_2,
                ];
                let origin = rows(matrix, ray.origin.extend(1.0));
                let direction = rows(matrix, ray.direction.extend(0.0));
                let error = TRANSFORM_GAMMA
                    * rows(
                        matrix.map(|row| row.map(f32::abs)),
                        ray.origin.abs().extend(1.0),
                    );
                slabs = SlabRay::new(origin, direction, MESH_PAD);
                let number = instance.flags >> INSTANCE_NUMBER_SHIFT;
                current = Some((number, ShearRay::new(origin, direction, error)));
                entry = (
                    instance.blas_root & (MAX_INDEX - 1),
                    instance.blas_root >> MAX_INDEX.ilog2(),
                );
                continue;
            }
            (_, Some((instance, sheared))) => {
                for triangle in index..index + count {
                    let Some((t, weights)) =
                        sheared.cross(&arrays.triangles[triangle as usize], t_best)
                    else {
                        continue;
                    };
                    let is_kept = best.map_or(t < t_best, |best| {
                        t < best.t || (*instance, triangle) < (best.instance, best.triangle)
                    });
                    if is_kept {
                        t_best = t;
                        best = Some(Hit {
                            t,
                            instance: *instance,
                            triangle,
                            weights,
                        });
                        if stop_at_first {
                            return best;
                        }
                    }
                }
            }
        }
        if depth == mesh_floor && current.is_some() {
            current = None;
            slabs = top_slabs;
        }
        if depth == 0 {
            return best;
        }
        depth -= 1;
        entry = stack[depth];
    }
}

/// A surface that the exhaustive search met.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExactHit {
    /// Distance in multiples of the direction's length.
    pub t: f64,
    /// Index of the instance.
    pub instance: usize,
    /// Index of the triangle.
    pub triangle: usize,
    /// Smallest barycentric weight: 0 on the triangle's border, 1/3 at its centre.
    pub inside: f64,
}

/// An instance for [`brute_force`]: its transform in f64 and its triangles in the triangle array.
pub type ExactInstance = (DAffine3, std::ops::Range<u32>);

/// Instances as they are placed, seen from `origin`.
pub fn exact_instances(
    sources: &[InstanceSource],
    meshes: &MeshHierarchies,
    origin: DVec3,
) -> Vec<ExactInstance> {
    let exact = |source: &InstanceSource| {
        let range = &meshes.meshes[source.mesh as usize];
        let mut from_origin = source.world_from_object;
        from_origin.translation -= origin;
        let end = range.first_triangle + range.triangle_count;
        (from_origin, range.first_triangle..end)
    };
    sources.iter().map(exact).collect()
}

/// All surfaces with t > 0 along a ray, nearest first. Borders count with a tolerance of `border` in barycentric
/// weights.
///
/// Plain f64: the intersection with the plane, then weights by areas within the triangle's own plane.
pub fn brute_force(
    instances: &[ExactInstance],
    triangles: &[Triangle],
    origin: DVec3,
    direction: DVec3,
    border: f64,
) -> Vec<ExactHit> {
    let mut hits = Vec::new();
    for (instance, (render_from_object, range)) in instances.iter().enumerate() {
        for triangle in range.clone() {
            let corners = &triangles[triangle as usize];
            let [a, b, c] = [corners.v0, corners.v1, corners.v2]
                .map(|vertex| render_from_object.transform_point3(Vec3::from(vertex).as_dvec3()));
            let normal = (b - a).cross(c - a);
            let slope = normal.dot(direction);
            let size = normal.length_squared();
            if slope == 0.0 || size == 0.0 {
                continue;
            }
            let t = normal.dot(a - origin) / slope;
            let point = origin + t * direction;
            let weight =
                |from: DVec3, to: DVec3| normal.dot((to - from).cross(point - from)) / size;
            let inside = weight(a, b).min(weight(b, c)).min(weight(c, a));
            if t > 0.0 && inside >= -border {
                hits.push(ExactHit {
                    t,
                    instance,
                    triangle: triangle as usize,
                    inside,
                });
            }
        }
    }
    hits.sort_by(|a, b| {
        a.t.total_cmp(&b.t)
            .then((a.instance, a.triangle).cmp(&(b.instance, b.triangle)))
    });
    hits
}
