//! Variants in turn.
//!
//! Machines drift: they heat up, clocks change, other programs come and go. So variants are not measured one after the
//! other but round by round, one frame of each, and a ratio is formed within a round. The order within a round rotates, so
//! that none always follows the same other.

/// One round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Round {
    /// Number from 0 on, warm-up included: frames of different rounds have different random numbers.
    pub index: u32,
    /// False during warm-up.
    pub counts: bool,
    /// Whether no round follows.
    pub is_last: bool,
}

/// Runs `warm_up` rounds and then `rounds` that count. `run` makes one frame of the variant with this index; `done` gets
/// a round's results in the order of the variants.
///
/// # Errors
/// The first error of `run` or `done`.
pub fn interleave<T, E>(
    variants: usize,
    warm_up: u32,
    rounds: u32,
    mut run: impl FnMut(usize, Round) -> Result<T, E>,
    mut done: impl FnMut(Round, Vec<T>) -> Result<(), E>,
) -> Result<(), E> {
    let total = warm_up + rounds;
    for index in 0..total {
        let round = Round {
            index,
            counts: index >= warm_up,
            is_last: index + 1 == total,
        };
        let mut results: Vec<Option<T>> = (0..variants).map(|_| None).collect();
        for place in 0..variants {
            let variant = (place + index as usize) % variants;
            results[variant] = Some(run(variant, round)?);
        }
        done(round, results.into_iter().flatten().collect())?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::paired_ratio;

    #[test]
    fn every_variant_runs_once_per_round_in_rotating_order() {
        let mut order = Vec::new();
        let mut rounds = Vec::new();
        interleave(
            3,
            1,
            3,
            |variant, round| {
                order.push((round.index, variant));
                Ok::<_, ()>(10 * round.index as usize + variant)
            },
            |round, results| {
                rounds.push((round.counts, round.is_last, results));
                Ok(())
            },
        )
        .unwrap();
        assert_eq!(
            order,
            [
                (0, 0),
                (0, 1),
                (0, 2),
                (1, 1),
                (1, 2),
                (1, 0),
                (2, 2),
                (2, 0),
                (2, 1),
                (3, 0),
                (3, 1),
                (3, 2),
            ]
        );
        assert_eq!(
            rounds,
            [
                (false, false, vec![0, 1, 2]),
                (true, false, vec![10, 11, 12]),
                (true, false, vec![20, 21, 22]),
                (true, true, vec![30, 31, 32]),
            ]
        );
    }

    #[test]
    fn errors_stop_the_rounds() {
        let mut frames = 0;
        let outcome = interleave(
            2,
            0,
            9,
            |variant, round| {
                frames += 1;
                if (round.index, variant) == (1, 1) {
                    Err("lost")
                } else {
                    Ok(())
                }
            },
            |_, _| Ok(()),
        );
        assert_eq!((outcome, frames), (Err("lost"), 3));
    }

    #[test]
    fn a_known_ratio_survives_a_drifting_machine() {
        // The machine slows down by a quarter with every frame; the second variant costs 1.7 times as much. Measured one
        // after the other the ratio would be off by 1.25^8; in turn it is off by at most one frame's drift, and the rotation
        // puts that on both sides.
        let mut clock = 1.0;
        let mut times = [Vec::new(), Vec::new()];
        interleave(
            2,
            1,
            8,
            |variant, _| {
                clock *= 1.25;
                Ok::<_, ()>(clock * if variant == 0 { 1.0 } else { 1.7 })
            },
            |round, results| {
                if round.counts {
                    for (variant, ms) in results.into_iter().enumerate() {
                        times[variant].push(ms);
                    }
                }
                Ok(())
            },
        )
        .unwrap();
        let ratio = paired_ratio(&times[1], &times[0]).unwrap();
        assert_eq!(ratio.count, 8);
        assert!((ratio.median / 1.7 - 1.0).abs() < 0.25, "{ratio:?}");
        assert!(ratio.lower_quartile <= 1.7 && 1.7 <= ratio.upper_quartile);
    }
}
