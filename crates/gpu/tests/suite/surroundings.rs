//! The mean of the surroundings over a pixel.

use bytemuck::{Pod, Zeroable};
use glam::{DQuat, DVec3};
use stereolux_gpu::{GpuContext, Kernel, Resources, storage_buffer_with_data};

use crate::adapter::context;
use crate::trace_probe::{Random, ask, probe};

#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Query {
    direction: [f32; 4],
    across: [f32; 4],
    down: [f32; 4],
}

#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
struct Answer {
    mean: [f32; 3],
    through_center: f32,
}

/// An equirectangular map.
struct Map {
    size: [usize; 2],
    texels: Vec<f32>,
}

impl Map {
    fn of(size: [usize; 2], texel: impl Fn(usize, usize) -> f32) -> Self {
        let [width, height] = size;
        let texels = (0..width * height).map(|i| texel(i % width, i / width));
        Self {
            size,
            texels: texels.collect(),
        }
    }

    /// Its size and its levels, as the renderer packs them: sides are powers of two here.
    fn texels(&self) -> Vec<[f32; 4]> {
        let mut all: Vec<f32> = self.texels.clone();
        let mut level = self.texels.clone();
        let [mut width, mut height] = self.size;
        while width.min(height) > 1 {
            let coarser = (0..width * height / 4).map(|i| {
                let (x, y) = (2 * (i % (width / 2)), 2 * (i / (width / 2)));
                let at = |x, y| level[y * width + x];
                0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1))
            });
            level = coarser.collect();
            all.extend(&level);
            (width, height) = (width / 2, height / 2);
        }
        let size = self.size.map(|length| length as f32);
        let size = [size[0], size[1], 0.0, 0.0];
        [size]
            .into_iter()
            .chain(all.into_iter().map(|value| [value; 4]))
            .collect()
    }

    /// The unit direction that a place in texels is seen in.
    fn direction(&self, x: f64, y: f64) -> DVec3 {
        let [width, height] = self.size.map(|length| length as f64);
        let (phi, theta) = (
            std::f64::consts::TAU * (x / width - 0.5),
            std::f64::consts::PI * y / height,
        );
        let from_axis = theta.sin();
        DVec3::new(from_axis * phi.sin(), theta.cos(), -from_axis * phi.cos())
    }

    /// Radiance from a unit direction: the f64 twin of `environment_radiance`.
    fn radiance(&self, direction: DVec3) -> f64 {
        let [width, height] = self.size;
        let u = 0.5 + direction.x.atan2(-direction.z) / std::f64::consts::TAU;
        let v = direction.y.clamp(-1.0, 1.0).acos() / std::f64::consts::PI;
        let [x, y] = [u * width as f64 - 0.5, v * height as f64 - 0.5];
        let [fx, fy] = [x - x.floor(), y - y.floor()];
        let at = |dx: i64, dy: i64| {
            let column = (x.floor() as i64 + dx).rem_euclid(width as i64) as usize;
            let row = (y.floor() as i64 + dy).clamp(0, height as i64 - 1) as usize;
            f64::from(self.texels[row * width + column])
        };
        (at(0, 0) * (1.0 - fx) + at(1, 0) * fx) * (1.0 - fy)
            + (at(0, 1) * (1.0 - fx) + at(1, 1) * fx) * fy
    }
}

/// An eye of 90 by 90 degrees.
struct Eye {
    render_from_eye: DQuat,
    /// Pixels across and down.
    pixels: u32,
}

impl Eye {
    /// Direction, not of unit length, through a place in pixels.
    fn towards(&self, x: f64, y: f64) -> DVec3 {
        let tangent = |at: f64| 2.0 * at / f64::from(self.pixels) - 1.0;
        self.render_from_eye * DVec3::new(tangent(x), -tangent(y), -1.0)
    }

    fn queries(&self) -> Vec<Query> {
        let words = |v: DVec3| v.as_vec3().extend(0.0).to_array();
        let all = (0..self.pixels * self.pixels).map(|i| {
            let (x, y) = (f64::from(i % self.pixels), f64::from(i / self.pixels));
            let ahead = self.towards(x + 0.5, y + 0.5);
            let scale = 1.0 / ahead.length();
            Query {
                direction: words(scale * ahead),
                across: words(scale * (self.towards(x + 1.0, y + 0.5) - self.towards(x, y + 0.5))),
                down: words(scale * (self.towards(x + 0.5, y + 1.0) - self.towards(x + 0.5, y))),
            }
        });
        all.collect()
    }

