//! Statistics that tests of light transport compare by: what they accept and what they reject.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use stereolux_base::random;
use stereolux_images::images::{Image, ImageRgb};

#[path = "shared/block_statistics.rs"]
#[allow(dead_code)]
mod block_statistics;
#[path = "shared/chi_square.rs"]
#[allow(dead_code)]
mod chi_square;

use block_statistics::{BlockStatistics, block_means, mean_image, z_test};
use chi_square::{Sampled, integrate, p_value, sidak};

const SIDE: u32 = 64;

/// Numbers in [0, 1), others for each seed.
fn uniform(mut seed: u64) -> impl FnMut() -> f64 {
    // States that lie next to each other would give the same numbers, one place on.
    seed = random::bits(&mut seed);
    move || random::unit(&mut seed)
}

fn noise(seed: u64, level: f32) -> ImageRgb {
    let mut unit = uniform(seed);
    let pixels = (0..SIDE * SIDE)
        .map(|_| [0; 3].map(|_: i32| level * 2.0 * unit() as f32))
        .collect();
    Image::new(SIDE, SIDE, pixels).unwrap()
}

fn renders(first_seed: u64, level: f32) -> Vec<ImageRgb> {
    (0..32).map(|i| noise(first_seed + i, level)).collect()
}

#[test]
fn block_means_by_hand_with_smaller_blocks_at_the_border() {
    let image = Image::new(3, 2, (0..6).map(|i| [i as f32, 0.0, 1.0]).collect()).unwrap();
    // Rows 0 1 2 and 3 4 5: blocks of 2 are {0 1 3 4} and {2 5}.
    assert_eq!(block_means(&image, 2), [[2.0, 0.0, 1.0], [3.5, 0.0, 1.0]]);
    let error = Image::new(3, 2, vec![[0.5; 3]; 6]).unwrap();
    let found = BlockStatistics::of_mean_and_error(&image, &error, 2);
    assert_eq!(found.blocks, [2, 1]);
    // 0.5 / sqrt(4) and 0.5 / sqrt(2).
    assert!((found.standard_errors[0][0] - 0.25).abs() < 1e-12);
    assert!((found.standard_errors[1][2] - 0.5 / 2.0_f64.sqrt()).abs() < 1e-12);
}

#[test]
fn spread_of_renders_is_that_of_the_noise() {
    // Uniform in 0..2: variance 1/3 per pixel; 64 pixels per block, 32 renders. The estimate of one standard error
    // is off by about 1/sqrt(62); over 192 of them the mean is off by under 1 %, 5 % is generous.
    let found = BlockStatistics::of_renders(&renders(1, 1.0), 8);
    let expected = (1.0_f64 / 3.0 / 64.0 / 32.0).sqrt();
    let mean = found.standard_errors.iter().flatten().sum::<f64>() / 192.0;
    assert!((mean / expected - 1.0).abs() < 0.05, "{mean} {expected}");
}

#[test]
fn equal_expectations_pass_and_a_small_bias_fails() {
    let statistics = |seed, level| BlockStatistics::of_renders(&renders(seed, level), 8);
    let (a, b) = (statistics(1, 1.0), statistics(1000, 1.0));
    let same = z_test(&a, &b, 1e-3, 1e-6);
    assert_eq!((same.tests, same.rejected), (192, 0), "{same:?}");
    // Each at 1 - 0.999^(1/192) = 5.2110e-6, two-sided.
    assert!((same.z_limit - 4.5561).abs() < 1e-4, "{same:?}");
    assert!(same.mean_z.abs() < 4.0 / 192.0_f64.sqrt());
    assert_eq!(same.share_passed(), 1.0);
    // Negative control: 10 % brighter is 0.1 / (sqrt(2) 0.0128) = 5.5 standard errors in each block.
    let brighter = z_test(&statistics(2000, 1.1), &a, 1e-3, 1e-6);
    assert!(brighter.rejected > 96, "{brighter:?}");
    assert!(brighter.mean_z > 3.0);
    // Negative control: one wrong block of 64.
    let mut wrong = renders(3000, 1.0);
    for image in &mut wrong {
        for y in 8..16 {
            for x in 24..32 {
                image.pixels[y * SIDE as usize + x] = [1.2; 3];
            }
        }
    }
    let wrong = BlockStatistics::of_renders(&wrong, 8);
    let found = z_test(&wrong, &a, 1e-3, 1e-6);
    assert_eq!((found.rejected, found.worst_block), (3, (3, 1)));
}

