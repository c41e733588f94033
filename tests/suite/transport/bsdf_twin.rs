//! The scattering model in f64, written from the formulas' textbook form, and the shaders held against it.

use std::f64::consts::PI;

use glam::DVec3;
use stereolux::scene::Material;

use super::bsdf_probe::{BACK, BsdfProbe, BsdfQuery, PHOTONS, wide};
use super::support::context;

/// A material without textures, seen from one side.
#[derive(Clone, Debug)]
pub struct Twin {
    base: [f64; 3],
    metallic: f64,
    /// 0 for smooth.
    alpha: f64,
    transmission: f64,
    f0: [f64; 3],
    f90: f64,
    eta: f64,
    glass_alpha: f64,
    is_thin: bool,
    for_photons: bool,
}

fn max3(v: [f64; 3]) -> f64 {
    v[0].max(v[1]).max(v[2])
}

/// Fresnel by the angles (Born and Wolf, section 1.5.2).
pub fn fresnel(cosine: f64, eta: f64) -> f64 {
    let sine = (1.0 - cosine * cosine).max(0.0).sqrt() / eta;
    if sine >= 1.0 {
        return 1.0;
    }
    let beyond = (1.0 - sine * sine).sqrt();
    let s = (cosine - eta * beyond) / (cosine + eta * beyond);
    let p = (beyond - eta * cosine) / (beyond + eta * cosine);
    0.5 * (s * s + p * p)
}

fn distribution(m: DVec3, alpha: f64) -> f64 {
    if m.z <= 0.0 {
        return 0.0;
    }
    let tan2 = (m.x * m.x + m.y * m.y) / (m.z * m.z);
    let bracket = 1.0 + tan2 / (alpha * alpha);
    1.0 / (PI * alpha * alpha * m.z.powi(4) * bracket * bracket)
}

fn lambda(v: DVec3, alpha: f64) -> f64 {
    let tan2 = (v.x * v.x + v.y * v.y) / (v.z * v.z);
    0.5 * ((1.0 + alpha * alpha * tan2).sqrt() - 1.0)
}

fn visible(wo: DVec3, m: DVec3, alpha: f64) -> f64 {
    distribution(m, alpha) * wo.dot(m).max(0.0) / ((1.0 + lambda(wo, alpha)) * wo.z)
}

/// Reflection by microfacets that reflect all; 0 where they are smooth.
fn microfacets(wo: DVec3, wi: DVec3, alpha: f64) -> f64 {
    if alpha == 0.0 {
        return 0.0;
    }
    let masking = 1.0 / (1.0 + lambda(wo, alpha) + lambda(wi, alpha));
    distribution((wo + wi).normalize(), alpha) * masking / (4.0 * wo.z * wi.z)
}

/// Density of directions that they reflect to.
fn mirrored(wo: DVec3, wi: DVec3, alpha: f64) -> f64 {
    let h = (wo + wi).normalize();
    if alpha > 0.0 {
        visible(wo, h, alpha) / (4.0 * wo.dot(h))
    } else {
        0.0
    }
}

impl Twin {
    pub fn new(material: &Material, flags: u32) -> Self {
        let wide3 = |v: [f32; 3]| v.map(f64::from);
        let [r, g, b, _] = material.base_color;
        let rough = f64::from(material.roughness).powi(2);
        let alpha = if rough < 1e-3 { 0.0 } else { rough };
        let ior = f64::from(material.ior);
        let specular = f64::from(material.specular);
        let ratio = ((ior - 1.0) / (ior + 1.0)).powi(2);
        let is_thin = material.is_thin_wall();
        let eta = if flags & BACK == 0 || is_thin {
            ior
        } else {
            1.0 / ior
        };
        Self {
            base: wide3([r, g, b]),
            metallic: f64::from(material.metallic),
            alpha,
            transmission: f64::from(material.transmission),
            f0: wide3(material.specular_color).map(|tint| (ratio * tint).min(1.0) * specular),
            f90: specular,
            eta,
            glass_alpha: if !is_thin && (eta - 1.0).abs() < 1e-3 {
                0.0
            } else {
                alpha
            },
            is_thin,
            for_photons: flags & PHOTONS != 0,
        }
    }

