//! Limits on what kernels become, and their stored instruction counts.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use serde::{Deserialize, Serialize};

use crate::card::{Card, Family};
use crate::table::Row;

/// RDNA's instruction cache ("RDNA Architecture", AMD 2019): code beyond it is fetched anew in every turn of a long loop.
const CODE_BYTES: u32 = 32 << 10;
/// Instructions over the stored count that are let pass, %.
const MORE_INSTRUCTIONS: u32 = 5;

/// What is limited.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Limit {
    /// No register is spilled.
    Spills,
    /// Scratch holds arrays that the shader declares and what was spilled, nothing else.
    Scratch,
    /// The code fits into the instruction cache.
    Code,
    /// Enough waves hide each other's waiting for memory.
    Waves,
}

const LIMITS: [Limit; 4] = [Limit::Spills, Limit::Scratch, Limit::Code, Limit::Waves];

/// Kernels that break a limit, known and explained. One that no longer breaks it is an error: its name goes.
struct Exception {
    cards: &'static [Family],
    limit: Limit,
    reason: &'static str,
    /// Scene and pass.
    kernels: &'static [[&'static str; 2]],
}

const CAPPED: &str = "Mesa 22 stops at 132 of this card's 256 vector registers; Mesa 25 has spilled nothing in path tracing";

const EXCEPTIONS: &[Exception] = &[
    Exception {
        cards: &[Family::Rdna2],
        limit: Limit::Spills,
        reason: "up to eleven scalar registers, into lanes of a vector register",
        kernels: &[["gallery", "path_trace"], ["helmet", "path_trace"]],
    },
    Exception {
        cards: &[Family::Rdna3],
        limit: Limit::Spills,
        reason: CAPPED,
        kernels: &[["gallery", "path_trace"], ["helmet", "path_trace"]],
    },
    Exception {
        cards: &Family::ALL,
        limit: Limit::Waves,
        reason: "a path's state, both ways to sample light and a ray are alive at once",
        kernels: &[["gallery", "path_trace"], ["helmet", "path_trace"]],
    },
    Exception {
        cards: &Family::ALL,
        limit: Limit::Waves,
        reason: "a surface's materials and a ray are alive at once",
        kernels: WIDE_KERNELS,
    },
];

const WIDE_KERNELS: &[[&str; 2]] = &[
    ["gallery", "eye_hits"],
    ["gallery", "direct_light"],
    ["gallery", "followed_light"],
    ["helmet", "eye_hits"],
];

/// Least waves: eight hide memory; path tracing holds a path's state beside the ray's, which costs two. RDNA 2 has two thirds
/// of RDNA 3's registers, so as many of its waves. Passes of no default frame have none.
fn least_waves(card: Family, frame: &str) -> u32 {
    let on_rdna3 = match frame {
        "photon" => 8,
        "path" => 6,
        _ => return 1,
    };
    match card {
        Family::Rdna2 => on_rdna3 * 2 / 3,
        Family::Rdna3 => on_rdna3,
    }
}

impl Limit {
    /// What breaks the limit, in words.
    fn broken(self, row: &Row) -> Option<String> {
        let least_waves = least_waves(row.card, row.frame);
        // A spilled register takes four bytes per lane; scratch is handed out in units of 16.
        let scratch =
            row.declared_bytes.next_multiple_of(16) + (4 * row.spilled_vgprs).next_multiple_of(16);
        let (is_broken, words) = match self {
            Self::Spills => (
                row.spilled_vgprs + row.spilled_sgprs > 0,
                format!(
                    "spills {} vector and {} scalar registers",
                    row.spilled_vgprs, row.spilled_sgprs
                ),
            ),
            Self::Scratch => (
                row.scratch_bytes > scratch,
                format!(
                    "keeps {} bytes per lane in scratch, and declares and spills {scratch}",
                    row.scratch_bytes
                ),
            ),
            Self::Code => (
                row.code_bytes > CODE_BYTES,
                format!("is {} bytes of code, over {CODE_BYTES}", row.code_bytes),
            ),
            Self::Waves => (
                row.waves < least_waves,
                format!("leaves room for {} waves, not {least_waves}", row.waves),
            ),
        };
        is_broken.then_some(words)
    }
}

