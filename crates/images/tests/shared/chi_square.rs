//! Chi-square test of samples against a density over two coordinates.

use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Bins along the first and the second coordinate.
const BANDS: usize = 20;
const CELLS: usize = 12;
/// Bins that expect fewer samples than this are pooled (Cochran 1954).
const LEAST_EXPECTED: f64 = 5.0;

/// Level for each of `tests` tests such that all together reject a right sampler with probability `level` (Sidak 1967).
pub fn sidak(level: f64, tests: usize) -> f64 {
    1.0 - (1.0 - level).powf(1.0 / tests as f64)
}

/// Samples of a density whose integral may be below 1: the rest are draws without a sample.
pub struct Sampled<'a> {
    /// Coordinates of every sample.
    pub points: &'a [(f64, f64)],
    /// Draws, with those that gave no sample.
    pub draws: usize,
    /// Draws of the same sampler with another seed: they place the bins, so that narrow lobes get narrow bins.
    pub pilot: &'a [(f64, f64)],
    /// Range of each coordinate.
    pub domain: [(f64, f64); 2],
    /// Values of the first coordinate where the density may jump.
    pub breaks: &'a [f64],
}

impl<'a> Sampled<'a> {
    /// Directions by their z and azimuth.
    pub fn on_sphere(
        points: &'a [(f64, f64)],
        draws: usize,
        pilot: &'a [(f64, f64)],
        breaks: &'a [f64],
    ) -> Self {
        let pi = std::f64::consts::PI;
        Self {
            points,
            draws,
            pilot,
            domain: [(-1.0, 1.0), (-pi, pi)],
            breaks,
        }
    }

    /// Places in the unit square.
    pub fn in_square(points: &'a [(f64, f64)], draws: usize, pilot: &'a [(f64, f64)]) -> Self {
        Self {
            points,
            draws,
            pilot,
            domain: [(0.0, 1.0); 2],
            breaks: &[],
        }
    }
}

/// p-value of the hypothesis that counts have these expectations: `(expected, observed)` per bin.
pub fn p_value_of_counts(counts: &[(f64, f64)]) -> f64 {
    let finite = |count: &(f64, f64)| count.0.is_finite() && count.1.is_finite();
    if !counts.iter().all(finite) {
        return 0.0;
    }
    let (mut statistic, mut bins) = (0.0, 0usize);
    let (mut pooled_expected, mut pooled_observed) = (0.0, 0.0);
    for (expected, observed) in counts {
        if *expected >= LEAST_EXPECTED {
            statistic += (observed - expected).powi(2) / expected;
            bins += 1;
        } else {
            pooled_expected += expected;
            pooled_observed += observed;
        }
    }
    // What a probability of 0 forbids must not happen.
    if pooled_expected < 1e-3 && pooled_observed > 0.0 {
        return 0.0;
    }
    if pooled_expected >= LEAST_EXPECTED {
        statistic += (pooled_observed - pooled_expected).powi(2) / pooled_expected;
        bins += 1;
    }
    if bins < 2 {
        return 1.0;
    }
    1.0 - ChiSquared::new((bins - 1) as f64)
        .expect("degrees of freedom")
        .cdf(statistic)
}

