//! Medians, spreads, paired ratios, fits and Pareto fronts of measured numbers.

use serde::{Deserialize, Serialize};

pub use stereolux_base::quantiles::{median, quantile};

/// A median with its spread. Times have long upper tails, so means and standard deviations would describe the worst
/// interruption and not the work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Spread {
    /// Median.
    pub median: f64,
    /// Lower quartile.
    pub lower_quartile: f64,
    /// Upper quartile.
    pub upper_quartile: f64,
    /// Median of the absolute differences from the median, not scaled to a standard deviation.
    pub mad: f64,
    /// Values.
    pub count: usize,
}

/// An estimate with its standard error, where there is one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Its standard error.
    pub standard_error: Option<f64>,
}

/// A straight line through points, by least squares.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct LineFit {
    /// Rise over run.
    pub slope: f64,
    /// Its standard error; none from two points.
    pub slope_se: Option<f64>,
    /// Value at 0.
    pub intercept: f64,
    /// Its standard error; none from two points.
    pub intercept_se: Option<f64>,
    /// Share of y's variance that the line explains, 0 to 1; 1 where y does not vary.
    pub r_squared: f64,
    /// Points.
    pub points: usize,
}

/// y = factor x^exponent through points, by least squares over the logarithms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PowerFit {
    /// Exponent.
    pub exponent: f64,
    /// Its standard error; none from two points.
    pub exponent_se: Option<f64>,
    /// Value at x = 1.
    pub factor: f64,
    /// Points.
    pub points: usize,
}

/// Median and spread; `None` of none.
#[must_use]
pub fn spread(values: &[f64]) -> Option<Spread> {
    let middle = median(values)?;
    let distances: Vec<f64> = values.iter().map(|value| (value - middle).abs()).collect();
    Some(Spread {
        median: middle,
        lower_quartile: quantile(values, 0.25)?,
        upper_quartile: quantile(values, 0.75)?,
        mad: median(&distances)?,
        count: values.len(),
    })
}

/// The ratio of two variants measured in turn: the spread of `numerator[i] / denominator[i]` over the rounds i. What slows
/// a whole round (another program, heat) cancels. Rounds without a positive denominator are left out.
#[must_use]
pub fn paired_ratio(numerator: &[f64], denominator: &[f64]) -> Option<Spread> {
    let ratios: Vec<f64> = numerator
        .iter()
        .zip(denominator)
        .filter(|(_, below)| **below > 0.0)
        .map(|(above, below)| above / below)
        .filter(|ratio| ratio.is_finite())
        .collect();
    spread(&ratios)
}

/// Mean and its standard error over independent values; `None` of none.
#[must_use]
pub fn mean(values: &[f64]) -> Option<Estimate> {
    if values.is_empty() {
        return None;
    }
    let count = values.len() as f64;
    let value = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|x| (x - value).powi(2)).sum();
    let standard_error = (values.len() > 1).then(|| (squares / (count - 1.0) / count).sqrt());
    Some(Estimate {
        value,
        standard_error,
    })
}

/// Fits a straight line; `None` unless two points differ in x.
#[must_use]
pub fn line_fit(x: &[f64], y: &[f64]) -> Option<LineFit> {
    let points: Vec<(f64, f64)> = x
        .iter()
        .copied()
        .zip(y.iter().copied())
        .filter(|(x, y)| x.is_finite() && y.is_finite())
        .collect();
    let count = points.len() as f64;
    let mean_of = |pick: fn(&(f64, f64)) -> f64| points.iter().map(pick).sum::<f64>() / count;
    let (mean_x, mean_y) = (mean_of(|p| p.0), mean_of(|p| p.1));
    let sum = |term: &dyn Fn(f64, f64) -> f64| -> f64 {
        points
            .iter()
            .map(|p| term(p.0 - mean_x, p.1 - mean_y))
            .sum()
    };
    let (xx, xy) = (sum(&|x, _| x * x), sum(&|x, y| x * y));
    if points.len() < 2 || xx <= 0.0 {
        return None;
    }
    let slope = xy / xx;
    let residue = sum(&|x, y| (y - slope * x).powi(2));
    let total = sum(&|_, y| y * y);
    let variance = (points.len() > 2).then(|| residue / (count - 2.0));
    Some(LineFit {
        slope,
        slope_se: variance.map(|variance| (variance / xx).sqrt()),
        intercept: mean_y - slope * mean_x,
        r_squared: if total > 0.0 {
            1.0 - residue / total
        } else {
            1.0
        },
        intercept_se: variance
            .map(|variance| (variance * (1.0 / count + mean_x * mean_x / xx)).sqrt()),
        points: points.len(),
    })
}

