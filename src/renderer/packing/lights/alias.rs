//! How lights are picked in proportion to their powers.

use crate::renderer::records::light::LightAlias;

/// Least chance of a light with power, over the mean of all.
const LEAST_CHANCE: f64 = 1.0 / 1024.0;
/// How many random numbers there are from 0 to 1.
const NUMBERS: f32 = 16_777_216.0;

/// Shares of the total; all 0 without power.
pub(super) fn probabilities(weights: &[f64]) -> Vec<f64> {
    let total: f64 = weights.iter().sum();
    weights
        .iter()
        .map(|weight| if total > 0.0 { weight / total } else { 0.0 })
        .collect()
}

/// The same, but that every light with power has a chance that numbers of 24 bits can tell from none.
pub(super) fn chances(weights: &[f64]) -> Vec<f64> {
    let mut chances = probabilities(weights);
    let least = LEAST_CHANCE / weights.len().max(1) as f64;
    for chance in chances.iter_mut().filter(|chance| **chance > 0.0) {
        *chance = chance.max(least);
    }
    probabilities(&chances)
}

/// Vose 1991, "A linear algorithm for generating random numbers with a given distribution", behind a header entry. Thresholds are whole
/// steps of the numbers that they are compared with, and the chances that come with the table are those with which it picks.
pub(super) fn alias_table(probabilities: &[f64]) -> (Vec<LightAlias>, Vec<f64>) {
    let count = probabilities.len();
    // Without power nothing can be picked.
    let usable = if probabilities.iter().any(|probability| *probability > 0.0) {
        count
    } else {
        0
    };
    let mut table = vec![LightAlias {
        threshold: 0.0,
        alias_index: usable as u32,
    }];
    let mut scaled: Vec<f64> = probabilities
        .iter()
        .map(|probability| probability * count as f64)
        .collect();
    let mut entries: Vec<LightAlias> = (0..count)
        .map(|index| LightAlias {
            threshold: 1.0,
            alias_index: index as u32,
        })
        .collect();
    let (mut small, mut large): (Vec<usize>, Vec<usize>) =
        (0..count).partition(|index| scaled[*index] < 1.0);
    while let (Some(less), Some(more)) = (small.pop(), large.last().copied()) {
        entries[less] = LightAlias {
            threshold: scaled[less] as f32,
            alias_index: more as u32,
        };
        scaled[more] -= 1.0 - scaled[less];
        if scaled[more] < 1.0 {
            large.pop();
            small.push(more);
        }
    }
    // What is left is 1 up to rounding, except lights without power that rounding stranded.
    if let Some(brightest) =
        (0..count).max_by(|a, b| probabilities[*a].total_cmp(&probabilities[*b]))
    {
        for (index, entry) in entries.iter_mut().enumerate() {
            if probabilities[index] == 0.0 && entry.threshold > 0.0 {
                *entry = LightAlias {
                    threshold: 0.0,
                    alias_index: brightest as u32,
                };
            }
        }
    }
    // What is left of a random number of 24 bits behind the slot that it picks.
    let steps = (NUMBERS / count.next_power_of_two() as f32).max(1.0);
    let mut chances = vec![0.0; count];
    for (index, entry) in entries.iter_mut().enumerate() {
        entry.threshold = ((entry.threshold * steps).ceil() / steps).min(1.0);
        let own = f64::from(entry.threshold) / count as f64;
        chances[index] += own;
        chances[entry.alias_index as usize] += 1.0 / count as f64 - own;
    }
    table.append(&mut entries);
    (table, chances)
}