    /// Where a direction is seen, in pixels: `towards` the other way round.
    fn place_of(&self, direction: DVec3) -> [f64; 2] {
        let ahead = self.render_from_eye.inverse() * direction;
        assert!(ahead.z < 0.0, "behind the eye");
        let half = 0.5 * f64::from(self.pixels);
        [
            half * (1.0 - ahead.x / ahead.z),
            half * (1.0 + ahead.y / ahead.z),
        ]
    }

    /// Pixels that see a rectangle of the map's texels (first and last place along either axis), and those beside them.
    fn pixels_around(&self, map: &Map, across: [f64; 2], down: [f64; 2]) -> Vec<u32> {
        let places = [0, 1, 2, 3].map(|corner| {
            let [x, y] = [across[corner % 2], down[corner / 2]];
            self.place_of(map.direction(x, y))
        });
        // Its sides bend by less than a hundredth of their length.
        let [columns, rows] = [0, 1].map(|axis| {
            let all = places.map(|place| place[axis]);
            let low = all.into_iter().fold(f64::INFINITY, f64::min) - 1.0;
            let high = all.into_iter().fold(0.0, f64::max) + 1.0;
            assert!(
                low >= 0.0 && high < f64::from(self.pixels),
                "outside the image"
            );
            low as u32..=high as u32
        });
        let in_row = |y: u32| columns.clone().map(move |x| y * self.pixels + x);
        rows.flat_map(in_row).collect()
    }

    /// The map's mean over a pixel, by `n` times `n` directions.
    fn mean(&self, map: &Map, pixel: u32, n: u32) -> f64 {
        let corner = [pixel % self.pixels, pixel / self.pixels].map(f64::from);
        let place = |i: u32| (f64::from(i) + 0.5) / f64::from(n);
        let all = (0..n * n).map(|i| {
            let [x, y] = [corner[0] + place(i % n), corner[1] + place(i / n)];
            map.radiance(self.towards(x, y).normalize())
        });
        all.sum::<f64>() / f64::from(n * n)
    }
}

fn seen(context: &GpuContext, kernel: &Kernel, map: &Map, eye: &Eye) -> Vec<Answer> {
    let texels = storage_buffer_with_data(context, "texels", &map.texels()).unwrap();
    let scene = Resources::new().with("environment_map", &texels);
    let queries = eye.queries();
    ask(context, kernel, &scene, &queries, queries.len())
}

fn kernel(context: &GpuContext) -> Kernel {
    let source = include_str!("surroundings_probe.wesl");
    probe(context, source, &["environment"])
}

fn turned(random: &mut Random) -> DQuat {
    let mut number = || 2.0 * random.unit() - 1.0;
    DQuat::from_xyzw(number(), number(), number(), number()).normalize()
}