    fn glass(&self) -> f64 {
        (1.0 - self.metallic) * self.transmission
    }

    fn opaque(&self) -> f64 {
        (1.0 - self.metallic) * (1.0 - self.transmission)
    }

    fn layer(&self, cosine: f64) -> [f64; 3] {
        let schlick = (1.0 - cosine.clamp(0.0, 1.0)).powi(5);
        self.f0.map(|f0| f0 + (self.f90 - f0) * schlick)
    }

    /// All of the opaque lobes' F(v.h): the layer's share and the metal's.
    pub fn specular_reflectance(&self, cosine: f64) -> [f64; 3] {
        let schlick = (1.0 - cosine.clamp(0.0, 1.0)).powi(5);
        let layer = self.layer(cosine);
        std::array::from_fn(|c| {
            let metal = self.base[c] + (1.0 - self.base[c]) * schlick;
            self.opaque() * layer[c] + self.metallic * metal
        })
    }

    /// Half vector of refraction and |dm / dwi|; none where no microfacet joins the two.
    fn refraction(&self, wo: DVec3, wi: DVec3) -> Option<(DVec3, f64)> {
        let m = (wo + wi * self.eta).normalize();
        let m = if m.z < 0.0 { -m } else { m };
        if wo.dot(m) <= 0.0 || wi.dot(m) >= 0.0 {
            return None;
        }
        // Walter et al. 2007, eq. 17, with indices 1 on the side of wo and eta beyond.
        let denominator = wo.dot(m) + self.eta * wi.dot(m);
        let jacobian = self.eta * self.eta * wi.dot(m).abs() / (denominator * denominator);
        Some((m, jacobian))
    }

    pub fn eval(&self, wo: DVec3, wi: DVec3) -> [f64; 3] {
        if wo.z <= 0.0 || wi.z == 0.0 {
            return [0.0; 3];
        }
        if wi.z < 0.0 && self.is_thin {
            // KHR_materials_transmission: the lobe of what is mirrored, on the other side.
            let wi = DVec3::new(wi.x, wi.y, -wi.z);
            let passed = 1.0 - fresnel(wo.dot((wo + wi).normalize()), self.eta);
            let f = self.glass() * passed * microfacets(wo, wi, self.glass_alpha);
            return self.base.map(|tint| tint * f);
        }
        if wi.z < 0.0 {
            let alpha = self.glass_alpha;
            let Some((m, jacobian)) = self.refraction(wo, wi).filter(|_| alpha > 0.0) else {
                return [0.0; 3];
            };
            let masking = 1.0 / (1.0 + lambda(wo, alpha) + lambda(wi, alpha));
            let passed = 1.0 - fresnel(wo.dot(m), self.eta);
            let lobe = distribution(m, alpha) * masking * jacobian * wo.dot(m);
            let mut f = self.glass() * passed * lobe / (wo.z * wi.z.abs());
            if !self.for_photons {
                f /= self.eta * self.eta;
            }
            return self.base.map(|tint| tint * f);
        }
        let h = (wo + wi).normalize();
        let cosine = wo.dot(h);
        let lost = max3(self.layer(cosine));
        let specular = self.specular_reflectance(cosine);
        std::array::from_fn(|c| {
            self.opaque() * self.base[c] / PI * (1.0 - lost)
                + specular[c] * microfacets(wo, wi, self.alpha)
                + self.glass() * fresnel(cosine, self.eta) * microfacets(wo, wi, self.glass_alpha)
        })
    }

    /// Shares of the lobes, as the sampler chooses them.
    fn lobes(&self, wo: DVec3) -> [f64; 3] {
        let diffuse = self.opaque() * max3(self.base) * (1.0 - max3(self.f0));
        let lobes = [diffuse, max3(self.specular_reflectance(wo.z)), self.glass()];
        let total: f64 = lobes.iter().sum();
        lobes.map(|lobe| if total > 0.0 { lobe / total } else { 0.0 })
    }