/// Fits a power law; points that are not positive are left out. `None` unless two points differ in x.
#[must_use]
pub fn power_fit(x: &[f64], y: &[f64]) -> Option<PowerFit> {
    let logs: (Vec<f64>, Vec<f64>) = x
        .iter()
        .zip(y)
        .filter(|(x, y)| **x > 0.0 && **y > 0.0)
        .map(|(x, y)| (x.ln(), y.ln()))
        .unzip();
    let line = line_fit(&logs.0, &logs.1)?;
    Some(PowerFit {
        exponent: line.slope,
        exponent_se: line.slope_se,
        factor: line.intercept.exp(),
        points: line.points,
    })
}

/// Indices of the points that no other beats in both coordinates (less is better), by rising first coordinate. Of equal
/// points the first stays. Points that are not finite are never on the front.
#[must_use]
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len())
        .filter(|&i| points[i].0.is_finite() && points[i].1.is_finite())
        .collect();
    order.sort_by(|&a, &b| {
        points[a]
            .0
            .total_cmp(&points[b].0)
            .then(points[a].1.total_cmp(&points[b].1))
            .then(a.cmp(&b))
    });
    let mut front: Vec<usize> = Vec::new();
    for index in order {
        if front
            .last()
            .is_none_or(|&last| points[index].1 < points[last].1)
        {
            front.push(index);
        }
    }
    front
}

