//! What emissive triangles shine with on average, maps of emission included.

use super::super::textures::sample_image;
use super::{NO_EMITTER, emitter_ordinals};
use crate::scene::{Mesh, Scene};

/// A textured emitter is sampled at most this finely, per edge.
const MOST_STEPS: usize = 64;
/// What an emitter's power is at least: as a share of its brightest sample, and of what it had if it covered all.
const LEAST_SHARE: f64 = 0.01;

/// Mean emission of a triangle, times its alpha factor, and by how much its pick is raised above its power so that no glowing
/// spot is missed.
pub(super) struct Glow {
    pub(super) triangle: usize,
    pub(super) mean: [f64; 3],
    pub(super) boost: f64,
    pub(super) double_sided: bool,
}

/// What a white surface would have as radiance, if the power of all emissive triangles were spread evenly over all surfaces,
/// W sr^-1 m^-2, mean of the channels: sum of L A over sum of A. What shines counts as it stands at rest.
pub fn mean_glow(scene: &Scene) -> f64 {
    let glows = scene.meshes.iter().map(|mesh| mesh_glows(scene, mesh));
    let glows: Vec<_> = glows.collect();
    let mut emitted = 0.0;
    let rest = scene.rest_pose();
    for instance in scene.instances() {
        if glows[instance.mesh].is_empty() {
            continue;
        }
        let mesh = &scene.meshes[instance.mesh];
        let positions = scene.positions_in_world(instance.node, mesh, &rest);
        let area = |triangle: &crate::scene::MeshTriangle| {
            let [a, b, c] = triangle.vertices.map(|vertex| positions[vertex as usize]);
            0.5 * (b - a).cross(c - a).length()
        };
        for glow in &glows[instance.mesh] {
            let radiance = glow.mean.iter().sum::<f64>() / 3.0;
            emitted += radiance * glow.sides() * area(&mesh.triangles[glow.triangle]);
        }
    }
    // Without a surface nothing is emitted.
    if emitted > 0.0 {
        emitted / scene.surface_area_m2()
    } else {
        0.0
    }
}

impl Glow {
    /// How many sides shine.
    pub(super) fn sides(&self) -> f64 {
        if self.double_sided { 2.0 } else { 1.0 }
    }
}

pub(super) fn mesh_glows(scene: &Scene, mesh: &Mesh) -> Vec<Glow> {
    let ordinals = emitter_ordinals(scene, mesh);
    (0..mesh.triangles.len())
        .filter(|triangle| ordinals[*triangle] != NO_EMITTER)
        .map(|triangle| glow_of(scene, mesh, triangle))
        .collect()
}

/// Mean of the emissive texture over the triangle, by a barycentric grid about as fine as the texels. A triangle that
/// the grid finds dark or dim keeps a share of the brightest sample: glow between the samples is then still picked.
pub(super) fn glow_of(scene: &Scene, mesh: &Mesh, triangle: usize) -> Glow {
    let corners = mesh.triangles[triangle].vertices;
    let material = &scene.materials[mesh.triangles[triangle].material as usize];
    // Alpha maps are left out; and no lamp is too thin to be picked.
    let coverage = f64::from(material.coverage()).max(LEAST_SHARE);
    let factor = material.emission;
    let factor = factor.map(|channel| coverage * f64::from(channel.max(0.0)));
    let mut glow = Glow {
        triangle,
        mean: factor,
        boost: 1.0,
        double_sided: material.double_sided,
    };
    let Some(reference) = material.emissive_texture else {
        return glow;
    };
    let uv_set = if reference.uv_set == 1 {
        &mesh.uv1
    } else {
        &mesh.uv0
    };
    let m = reference.texcoord_from_uv.map(f64::from);
    let texcoords = corners.map(|vertex| {
        let [u, v] = uv_set
            .get(vertex as usize)
            .copied()
            .unwrap_or_default()
            .map(f64::from);
        [m[0] * u + m[1] * v + m[2], m[3] * u + m[4] * v + m[5]]
    });
    let image = scene
        .textures
        .get(reference.texture as usize)
        .and_then(|texture| scene.images.get(texture.image as usize));
    let size = image.map_or([1.0; 2], |image| {
        [f64::from(image.width), f64::from(image.height)]
    });
    let reach = |a: usize, b: usize| -> f64 {
        (0..2)
            .map(|axis| ((texcoords[a][axis] - texcoords[b][axis]) * size[axis]).abs())
            .fold(0.0, f64::max)
    };
    let texels = reach(0, 1).max(reach(1, 2)).max(reach(2, 0));
    // `as` saturates; NaN gives 0.
    let steps = (texels.ceil() as usize).clamp(1, MOST_STEPS);
    let is_coarse = texels > MOST_STEPS as f64;
    let (mut sum, mut brightest, mut count) = ([0.0; 3], 0.0f64, 0.0);
    let mut add = |first: f64, second: f64, weight: f64| {
        let third = 1.0 - first - second;
        let at = std::array::from_fn(|axis| {
            first * texcoords[0][axis] + second * texcoords[1][axis] + third * texcoords[2][axis]
        });
        let texel = sample_image(scene, reference.texture, at, true);
        let mut level = 0.0;
        for channel in 0..3 {
            sum[channel] += weight * texel[channel];
            level += texel[channel] * factor[channel] / 3.0;
        }
        brightest = brightest.max(level);
        count += weight;
    };
    let step = 1.0 / steps as f64;
    for row in 0..steps {
        for column in 0..steps - row {
            // Centroids of the upright and of the inverted small triangles.
            add(
                (row as f64 + 1.0 / 3.0) * step,
                (column as f64 + 1.0 / 3.0) * step,
                1.0,
            );
            if column + 1 < steps - row {
                add(
                    (row as f64 + 2.0 / 3.0) * step,
                    (column as f64 + 2.0 / 3.0) * step,
                    1.0,
                );
            }
        }
    }
    // Corners too: where only they touch what glows, the centroids may all be dark.
    let mean_level = |mean: &[f64; 3]| (0..3).map(|channel| mean[channel]).sum::<f64>() / 3.0;
    for corner in [(1.0, 0.0), (0.0, 1.0), (0.0, 0.0)] {
        add(corner.0, corner.1, 0.0);
    }
    let mean: [f64; 3] = std::array::from_fn(|channel| factor[channel] * sum[channel] / count);
    if is_coarse {
        brightest = brightest.max(mean_level(&factor) * LEAST_SHARE);
    }
    let level = mean_level(&mean);
    let floor = brightest * LEAST_SHARE;
    if level < floor {
        // A dark triangle has no power to raise: lend it the floor.
        glow.boost = if level > 0.0 { floor / level } else { 1.0 };
        glow.mean = if level > 0.0 {
            mean
        } else {
            factor.map(|channel| channel * LEAST_SHARE * LEAST_SHARE)
        };
    } else {
        glow.mean = mean;
    }
    glow
}