    pub fn pdf(&self, wo: DVec3, wi: DVec3) -> f64 {
        if wo.z <= 0.0 || wi.z == 0.0 {
            return 0.0;
        }
        let lobes = self.lobes(wo);
        if wi.z < 0.0 {
            if self.glass_alpha == 0.0 {
                return 0.0;
            }
            if self.is_thin {
                let wi = DVec3::new(wi.x, wi.y, -wi.z);
                let passed = 1.0 - fresnel(wo.z, self.eta);
                return lobes[2] * passed * mirrored(wo, wi, self.glass_alpha);
            }
            return self.refraction(wo, wi).map_or(0.0, |(m, jacobian)| {
                let passed = 1.0 - fresnel(wo.dot(m), self.eta);
                lobes[2] * passed * visible(wo, m, self.glass_alpha) * jacobian
            });
        }
        // A pane is mirror or window before a normal is drawn.
        let cosine = if self.is_thin {
            wo.z
        } else {
            wo.dot((wo + wi).normalize())
        };
        let reflectance = fresnel(cosine, self.eta);
        lobes[0] * wi.z / PI
            + lobes[1] * mirrored(wo, wi, self.alpha)
            + lobes[2] * reflectance * mirrored(wo, wi, self.glass_alpha)
    }
}

/// A direction by its cosine with the normal and its azimuth.
pub fn direction(z: f64, phi: f64) -> DVec3 {
    let r = (1.0 - z * z).max(0.0).sqrt();
    DVec3::new(r * phi.cos(), r * phi.sin(), z)
}

/// Seeded random directions and materials.
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        stereolux_base::random::unit(&mut self.0)
    }

    /// Uniform direction, with z above or (if `both`) anywhere but on the horizon.
    pub fn direction(&mut self, both: bool) -> [f32; 3] {
        let z = 1.0 - self.unit() * 0.9999;
        let z = if both && self.unit() < 0.5 { -z } else { z };
        let phi = 2.0 * PI * self.unit();
        direction(z, phi).as_vec3().to_array()
    }

    /// A material of the glTF model; some factors at their ends.
    pub fn material(&mut self) -> Material {
        let mut edge = |least: f64| {
            let u = 3.0 * self.unit() - 1.0;
            u.clamp(least, 1.0) as f32
        };
        Material {
            base_color: [edge(0.0), edge(0.0), edge(0.0), 1.0],
            metallic: edge(0.0),
            roughness: edge(0.04),
            specular: edge(0.0),
            specular_color: [edge(0.0) * 2.0, edge(0.0), edge(0.0)],
            transmission: edge(0.0),
            ior: 1.0 + edge(0.05),
            ..Material::default()
        }
    }
}

/// Bound on the error of the shader's value at f32's rounding unit u = 2^-24, as a share of the value's largest channel.
///
/// Its first steps (the half vector, dot products) act like inputs that are off by a few u: 6 u per coordinate covers
/// unit length, the sum, its normalisation and the dot products. How much that changes the value is asked of the twin,
/// coordinate by coordinate. Some 40 later operations add u each.
pub fn tolerance(value: &dyn Fn(DVec3, DVec3) -> f64, wo: DVec3, wi: DVec3) -> f64 {
    let u = 0.5f64.powi(24);
    let here = value(wo, wi);
    let mut change = 0.0;
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        let step = 6.0 * u * axis;
        for (o, i) in [(step, DVec3::ZERO), (DVec3::ZERO, step)] {
            let there = (value(wo + o, wi + i) - here).abs();
            change += there.max((value(wo - o, wi - i) - here).abs());
        }
    }
    change + 40.0 * u * here.abs()
}