#[test]
fn a_mean_over_a_pixel_has_the_light_of_all_directions_in_it() {
    let context = context();
    let kernel = kernel(&context);
    let mut random = Random(5);
    // Waves that are long beside a texel and a pixel, even around the poles.
    let wave = |[width, height]: [usize; 2]| {
        Map::of([width, height], |x, y| {
            let u = (x as f64 + 0.5) / width as f64 * std::f64::consts::TAU;
            let v = (y as f64 + 0.5) / height as f64 * std::f64::consts::PI;
            (2.0 + v.sin().powi(2) * (2.0 * u).cos()) as f32
        })
    };
    // Half a texel a pixel, about four, and so many that a coarser level is read. The map's second derivatives are at most 4,
    // all of them in kinks a texel apart while a pixel is less than one. Then a ray through the centre is off by a kink times an
    // eighth of the pixel at most, along either axis; a mean over texels by less than that with the pixel in the kink's place.
    // The middle of the texels' weights is off by up to 3 % of a texel while the head is rolled (waves as below, of the hat
    // alone), and slopes are 2.
    let pixel_rad = 2.0 / 40.0;
    for size in [[64, 32], [512, 256], [2048, 1024]] {
        let texel_rad = std::f64::consts::PI / size[1] as f64;
        let tolerance =
            2.0 * 4.0 * f64::max(texel_rad, pixel_rad) * pixel_rad / 8.0 + 2.0 * 0.03 * texel_rad;
        let map = wave(size);
        // The last one has a pole in the middle of a pixel.
        for turn in 0..5 {
            let eye = Eye {
                render_from_eye: match turn {
                    4 => DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2),
                    _ => turned(&mut random),
                },
                pixels: 40 + turn / 4,
            };
            for (pixel, answer) in (0..).zip(seen(&context, &kernel, &map, &eye)) {
                let wanted = eye.mean(&map, pixel, 4);
                let found = f64::from(answer.mean[0]);
                assert!(
                    (found - wanted).abs() <= tolerance,
                    "{size:?}, pixel {pixel}: {found}, not {wanted}"
                );
            }
        }
    }
}

#[test]
fn a_sun_smaller_than_a_pixel_keeps_its_light_wherever_it_falls() {
    let context = context();
    let kernel = kernel(&context);
    let mut random = Random(6);
    // A texel of 0.7 degrees, 60 degrees from the pole, in pixels of 1.4 to 2.9 degrees; and the same with texels half as wide,
    // which a coarser level holds.
    for (size, sun) in [([512, 256], 1), ([1024, 512], 2)] {
        let [width, height] = size;
        let lit = |at: usize, first: usize| (first..first + sun).contains(&at);
        let map = Map::of(size, |x, y| {
            f32::from(lit(x, width / 2) && lit(y, height / 3)) * 1000.0
        });
        let (mut ratios, mut centers) = (Vec::new(), Vec::new());
        for _ in 0..64 {
            // The sun 20 degrees from the axis at most, the head rolled in any way.
            let [yaw, pitch] = [0, 1].map(|_| 0.25 * (2.0 * random.unit() - 1.0));
            let roll = DQuat::from_rotation_z(7.0 * random.unit());
            let eye = Eye {
                render_from_eye: DQuat::from_rotation_y(yaw)
                    * DQuat::from_rotation_x(pitch + 0.5)
                    * roll,
                pixels: 40,
            };
            let answers = seen(&context, &kernel, &map, &eye);
            let sum = |of: &dyn Fn(&Answer) -> f32| answers.iter().map(|a| f64::from(of(a))).sum();
            // Between texels light falls off over one of them: half of that is beyond the lit texels' borders.
            let reach = |first: usize| [first as f64 - 0.5, (first + sun) as f64 + 0.5];
            let pixels = eye.pixels_around(&map, reach(width / 2), reach(height / 3));
            let means = pixels.into_iter().map(|pixel| eye.mean(&map, pixel, 24));
            let truth: f64 = means.sum();
            let found: f64 = sum(&|a| a.mean[0]);
            let center: f64 = sum(&|a| a.through_center);
            ratios.push(found / truth);
            centers.push(center / truth);
        }
        let statistics = |values: &[f64]| {
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let square = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
            (mean, (square / (values.len() - 1) as f64).sqrt())
        };
        let (mean, deviation) = statistics(&ratios);
        let error = deviation / (ratios.len() as f64).sqrt();
        // Weights of texels are divided by their sum, which ripples as the lattice of texels lies to the pixel. Rolled by 45
        // degrees its worst four waves have 1.41 of them a texel: box and hat leave sinc(1.41 e) sinc(1.41)^2, together
        // 0.042 / e at e texels a pixel, 2.4 of them at 28 degrees from the axis. Pixels differ by 8 % from one to the next
        // there, of which the sun, between two of them, shows less than a tenth.
        assert!(deviation < 0.0175, "{deviation}");
        assert!(
            (mean - 1.0).abs() <= 3.0 * error + 8e-3,
            "{mean} +- {error}"
        );
        // What the mean is for: a ray through the centre meets the sun or misses it.
        assert!(statistics(&centers).1 > 50.0 * deviation, "{centers:?}");
    }
}