/// x at which the power-law segments through `points` (x rising) reach `y`; `None` outside of them.
#[must_use]
pub fn log_interpolate(points: &[(f64, f64)], y: f64) -> Option<f64> {
    points.windows(2).find_map(|pair| {
        let [(x0, y0), (x1, y1)] = [pair[0], pair[1]];
        let positive = [x0, y0, x1, y1, y].iter().all(|value| *value > 0.0);
        if !positive || !(y0.min(y1)..=y0.max(y1)).contains(&y) {
            return None;
        }
        if y0 == y1 {
            return Some(x0);
        }
        let share = (y / y0).ln() / (y1 / y0).ln();
        Some(x0 * (x1 / x0).powf(share))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_and_deviations_by_hand() {
        assert_eq!(median(&[]), None);
        assert_eq!(median(&[3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&[4.0, 1.0, 2.0, 3.0]), Some(2.5));
        // Distances from 3: 2 1 0 1 97, whose median is 1: one wild value moves neither figure.
        let found = spread(&[1.0, 2.0, 3.0, 4.0, 100.0]).unwrap();
        assert_eq!((found.median, found.mad, found.count), (3.0, 1.0, 5));
        assert_eq!((found.lower_quartile, found.upper_quartile), (2.0, 4.0));
        assert_eq!(quantile(&[0.0, 10.0], 0.25), Some(2.5));
        assert_eq!(spread(&[]), None);
    }

    #[test]
    fn pairing_cancels_what_slows_a_round() {
        // Variant b takes 1.5 times as long as a; the machine's speed changes a hundredfold between rounds.
        let speed = [1.0, 100.0, 3.0, 0.2, 40.0];
        let a: Vec<f64> = speed.to_vec();
        let b: Vec<f64> = speed.iter().map(|s| 1.5 * s).collect();
        let ratio = paired_ratio(&b, &a).unwrap();
        assert!((ratio.median - 1.5).abs() < 1e-12 && ratio.mad < 1e-12);
        // Not so where rounds are torn apart: the estimator is paired, not a ratio of medians by luck.
        let torn: Vec<f64> = b.iter().rev().copied().collect();
        assert!(paired_ratio(&torn, &a).unwrap().mad > 1.0);
        assert_eq!(paired_ratio(&[1.0], &[0.0]), None);
    }

    #[test]
    fn mean_and_standard_error_by_hand() {
        let found = mean(&[1.0, 3.0]).unwrap();
        // Sample variance 2, over 2 values.
        assert_eq!((found.value, found.standard_error), (2.0, Some(1.0)));
        assert_eq!(mean(&[5.0]).unwrap().standard_error, None);
        assert_eq!(mean(&[]), None);
    }

    #[test]
    fn lines_and_powers_are_found_again() {
        let x: Vec<f64> = (1..=6).map(f64::from).collect();
        let y: Vec<f64> = x.iter().map(|x| 3.0 + 0.5 * x).collect();
        let line = line_fit(&x, &y).unwrap();
        assert!((line.slope - 0.5).abs() < 1e-12 && (line.intercept - 3.0).abs() < 1e-12);
        assert!(line.slope_se.unwrap() < 1e-12);
        assert_eq!(line_fit(&[1.0, 1.0], &[2.0, 3.0]), None);

        // 7 x^0.8 with errors of +-5 % in turn: the exponent within 4 standard errors, and the error not absurd.
        let x: Vec<f64> = (0..9).map(|i| 2.0_f64.powi(i)).collect();
        let y: Vec<f64> = x
            .iter()
            .enumerate()
            .map(|(i, x)| 7.0 * x.powf(0.8) * if i % 2 == 0 { 1.05 } else { 0.95 })
            .collect();
        let fit = power_fit(&x, &y).unwrap();
        let se = fit.exponent_se.unwrap();
        assert!(
            (fit.exponent - 0.8).abs() < 4.0 * se && se < 0.02,
            "{fit:?}"
        );
        assert!((fit.factor / 7.0 - 1.0).abs() < 0.1);
        // Negative control: another exponent is told apart.
        assert!((fit.exponent - 1.0).abs() > 4.0 * se);
        assert_eq!(power_fit(&[1.0, -1.0], &[1.0, 1.0]), None);
    }

    #[test]
    fn standard_errors_of_a_line_by_hand() {
        // x = 0 1 2, y = 0 1 1: slope 1/2, intercept 1/6, residues -1/6 1/3 -1/6, their squares sum to 1/6;
        // slope variance 1/6 / 2 = 1/12, intercept variance 1/6 (1/3 + 1/2) = 5/36.
        let line = line_fit(&[0.0, 1.0, 2.0], &[0.0, 1.0, 1.0]).unwrap();
        assert!((line.slope - 0.5).abs() < 1e-12 && (line.intercept - 1.0 / 6.0).abs() < 1e-12);
        assert!((line.slope_se.unwrap() - (1.0_f64 / 12.0).sqrt()).abs() < 1e-12);
        // y's squares about their mean sum to 2/3, of which 1/6 is left.
        assert!((line.r_squared - 0.75).abs() < 1e-12);
        assert!((line.intercept_se.unwrap() - (5.0_f64 / 36.0).sqrt()).abs() < 1e-12);
    }

    #[test]
    fn front_of_known_points() {
        let points = [
            (1.0, 10.0),
            (2.0, 5.0),
            (2.0, 6.0),
            (3.0, 7.0),
            (4.0, 1.0),
            (0.5, f64::NAN),
            (4.0, 1.0),
        ];
        assert_eq!(pareto_front(&points), [0, 1, 4]);
        assert!(pareto_front(&[]).is_empty());
        // A point that beats all others is alone.
        assert_eq!(pareto_front(&[(2.0, 2.0), (1.0, 1.0), (3.0, 1.0)]), [1]);
    }

    #[test]
    fn interpolation_follows_a_power_law() {
        // y = 1 / x: at y = 0.25, x = 4.
        let points = [(1.0, 1.0), (2.0, 0.5), (8.0, 0.125)];
        assert!((log_interpolate(&points, 0.25).unwrap() - 4.0).abs() < 1e-12);
        assert_eq!(log_interpolate(&points, 2.0), None);
        assert_eq!(log_interpolate(&points, 0.01), None);
    }
}