fn compare(on: &[&str], materials: &[Material], is_glass_on: bool) -> f64 {
    let context = context();
    let probe = BsdfProbe::embedded(&context, on, materials);
    let mut dice = Dice::new(7);
    let random = |index: usize| {
        let wo = dice.direction(false);
        BsdfQuery::pair(
            wo,
            index / 64,
            dice.direction(is_glass_on),
            index as u32 % 4,
        )
    };
    let queries: Vec<BsdfQuery> = (0..materials.len() * 64).map(random).collect();
    let answers = probe.evaluate(&queries);
    let mut worst: f64 = 0.0;
    let mut compared = 0;
    for (query, answer) in queries.iter().zip(&answers) {
        let twin = Twin::new(&materials[query.material as usize], query.flags);
        let (wo, wi) = (wide(query.wo), wide(query.wi));
        let (wo, wi) = (wo.normalize(), wi.normalize());
        // At the rim of what refracts and at the critical angle a rounding decides between 0 and a value.
        if wi.z < 0.0 {
            let sum = wo + wi * twin.eta;
            let m = sum.normalize() * sum.z.signum();
            if (wo.dot(m).abs()).min(wi.dot(m).abs()) < 1e-3 {
                continue;
            }
        }
        let expected = twin.eval(wo, wi);
        for (channel, due) in expected.iter().enumerate() {
            let allowed = tolerance(&|o, i| twin.eval(o, i)[channel], wo, wi) + 1e-30;
            let error = (f64::from(answer.value[channel]) - due).abs();
            let material = &materials[query.material as usize];
            let what = format!("{answer:?}, {due} is due for {query:?} of {material:?}");
            assert!(error <= allowed, "off by {error:e} of {allowed:e}: {what}");
            if *due > 1e-6 {
                worst = worst.max(error / allowed);
            }
        }
        let density = twin.pdf(wo, wi);
        let allowed = tolerance(&|o, i| twin.pdf(o, i), wo, wi) + 1e-30;
        let error = (f64::from(answer.pdf) - density).abs();
        let what = format!("{answer:?}, {density} is due for {query:?}");
        assert!(error <= allowed, "density off by {error:e}: {what}");
        compared += 1;
    }
    assert!(compared > queries.len() / 2, "only {compared} comparisons");
    worst
}

#[test]
fn shaders_equal_the_f64_twin() {
    let mut dice = Dice::new(1);
    let material = |index: usize| Material {
        is_open: index.is_multiple_of(3),
        ..dice.material()
    };
    let materials: Vec<Material> = (0..400).map(material).collect();
    let worst = compare(&["glossy", "dielectric", "thin_walls"], &materials, true);
    // A bound a hundred times too wide would prove nothing.
    assert!(
        worst > 0.01,
        "{worst} of the tolerance is all that is needed"
    );
}

#[test]
fn specialised_shaders_equal_the_twin_on_what_they_keep() {
    let mut dice = Dice::new(2);
    let mut materials = |count: usize, change: fn(&mut Material)| -> Vec<Material> {
        let mut all: Vec<Material> = (0..count).map(|_| dice.material()).collect();
        all.iter_mut().for_each(change);
        all
    };
    let opaque = materials(100, |m| m.transmission = 0.0);
    compare(&["glossy"], &opaque, false);
    let glass = materials(100, |m| (m.metallic, m.specular) = (0.0, 0.0));
    compare(&["dielectric"], &glass, true);
    let lambert = materials(20, |m| {
        (m.transmission, m.metallic, m.specular) = (0.0, 0.0, 0.0);
    });
    compare(&[], &lambert, false);
}

#[test]
fn the_comparison_notices_a_wrong_model() {
    let mut dice = Dice::new(3);
    let material = Material {
        metallic: 1.0,
        roughness: 0.5,
        ..dice.material()
    };
    let (wo, wi) = (dice.direction(false), dice.direction(false));
    let twin = Twin::new(&material, 0);
    let other = Material {
        roughness: 0.505,
        ..material
    };
    let other = Twin::new(&other, 0);
    let (wo, wi) = (wide(wo).normalize(), wide(wi).normalize());
    let change = (twin.eval(wo, wi)[0] - other.eval(wo, wi)[0]).abs();
    let allowed = tolerance(&|o, i| twin.eval(o, i)[0], wo, wi);
    assert!(change > 10.0 * allowed, "changes the value by {change:e}");
}

