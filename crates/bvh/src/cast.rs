//! Rays on the host, for what a person points at: one at a time, in f64, through the trees that the device has.
//!
//! Triangles are met from both sides, and without gaps (Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection",
//! JCGT 2(1), 2013): a ray through an edge or a corner that triangles share meets one of them. What a material lets pass
//! is met like the rest, for no texture is known here.

use glam::{DAffine3, DVec3, Vec3};

use crate::bounds::PAD_UNITS;
use crate::mesh::MeshHierarchies;
use crate::records::Triangle;
use crate::top::{InstanceSource, inverse};
use crate::tree::children;
use crate::{Bounds32, MAX_INDEX};

/// A ray with an end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it begins, metres.
    pub origin: DVec3,
    /// Any length but 0; distances along the ray count in multiples of it.
    pub direction: DVec3,
    /// Hits beyond do not count; may be infinite.
    pub t_max: f64,
}

/// Where a ray meets a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TriangleHit {
    /// Distance along the ray.
    pub t: f64,
    /// Number of the triangle in its mesh.
    pub triangle: u32,
    /// Weights of its three corners at the hit; they sum to 1.
    pub weights: [f64; 3],
    /// Out of its front, object space, of any length.
    pub normal: DVec3,
}

/// Where a ray meets a placed mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceHit {
    /// Index of the instance.
    pub instance: u32,
    /// The triangle.
    pub hit: TriangleHit,
    /// Out of the triangle's front, world space, unit length.
    pub normal_in_world: DVec3,
}

impl Ray {
    /// The same points in another space, at the same distances.
    #[must_use]
    pub fn transformed(&self, to_from_own: &DAffine3) -> Self {
        Self {
            origin: to_from_own.transform_point3(self.origin),
            direction: to_from_own.transform_vector3(self.direction),
            t_max: self.t_max,
        }
    }

    /// Where it enters a box, if it does before `t_max`: 0 from inside.
    fn enters(&self, bounds: &Bounds32, t_max: f64) -> Option<f64> {
        // A subtraction and a division, half a unit each, for either of two distances that are compared (Ize, "Robust BVH
        // Ray Traversal", JCGT 2(2), 2013, with a division in place of a reciprocal).
        const SLACK: f64 = 1.0 + 4.0 * f64::EPSILON;
        if bounds.is_empty() {
            return None;
        }
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let (mut near, mut far) = (0.0f64, t_max);
        for axis in 0..3 {
            let (origin, step) = (self.origin[axis], self.direction[axis]);
            if step == 0.0 {
                if !(min[axis]..=max[axis]).contains(&origin) {
                    return None;
                }
                continue;
            }
            let a = (min[axis] - origin) / step;
            let b = (max[axis] - origin) / step;
            near = near.max(a.min(b));
            far = far.min(a.max(b) * SLACK);
        }
        (near <= far).then_some(near)
    }
}

/// The paper's shear: the ray's longest axis becomes z, and the ray the z axis.
struct Shear {
    axes: [usize; 3],
    origin: DVec3,
    x: f64,
    y: f64,
    z: f64,
}

impl Shear {
    fn of(ray: &Ray) -> Self {
        let z = ray.direction.abs().max_position();
        let axes = [(z + 1) % 3, (z + 2) % 3, z];
        let along = ray.direction[z];
        Self {
            axes,
            origin: ray.origin,
            x: ray.direction[axes[0]] / along,
            y: ray.direction[axes[1]] / along,
            z: 1.0 / along,
        }
    }

    fn apply(&self, corner: DVec3) -> DVec3 {
        let from = corner - self.origin;
        let [x, y, z] = self.axes.map(|axis| from[axis]);
        DVec3::new(x - self.x * z, y - self.y * z, self.z * z)
    }

    /// Distance and weights at which the ray meets a triangle, wherever along it.
    fn meet(&self, corners: [DVec3; 3]) -> Option<(f64, [f64; 3])> {
        let [a, b, c] = corners.map(|corner| self.apply(corner));
        // Exactly the opposite for the neighbour across an edge: that is what leaves no gap.
        let weights = [
            c.x * b.y - c.y * b.x,
            a.x * c.y - a.y * c.x,
            b.x * a.y - b.y * a.x,
        ];
        if weights.iter().any(|w| *w < 0.0) && weights.iter().any(|w| *w > 0.0) {
            return None;
        }
        let sum: f64 = weights.iter().sum();
        if sum == 0.0 {
            return None;
        }
        let weights = weights.map(|weight| weight / sum);
        Some((
            weights[0] * a.z + weights[1] * b.z + weights[2] * c.z,
            weights,
        ))
    }
}

