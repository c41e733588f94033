//! Quantiles of measured numbers.

/// Quantile `q` in 0 to 1 of finite values, linear between order statistics (Hyndman and Fan 1996, definition 7); `None`
/// of none.
#[must_use]
pub fn quantile(values: &[f64], q: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let place = q.clamp(0.0, 1.0) * last as f64;
    let below = place.floor() as usize;
    let (low, high) = (sorted[below], sorted[(below + 1).min(last)]);
    let share = place - below as f64;
    // At share 0 the neighbour does not count, not even an infinite one.
    Some(if share > 0.0 {
        low + share * (high - low)
    } else {
        low
    })
}

/// Median; `None` of none.
#[must_use]
pub fn median(values: &[f64]) -> Option<f64> {
    quantile(values, 0.5)
}