/// What is wrong with `rows`, one line each, and which exceptions they do not need.
fn judge(rows: &[Row], exceptions: &[Exception]) -> (Vec<String>, Vec<String>) {
    let mut unneeded: Vec<(&Exception, Family, [&str; 2])> = Vec::new();
    for known in exceptions {
        for &card in known.cards {
            // Of a scene that was not asked for nothing is known.
            let is_known = |[scene, _]: &[&str; 2]| {
                let mut rows = rows.iter();
                rows.any(|row| row.card == card && row.scene == *scene)
            };
            let kernels = known.kernels.iter().copied().filter(is_known);
            unneeded.extend(kernels.map(|kernel| (known, card, kernel)));
        }
    }
    let mut faults = Vec::new();
    for row in rows {
        for limit in LIMITS {
            let Some(words) = limit.broken(row) else {
                continue;
            };
            let kernel = [row.scene.as_str(), row.pass.as_str()];
            let excuses = |known: &Exception| {
                known.limit == limit
                    && known.cards.contains(&row.card)
                    && known.kernels.contains(&kernel)
            };
            if exceptions.iter().any(excuses) {
                unneeded.retain(|(known, card, name)| {
                    (known.limit, *card, *name) != (limit, row.card, kernel)
                });
            } else {
                faults.push(format!("{} {words}", row.name()));
            }
        }
    }
    let no_more = |(known, card, [scene, pass]): &(&Exception, Family, [&str; 2])| {
        format!(
            "{} {scene} {pass}: no exception from {:?} is needed any more ({})",
            card.name(),
            known.limit,
            known.reason
        )
    };
    (faults, unneeded.iter().map(no_more).collect())
}

/// A line of the stored table.
#[derive(Debug, Clone, Serialize, Deserialize)]
struct Stored {
    driver: String,
    card: Family,
    scene: String,
    frame: String,
    pass: String,
    instructions: u32,
}

impl Stored {
    fn of(driver: &str, row: &Row) -> Self {
        Self {
            driver: driver.to_owned(),
            card: row.card,
            scene: row.scene.clone(),
            frame: row.frame.to_owned(),
            pass: row.pass.clone(),
            instructions: row.instructions,
        }
    }

    /// As [`Row::name`].
    fn name(&self) -> String {
        let card = self.card.name();
        format!("{card} {} {} ({})", self.scene, self.pass, self.frame)
    }
}

/// Lines for kernels that grew, that are new, or that are gone.
fn compare(stored: &[Stored], now: &[Stored]) -> Vec<String> {
    let counts = stored.iter().map(|line| (line.name(), line.instructions));
    let mut before: BTreeMap<String, u32> = counts.collect();
    let mut faults = Vec::new();
    for line in now {
        let name = line.name();
        match before.remove(&name) {
            Some(count) if line.instructions * 100 > count * (100 + MORE_INSTRUCTIONS) => {
                faults.push(format!(
                    "{name} has {} instructions, over {MORE_INSTRUCTIONS} % more than the {count} that are stored",
                    line.instructions
                ));
            }
            Some(_) => {}
            None => faults.push(format!("{name} is not stored")),
        }
    }
    let gone = before.into_keys();
    faults.extend(gone.map(|name| format!("{name} is stored and is no more")));
    faults
}

fn table_file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("instructions.csv")
}

fn as_stored(cards: &[Card], rows: &[Row]) -> Vec<Stored> {
    let of_card = |card: &Card| {
        let of = rows.iter().filter(|row| row.card == card.family);
        of.map(|row| Stored::of(&card.compiler.driver, row))
            .collect::<Vec<_>>()
    };
    cards.iter().flat_map(of_card).collect()
}

/// Writes the table of instruction counts.
pub fn store(cards: &[Card], rows: &[Row]) -> Result<()> {
    let file = table_file();
    let mut csv = csv::Writer::from_path(&file)
        .with_context(|| format!("{} cannot be written", file.display()))?;
    for line in as_stored(cards, rows) {
        csv.serialize(line)?;
    }
    Ok(csv.flush()?)
}

