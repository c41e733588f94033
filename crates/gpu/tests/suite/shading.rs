//! What shading normals do to photons.

use std::f64::consts::{PI, TAU};

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use stereolux_gpu::Resources;

use crate::adapter::context;
use crate::trace_probe::{ask, probe};

/// As a single map has it; the probe's, too.
const MOST: f64 = 8.0;

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Query {
    geometric_normal: [f32; 4],
    shading_normal: [f32; 4],
    from_direction: [f32; 4],
    to_direction: [f32; 4],
}

/// Corrections by the device: where a photon from each direction goes on along `to`, and where it is gathered.
fn corrections(shading_normal: DVec3, from: &[DVec3], to: DVec3) -> Vec<[f32; 2]> {
    let context = context();
    let kernel = probe(&context, include_str!("shading_probe.wesl"), &[]);
    let words = |v: DVec3| v.as_vec3().extend(0.0).to_array();
    let queries: Vec<Query> = from
        .iter()
        .map(|from| Query {
            geometric_normal: words(DVec3::Z),
            shading_normal: words(shading_normal),
            from_direction: words(*from),
            to_direction: words(to),
        })
        .collect();
    ask(
        &context,
        &kernel,
        &Resources::new(),
        &queries,
        queries.len(),
    )
}

#[test]
fn a_photon_that_grazes_a_facet_is_raised_within_bounds_that_cost_the_light_said() {
    let (turns, heights) = (256, 512);
    for angle_deg in [20.0_f64, 45.0] {
        let tilt = angle_deg.to_radians();
        let normal = DVec3::new(tilt.sin(), 0.0, tilt.cos());
        // Even light, by azimuth and by the square root of the cosine: finest where it grazes.
        let step = 1.0 / f64::from(heights);
        let mut from = Vec::new();
        let mut photons = Vec::new();
        for index in 0..turns * heights {
            let azimuth = TAU * (f64::from(index / heights) + 0.5) / f64::from(turns);
            let root = (f64::from(index % heights) + 0.5) * step;
            let z = root * root;
            let (y, x) = azimuth.sin_cos();
            let direction = DVec3::new(0.0, 0.0, z) + (1.0 - z * z).sqrt() * DVec3::new(x, y, 0.0);
            if direction.dot(normal) > 0.0 {
                from.push(direction);
                // As many photons arrive as the facet's cosine says.
                photons.push(z * 2.0 * root * step * TAU / f64::from(turns));
            }
        }
        let to = DVec3::new(0.2, 0.3, 1.0).normalize();
        let found = corrections(normal, &from, to);
        let mut light = 0.0;
        for ((from, photons), found) in from.iter().zip(&photons).zip(&found) {
            let gathered = from.dot(normal) / from.z;
            let going_on = gathered * to.z / to.dot(normal);
            // Cosines are within 2e-7; a ratio of them is off by that over the smaller one.
            for (found, due) in found.iter().zip([going_on, gathered]) {
                let tolerance = 1e-6 + 4e-7 / f64::min(from.z, from.dot(normal));
                let due = due.min(MOST);
                assert!(
                    (f64::from(*found) / due - 1.0).abs() < tolerance,
                    "{from}: {found:?}, {due}"
                );
            }
            light += f64::from(found[1]) * photons;
        }
        // Without a bound it is the light of the lune above both planes. What the bound takes is to first order in 1 / MOST;
        // the next one is 1 / MOST^2 of the light or less.
        let all = 0.5 * PI * (1.0 + tilt.cos());
        let said = PI * tilt.sin().powi(2) / (4.0 * MOST);
        let taken = all - light;
        assert!(
            (taken - said).abs() < all / (MOST * MOST),
            "{taken} of {all}, {said} said"
        );
        assert!(taken > 0.5 * said, "nothing is bounded: {taken}");
    }
}