#[test]
fn not_a_number_is_rejected() {
    let a = BlockStatistics::of_renders(&renders(1, 1.0), 8);
    let mut b = a.clone();
    b.means[7][1] = f64::NAN;
    let found = z_test(&a, &b, 0.01, 1e-6);
    assert_eq!((found.rejected, found.worst_block), (1, (7, 0)));
    assert_eq!(found.max_abs_z, f64::INFINITY);
}

#[test]
fn noiseless_blocks_may_differ_in_the_last_bit_only() {
    let plane = |value: f32| vec![Image::filled(16, 16, [value; 3]).unwrap(); 2];
    let of = |value| BlockStatistics::of_renders(&plane(value), 8);
    let z = |value| z_test(&of(value), &of(1.0), 0.01, 1e-6);
    assert_eq!(z(1.000_000_1).rejected, 0);
    assert_eq!(z(1.000_1).rejected, z(1.000_1).tests);
    assert_eq!(mean_image(&plane(0.3)), plane(0.3)[0]);
}

#[test]
fn uniform_points_pass_and_a_tilt_of_five_percent_fails() {
    let mut unit = uniform(11);
    let mut draw = || (unit(), unit());
    let [points, pilot] = [(); 2].map(|()| (0..400_000).map(|_| draw()).collect::<Vec<_>>());
    let sampled = Sampled::in_square(&points, points.len(), &pilot[..20_000]);
    assert!(p_value(&sampled, &|_, _| 1.0) > 1e-3);
    // It adds 400,000 x mean of (0.05 (2 x - 1))^2 = 333 to the statistic, 15 standard deviations at 239 degrees.
    assert!(p_value(&sampled, &|x, _| 0.95 + 0.1 * x) < 1e-6);
    // Draws that are lost must show.
    assert!(p_value(&sampled, &|_, _| 0.99) < 1e-6);
}

#[test]
fn densities_and_points_that_are_no_number_are_rejected() {
    let mut unit = uniform(12);
    let mut draw = || (unit(), unit());
    let pilot: Vec<_> = (0..4000).map(|_| draw()).collect();
    let mut points: Vec<_> = (0..20_000).map(|_| draw()).collect();
    let of = |points: &[(f64, f64)], density: &dyn Fn(f64, f64) -> f64| {
        p_value(&Sampled::in_square(points, points.len(), &pilot), density)
    };
    assert!(of(&points, &|_, _| 1.0) > 1e-3);
    assert_eq!(of(&points, &|_, _| f64::NAN), 0.0);
    assert_eq!(
        of(&points, &|x, _| if x < 0.1 { f64::NAN } else { 1.0 }),
        0.0
    );
    points[7].1 = f64::NAN;
    assert_eq!(of(&points, &|_, _| 1.0), 0.0);
}

#[test]
fn quadrature_resolves_a_narrow_peak() {
    let peak = |x: f64, y: f64| {
        let s = 0.01;
        (-((x - 0.3).powi(2) + (y - 0.6).powi(2)) / (2.0 * s * s)).exp()
            / (2.0 * std::f64::consts::PI * s * s)
    };
    let mut total = 0.0;
    for i in 0..8 {
        for j in 0..8 {
            let cell = |k: i32| [f64::from(k) / 8.0, f64::from(k + 1) / 8.0];
            total += integrate(&peak, cell(i), cell(j), 0);
        }
    }
    assert!((total - 1.0).abs() < 1e-4, "{total}");
}

#[test]
fn sidak_keeps_the_level_of_the_family() {
    assert!((sidak(0.01, 1) - 0.01).abs() < 1e-15);
    assert!((1.0 - (1.0 - sidak(0.01, 50)).powi(50) - 0.01).abs() < 1e-12);
}