/// p-value of the hypothesis that the points follow `density` (per unit of both coordinates).
pub fn p_value(sampled: &Sampled<'_>, density: &dyn Fn(f64, f64) -> f64) -> f64 {
    let draws = sampled.draws as f64;
    if !sampled
        .points
        .iter()
        .all(|p| p.0.is_finite() && p.1.is_finite())
    {
        return 0.0;
    }
    let mut counts = Vec::new();
    let mut inside = 0.0;
    let edges = quantiles(
        sampled.pilot.iter().map(|p| p.0).collect(),
        BANDS,
        sampled.domain[0],
        sampled.breaks,
    );
    for band in edges.windows(2) {
        let within = |x: f64| x >= band[0] && (x < band[1] || band[1] == sampled.domain[0].1);
        let pilot = sampled.pilot.iter().filter(|p| within(p.0));
        let pilot = pilot.map(|p| p.1).collect();
        let cells = quantiles(pilot, CELLS, sampled.domain[1], &[]);
        let mut observed = vec![0.0; cells.len() - 1];
        for point in sampled.points.iter().filter(|p| within(p.0)) {
            let above = cells.partition_point(|edge| *edge <= point.1);
            let cell = above.clamp(1, observed.len()) - 1;
            observed[cell] += 1.0;
        }
        for (cell, count) in cells.windows(2).zip(observed) {
            let mass = integrate(density, [band[0], band[1]], [cell[0], cell[1]], 0);
            inside += mass;
            counts.push((mass * draws, count));
        }
    }
    // An integral of 1 within the quadrature's error leaves no bin for lost draws.
    let lost = draws - sampled.points.len() as f64;
    let expected_lost = (1.0 - inside).max(0.0) * draws;
    if lost > 0.0 || expected_lost > 1e-4 * draws {
        counts.push((expected_lost, lost));
    }
    p_value_of_counts(&counts)
}

fn quantiles(mut values: Vec<f64>, count: usize, range: (f64, f64), breaks: &[f64]) -> Vec<f64> {
    values.sort_by(f64::total_cmp);
    let mut edges = vec![range.0, range.1];
    let inside = breaks.iter().filter(|x| **x > range.0 && **x < range.1);
    edges.extend(inside);
    if values.len() >= 20 * count {
        edges.extend((1..count).map(|i| values[i * values.len() / count]));
    }
    edges.sort_by(f64::total_cmp);
    edges.dedup_by(|a, b| (*a - *b).abs() < 1e-9 * (range.1 - range.0));
    // `dedup_by` keeps the first of a run; the range's end must stay.
    if let Some(last) = edges.last_mut() {
        *last = range.1;
    }
    edges
}

/// Nodes and weights of the 5-point Gauss-Legendre rule on [0, 1].
const NODES: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_094_5),
    (0.230_765_344_947_158_5, 0.239_314_335_249_683_2),
    (0.5, 0.284_444_444_444_444_4),
    (0.769_234_655_052_841_5, 0.239_314_335_249_683_2),
    (0.953_089_922_969_332, 0.118_463_442_528_094_5),
];

fn rule(density: &dyn Fn(f64, f64) -> f64, x: [f64; 2], y: [f64; 2]) -> f64 {
    let mut sum = 0.0;
    for (node_x, weight_x) in NODES {
        for (node_y, weight_y) in NODES {
            let (at_x, at_y) = (x[0] + node_x * (x[1] - x[0]), y[0] + node_y * (y[1] - y[0]));
            sum += weight_x * weight_y * density(at_x, at_y);
        }
    }
    sum * (x[1] - x[0]) * (y[1] - y[0])
}

/// Adaptive quadrature: halves the rectangle until its parts agree with it to 1e-5 of themselves or 1e-7 of the whole.
pub fn integrate(density: &dyn Fn(f64, f64) -> f64, x: [f64; 2], y: [f64; 2], depth: u32) -> f64 {
    let whole = rule(density, x, y);
    let (mx, my) = (0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]));
    let parts = [
        ([x[0], mx], [y[0], my]),
        ([mx, x[1]], [y[0], my]),
        ([x[0], mx], [my, y[1]]),
        ([mx, x[1]], [my, y[1]]),
    ];
    let refined: f64 = parts.iter().map(|(px, py)| rule(density, *px, *py)).sum();
    // Where all nodes see 0, a corner may still hold something.
    let is_empty = refined == 0.0 && whole == 0.0 && depth < 4;
    let allowed = 1e-5 * refined.abs() + 1e-7 * 0.5f64.powi(depth as i32);
    if depth >= 9 || !is_empty && (refined - whole).abs() <= allowed {
        return refined;
    }
    let parts = parts.iter();
    parts
        .map(|(px, py)| integrate(density, *px, *py, depth + 1))
        .sum()
}
