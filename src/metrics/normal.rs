//! Quantiles of the normal distribution, for z-tests.
//!
//! M. J. Wichura, "Algorithm AS 241: The Percentage Points of the Normal Distribution", Applied Statistics 37(3), 1988,
//! routine PPND16: relative error about 1e-16. Coefficients run from the highest power down.

const CENTRE_NUM: [f64; 8] = [
    2509.0809287301227,
    33430.57558358813,
    67265.7709270087,
    45921.95393154987,
    13731.69376550946,
    1971.5909503065513,
    133.14166789178438,
    3.3871328727963665,
];
const CENTRE_DEN: [f64; 8] = [
    5226.495278852854,
    28729.085735721943,
    39307.89580009271,
    21213.794301586597,
    5394.196021424751,
    687.1870074920579,
    42.31333070160091,
    1.0,
];
const TAIL_NUM: [f64; 8] = [
    0.0007745450142783414,
    0.022723844989269184,
    0.2417807251774506,
    1.2704582524523684,
    3.6478483247632045,
    5.769497221460691,
    4.630337846156546,
    1.4234371107496835,
];
const TAIL_DEN: [f64; 8] = [
    1.0507500716444169e-09,
    0.0005475938084995345,
    0.015198666563616457,
    0.14810397642748008,
    0.6897673349851,
    1.6763848301838038,
    2.053191626637759,
    1.0,
];
const FAR_NUM: [f64; 8] = [
    2.0103343992922881e-07,
    2.7115555687434876e-05,
    0.0012426609473880784,
    0.026532189526576124,
    0.29656057182850487,
    1.7848265399172913,
    5.463784911164114,
    6.657904643501103,
];
const FAR_DEN: [f64; 8] = [
    2.0442631033899397e-15,
    1.421511758316446e-07,
    1.8463183175100548e-05,
    0.0007868691311456133,
    0.014875361290850615,
    0.1369298809227358,
    0.599832206555888,
    1.0,
];

/// The z that a standard normal variable exceeds with probability `upper_tail`, in (0, 1). Infinite or NaN outside.
#[must_use]
pub fn normal_quantile(upper_tail: f64) -> f64 {
    let horner =
        |coefficients: &[f64; 8], x: f64| coefficients.iter().fold(0.0, |sum, c| sum * x + c);
    let q = 0.5 - upper_tail;
    if q.abs() <= 0.425 {
        let r = 0.180_625 - q * q;
        return q * horner(&CENTRE_NUM, r) / horner(&CENTRE_DEN, r);
    }
    let smaller_tail = if q > 0.0 {
        upper_tail
    } else {
        1.0 - upper_tail
    };
    let r = (-smaller_tail.ln()).sqrt();
    let z = if r <= 5.0 {
        horner(&TAIL_NUM, r - 1.6) / horner(&TAIL_DEN, r - 1.6)
    } else {
        horner(&FAR_NUM, r - 5.0) / horner(&FAR_DEN, r - 5.0)
    };
    if q > 0.0 { z } else { -z }
}

/// The |z| that each of `tests` independent two-sided tests must exceed to be rejected, so that the chance of any
/// rejection is `significance` if all hypotheses hold: Sidak, "Rectangular Confidence Regions for the Means of
/// Multivariate Normal Distributions", 1967. `significance` lies in (0, 1); no tests count as one.
#[must_use]
pub fn sidak_z_limit(significance: f64, tests: usize) -> f64 {
    // 1 - (1 - significance)^(1 / tests) without cancellation.
    let each = -f64::exp_m1(f64::ln_1p(-significance) / tests.max(1) as f64);
    normal_quantile(0.5 * each)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tabulated_quantiles() {
        // Upper tails of whole numbers of standard deviations, erfc(z / sqrt 2) / 2, and the customary 2.5 %.
        for (upper_tail, z) in [
            (0.5, 0.0),
            (0.158_655_253_931_457_05, 1.0),
            (0.025, 1.959_963_984_540_054),
            (0.001_349_898_031_630_094_5, 3.0),
            (2.866_515_718_791_939e-7, 5.0),
            (9.865_876_450_376_982e-10, 6.0),
            (7.619_853_024_160_527e-24, 10.0),
        ] {
            assert!(
                (normal_quantile(upper_tail) - z).abs() < 1e-10,
                "{upper_tail} {z}"
            );
            if upper_tail > 1e-4 {
                assert!((normal_quantile(1.0 - upper_tail) + z).abs() < 1e-10);
            }
        }
    }

    #[test]
    fn sidak_limits() {
        assert!((sidak_z_limit(0.05, 1) - 1.959_963_984_540_054).abs() < 1e-10);
        // Two tests: each at 1 - sqrt(0.95) = 0.025320565519.
        assert!((sidak_z_limit(0.05, 2) - normal_quantile(0.025_320_565_519 / 2.0)).abs() < 1e-8);
        assert!(sidak_z_limit(0.01, 1_000_000) > sidak_z_limit(0.01, 1_000));
    }
}