/// Fails with what is wrong, one line each. Counts, and exceptions that are not needed, are judged only if the rows are
/// all that the stored table holds (`is_whole`), by its own driver: others compile otherwise.
pub fn check(cards: &[Card], rows: &[Row], is_whole: bool) -> Result<()> {
    let file = table_file();
    let stored = csv::Reader::from_path(&file)
        .and_then(|mut csv| csv.deserialize().collect::<Result<Vec<Stored>, _>>())
        .with_context(|| format!("{} cannot be read", file.display()))?;
    let (mut faults, unneeded) = judge(rows, EXCEPTIONS);
    let now = as_stored(cards, rows);
    let is_stored_driver = |line: &Stored| {
        stored
            .first()
            .is_some_and(|first| first.driver == line.driver)
    };
    if !is_whole {
        eprintln!("instructions are compared where all cards, scenes and passes are asked for");
    } else if now.iter().all(is_stored_driver) {
        faults.extend(unneeded);
        faults.extend(compare(&stored, &now));
    } else {
        let driver = stored.first().map_or("another", |line| &line.driver);
        eprintln!("instructions are stored for {driver}: counts of this driver are not compared");
    }
    if faults.is_empty() {
        eprintln!("{} kernels are within their limits", rows.len());
        return Ok(());
    }
    for fault in &faults {
        eprintln!("{fault}");
    }
    bail!(
        "{} faults: see docs/gpu.md; where a count grew on purpose, run scripts/gpu_isa.sh --store",
        faults.len()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A kernel just within every limit.
    fn row() -> Row {
        Row {
            card: Family::Rdna3,
            scene: "room".to_owned(),
            frame: "photon",
            pass: "trace".to_owned(),
            code_bytes: CODE_BYTES,
            instructions: 1000,
            vgprs: 96,
            sgprs: 128,
            spilled_vgprs: 0,
            spilled_sgprs: 0,
            lanes: 64,
            scratch_bytes: 288,
            declared_bytes: 288,
            lds_bytes: 0,
            waves: 8,
            latency_cycles: 1,
            inverse_throughput_cycles: 1,
        }
    }

    const fn exception(limit: Limit) -> Exception {
        Exception {
            cards: &[Family::Rdna3],
            limit,
            reason: "why",
            kernels: &[["room", "trace"]],
        }
    }

    #[test]
    fn a_kernel_over_a_limit_is_a_fault_unless_it_is_excused() {
        assert_eq!(judge(&[row()], &[]), (Vec::new(), Vec::new()));
        type Break = fn(&mut Row);
        let breaks: [(Limit, Break); 5] = [
            (Limit::Spills, |row| row.spilled_sgprs = 1),
            (Limit::Spills, |row| row.spilled_vgprs = 1),
            (Limit::Scratch, |row| row.scratch_bytes += 16),
            (Limit::Code, |row| row.code_bytes += 4),
            (Limit::Waves, |row| row.waves -= 1),
        ];
        for (limit, break_it) in breaks {
            let mut row = row();
            break_it(&mut row);
            let (faults, _) = judge(std::slice::from_ref(&row), &[]);
            assert_eq!(faults.len(), 1, "{faults:?}");
            assert_eq!(
                judge(&[row], &[exception(limit)]),
                (Vec::new(), Vec::new()),
                "{limit:?}"
            );
        }
    }

    #[test]
    fn an_exception_that_nothing_needs_is_a_fault() {
        let (faults, unneeded) = judge(&[row()], &[exception(Limit::Waves)]);
        assert_eq!((faults.len(), unneeded.len()), (0, 1));
        // Of a scene that was not asked for nothing is known.
        let mut other = row();
        other.scene = "garden".to_owned();
        assert!(judge(&[other], &[exception(Limit::Waves)]).1.is_empty());
    }

    #[test]
    fn counts_may_grow_by_a_twentieth_and_every_kernel_is_stored() {
        let line = |pass: &str, instructions| Stored {
            pass: pass.to_owned(),
            instructions,
            ..Stored::of("driver", &row())
        };
        let stored = [line("a", 1000), line("b", 1000)];
        assert!(compare(&stored, &[line("a", 1050), line("b", 1)]).is_empty());
        assert_eq!(
            compare(&stored, &[line("a", 1051), line("b", 1000)]).len(),
            1
        );
        assert_eq!(compare(&stored, &[line("a", 1000)]).len(), 1);
        assert_eq!(
            compare(&stored[..1], &[line("a", 1000), line("c", 1)]).len(),
            1
        );
    }
}