/// The nearest hit so far; of several at one distance the triangle with the least number.
struct Closest {
    shear: Shear,
    t_max: f64,
    best: Option<TriangleHit>,
}

impl Closest {
    fn new(ray: &Ray) -> Self {
        Self {
            shear: Shear::of(ray),
            t_max: ray.t_max,
            best: None,
        }
    }

    fn look_at(&mut self, triangle: u32, corners: [DVec3; 3]) {
        let Some((t, weights)) = self.shear.meet(corners) else {
            return;
        };
        let is_before = match &self.best {
            Some(best) => (t, triangle) < (best.t, best.triangle),
            None => t <= self.t_max,
        };
        if t >= 0.0 && is_before {
            let [a, b, c] = corners;
            self.t_max = t;
            self.best = Some(TriangleHit {
                t,
                triangle,
                weights,
                normal: (b - a).cross(c - a),
            });
        }
    }
}

/// Looks at every triangle: for shapes that no tree is built over. Corners are in the ray's space, by number.
pub fn cast_at_all(
    triangles: impl IntoIterator<Item = [DVec3; 3]>,
    ray: &Ray,
) -> Option<TriangleHit> {
    let mut closest = Closest::new(ray);
    for (triangle, corners) in (0..).zip(triangles) {
        closest.look_at(triangle, corners);
    }
    closest.best
}

impl MeshHierarchies {
    /// What a ray in a mesh's object space meets first; `None` too for a mesh that is not there.
    pub fn cast(&self, mesh: usize, ray: &Ray) -> Option<TriangleHit> {
        let range = self.meshes.get(mesh)?;
        range.bounds?;
        let mut closest = Closest::new(ray);
        let mut pending = vec![(0.0, range.root, 0)];
        while let Some((near, index, count)) = pending.pop() {
            if near > closest.t_max {
                continue;
            }
            if count > 0 {
                for leaf in index as usize..(index + count) as usize {
                    let Triangle { v0, v1, v2, .. } = self.triangles[leaf];
                    let corners = [v0, v1, v2].map(|corner| Vec3::from(corner).as_dvec3());
                    closest.look_at(self.triangle_vertices[leaf][3], corners);
                }
                continue;
            }
            let mut entered =
                children(&self.nodes[index as usize]).map(|(bounds, child, count)| {
                    let near = ray.enters(&bounds, closest.t_max)?;
                    Some((near, child, count))
                });
            // The nearer one is taken off first.
            if let [Some(left), Some(right)] = entered
                && left.0 < right.0
            {
                entered.swap(0, 1);
            }
            pending.extend(entered.into_iter().flatten());
        }
        closest.best
    }

    /// What a ray in world space meets first of the placed meshes that `admits` does not leave aside, and of several at one
    /// distance the first of them. `shape` gives the triangles of a mesh that is shaped otherwise than its hierarchy, in object space and by number; its
    /// [`MeshRange::bounds`](crate::MeshRange::bounds) are to hold them. Time in proportion to instances.
    ///
    /// Placements that [`TopLevel`](crate::TopLevel) leaves out for want of an inverse are met by nothing.
    pub fn cast_at(
        &self,
        sources: &[InstanceSource],
        ray: &Ray,
        admits: impl Fn(&InstanceSource) -> bool,
        shape: impl Fn(usize) -> Option<Vec<[DVec3; 3]>>,
    ) -> Option<InstanceHit> {
        debug_assert!(sources.len() <= MAX_INDEX as usize);
        let mut ray = *ray;
        let mut best: Option<InstanceHit> = None;
        for (instance, source) in (0..).zip(sources).filter(|(_, source)| admits(source)) {
            let mesh = source.mesh as usize;
            let bounds = self.meshes.get(mesh).and_then(|range| range.bounds);
            let Some((bounds, (object_from_world, _))) =
                bounds.zip(inverse(&source.world_from_object))
            else {
                continue;
            };
            let in_object = ray.transformed(&object_from_world);
            let bounds = bounds.padded(PAD_UNITS);
            if in_object.enters(&bounds, in_object.t_max).is_none() {
                continue;
            }
            let hit = match shape(mesh) {
                Some(triangles) => cast_at_all(triangles, &in_object),
                None => self.cast(mesh, &in_object),
            };
            let is_before = |hit: &TriangleHit| best.is_none_or(|best| hit.t < best.hit.t);
            if let Some(hit) = hit.filter(is_before) {
                ray.t_max = hit.t;
                // Carried by the inverse's transpose, so that a mirrored front is the one that glTF means.
                let normal = object_from_world.matrix3.transpose() * hit.normal;
                best = Some(InstanceHit {
                    instance,
                    hit,
                    normal_in_world: normal.normalize_or_zero(),
                });
            }
        }
        best
    }
}