/// Queries, and values for them and for the same light's way back.
fn there_and_back<'a>(
    probe: &BsdfProbe<'_>,
    pairs: &'a [BsdfQuery],
    turned: impl Fn(&BsdfQuery) -> BsdfQuery,
) -> impl Iterator<Item = (&'a BsdfQuery, [f64; 3], [f64; 3])> {
    let there = probe.evaluate(pairs).into_iter();
    let back = probe.evaluate(&pairs.iter().map(turned).collect::<Vec<_>>());
    let values = there
        .zip(back)
        .map(|both| [both.0, both.1].map(|a| a.value.map(f64::from)));
    pairs
        .iter()
        .zip(values)
        .map(|(query, [there, back])| (query, there, back))
}

#[test]
fn reflection_is_reciprocal() {
    let context = context();
    let mut dice = Dice::new(4);
    let materials: Vec<Material> = (0..200)
        .map(|_| Material {
            roughness: 0.04 + 0.96 * dice.unit() as f32,
            ..dice.material()
        })
        .collect();
    let probe = BsdfProbe::embedded(
        &context,
        &["glossy", "dielectric", "thin_walls"],
        &materials,
    );
    let random = |index: usize| {
        let wo = dice.direction(false);
        BsdfQuery::pair(wo, index / 50, dice.direction(false), 0)
    };
    let pairs: Vec<BsdfQuery> = (0..materials.len() * 50).map(random).collect();
    let turned = |q: &BsdfQuery| BsdfQuery::pair(q.wi, q.material as usize, q.wo, 0);
    for (query, there, back) in there_and_back(&probe, &pairs, turned) {
        let largest = max3(there);
        for (a, b) in there.into_iter().zip(back) {
            let off = (a - b).abs();
            assert!(off <= 1e-4 * largest, "{query:?}: {a} there, {b} back");
        }
    }
}

/// Through glass f(wi -> wo) / eta_o^2 = f(wo -> wi) / eta_i^2 (Veach 1997, eq. 5.14), here with wo in air.
#[test]
fn refraction_obeys_the_generalised_reciprocity() {
    let context = context();
    let material = Material {
        metallic: 0.0,
        transmission: 1.0,
        roughness: 0.6,
        ..Material::lambert("glass", [1.0; 3])
    };
    let eta2 = f64::from(material.ior).powi(2);
    let probe = BsdfProbe::embedded(&context, &["dielectric"], &[material]);
    let mut dice = Dice::new(5);
    // From the other side the frame is turned over: z changes its sign.
    let over = |v: [f32; 3]| [v[0], v[1], -v[2]];
    let random = |_| {
        let wi = over(dice.direction(false));
        BsdfQuery::pair(dice.direction(false), 0, wi, 0)
    };
    let pairs: Vec<BsdfQuery> = (0..2000).map(random).collect();
    let turned = |q: &BsdfQuery| BsdfQuery::pair(over(q.wi), 0, over(q.wo), BACK);
    let mut seen = 0;
    for (query, there, back) in there_and_back(&probe, &pairs, turned) {
        let (a, b) = (there[0] * eta2, back[0]);
        let (wo, wi) = (wide(query.wo), wide(query.wi));
        let m = (wo + wi * 1.5).normalize();
        let cosine = wo.dot(m).abs().min(wi.dot(m).abs());
        if cosine < 1e-2 || a == 0.0 {
            continue;
        }
        seen += 1;
        // One side has its cosine from 1 - sin^2 eta^2, eight roundings of about 1; what Fresnel lets through goes with it.
        let rounding = 8.0 / f64::from(1 << 24) / (2.0 * cosine * cosine);
        let most = (1e-4 + rounding) * a.max(b);
        assert!((a - b).abs() <= most, "{query:?}: {a} there, {b} back");
    }
    assert!(seen > 200);
}
