//! Rays that the host casts at what the renderer shows: what a hand points at, where a foot stands.

use std::ops::Range;

use glam::DVec3;

use super::{InstanceId, Renderer};
use crate::bvh::cast::Ray;

/// What a cast ray meets first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// The instance.
    pub instance: InstanceId,
    /// The scene node that places it; `None` for one of [`Renderer::add_instance`].
    pub node: Option<usize>,
    /// From the ray's origin.
    pub distance_m: f64,
    /// Where.
    pub point_in_world: DVec3,
    /// Unit normal of the triangle, on the side that the ray comes from.
    pub normal_in_world: DVec3,
    /// Whether that is the triangle's front.
    pub is_front: bool,
    /// Number of the triangle in [`crate::scene::Mesh::triangles`].
    pub triangle: u32,
    /// Weights of its three corners at the point; they sum to 1.
    pub barycentrics: [f64; 3],
}

impl Renderer {
    /// What a ray meets first within `max_distance_m` (may be infinite), from either side, in the scene as the renderer has been
    /// told of it by now ([`Renderer::apply_scene`], [`Renderer::animate`] and their like): whether or not a frame has shown
    /// it yet. What is hidden is not met. `direction` may have any length; `None` if it has none or something is not finite.
    ///
    /// The host does it in f64, with the hierarchies that the device traces through, so that it waits for nothing: a few
    /// microseconds, and some tens of nanoseconds for each instance. A skinned or morphed mesh is met in its present shape, by
    /// looking at all of its vertices if the ray meets its box. Materials do not count: alpha and glass are solid.
    #[must_use]
    pub fn cast_ray(
        &self,
        origin_in_world: DVec3,
        direction: DVec3,
        max_distance_m: f64,
    ) -> Option<RayHit> {
        self.cast_ray_past(&[], origin_in_world, direction, max_distance_m)
    }

    /// As [`Renderer::cast_ray`], without meeting what these nodes of the scene place.
    pub(crate) fn cast_ray_past(
        &self,
        nodes: &[Range<usize>],
        origin_in_world: DVec3,
        direction: DVec3,
        max_distance_m: f64,
    ) -> Option<RayHit> {
        let direction = direction.try_normalize()?;
        if !origin_in_world.is_finite() || max_distance_m.is_nan() {
            return None;
        }
        let ray = Ray {
            origin: origin_in_world,
            direction,
            t_max: max_distance_m,
        };
        let met = self.scene.cast_ray(&ray, nodes)?;
        let instance = InstanceId(met.instance);
        let is_front = met.normal_in_world.dot(direction) <= 0.0;
        Some(RayHit {
            instance,
            node: self.scene.node_of_instance(instance),
            distance_m: met.hit.t,
            point_in_world: origin_in_world + met.hit.t * direction,
            normal_in_world: met.normal_in_world * if is_front { 1.0 } else { -1.0 },
            is_front,
            triangle: met.hit.triangle,
            barycentrics: met.hit.weights,
        })
    }
}
