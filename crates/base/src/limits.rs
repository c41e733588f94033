//! Limits on reading files: memory that a load may take, and files that a scene may name.
//!
//! A small file can ask for any amount of memory: images that are all one colour, accessors without data, one mesh placed
//! a million times. So whatever is about to be expanded asks a [`LoadBudget`] first, with what it will take. The budget
//! holds for the sum over a load, not for each item.

use std::fmt;
use std::sync::atomic::{AtomicU64, Ordering};

/// Bytes in a GiB.
const GIB: u64 = 1 << 30;
/// The most that a load takes unless a setting says otherwise, bytes.
const MOST_BY_DEFAULT: u64 = 4 * GIB;
/// What a machine is taken to have where the system does not tell, bytes.
const UNKNOWN_MACHINE: u64 = 2 * MOST_BY_DEFAULT;

/// What reading files may cost and reach.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadLimits {
    /// The most memory that one load may take, bytes.
    pub memory_bytes: u64,
    /// Whether a scene may name files outside its own folder.
    pub allow_outside: bool,
}

impl Default for LoadLimits {
    /// 4 GiB, or half of the machine's memory if that is less; nothing outside the scene's folder.
    fn default() -> Self {
        Self {
            memory_bytes: MOST_BY_DEFAULT.min(machine_memory_bytes() / 2),
            allow_outside: false,
        }
    }
}

/// Memory that this process can have, bytes: the machine's, or less where the process has a limit of its own.
#[cfg(target_os = "linux")]
fn machine_memory_bytes() -> u64 {
    let kib = std::fs::read_to_string("/proc/meminfo")
        .ok()
        .and_then(|text| {
            let line = text
                .lines()
                .find_map(|line| line.strip_prefix("MemTotal:"))?;
            line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()
        });
    let machine = kib.map_or(UNKNOWN_MACHINE, |kib| kib.saturating_mul(1024));
    let group = std::fs::read_to_string("/sys/fs/cgroup/memory.max").ok();
    let group = group.and_then(|text| text.trim().parse().ok());
    let own = rustix::process::getrlimit(rustix::process::Resource::As).current;
    [group, own].into_iter().flatten().fold(machine, u64::min)
}

/// Memory that this process can have, bytes: the standard library does not tell.
#[cfg(not(target_os = "linux"))]
fn machine_memory_bytes() -> u64 {
    UNKNOWN_MACHINE
}

/// What is left of the memory that a load may take. Shared by all that the load reads, on all threads.
#[derive(Debug)]
pub struct LoadBudget {
    limits: LoadLimits,
    taken: AtomicU64,
}

impl Default for LoadBudget {
    fn default() -> Self {
        Self::new(LoadLimits::default())
    }
}

impl LoadBudget {
    /// A whole budget.
    #[must_use]
    pub fn new(limits: LoadLimits) -> Self {
        Self {
            limits,
            taken: AtomicU64::new(0),
        }
    }

    /// What it was made of.
    #[must_use]
    pub fn limits(&self) -> LoadLimits {
        self.limits
    }

    /// What is left of it, bytes.
    #[must_use]
    pub fn left(&self) -> u64 {
        let taken = self.taken.load(Ordering::Relaxed);
        self.limits.memory_bytes.saturating_sub(taken)
    }

    /// Takes `bytes` for good. `what` says what for, in the plural: "12 images of 16384x16384 pixels".
    ///
    /// # Errors
    /// [`OverBudget`]; nothing is taken then.
    pub fn take(&self, bytes: u64, what: impl fmt::Display) -> Result<(), OverBudget> {
        let more = |taken: u64| {
            let sum = taken.checked_add(bytes)?;
            (sum <= self.limits.memory_bytes).then_some(sum)
        };
        let taken = self
            .taken
            .fetch_update(Ordering::Relaxed, Ordering::Relaxed, more);
        match taken {
            Ok(_) => Ok(()),
            Err(taken) => Err(OverBudget {
                what: what.to_string(),
                bytes,
                taken,
                limit: self.limits.memory_bytes,
            }),
        }
    }

    /// Takes `bytes` until the answer is dropped: for what is only needed on the way.
    ///
    /// # Errors
    /// As [`LoadBudget::take`].
    pub fn hold(&self, bytes: u64, what: impl fmt::Display) -> Result<Held<'_>, OverBudget> {
        self.take(bytes, what)?;
        Ok(Held {
            budget: self,
            bytes,
        })
    }
}

/// Memory that goes back to its budget when this is dropped.
#[derive(Debug)]
pub struct Held<'a> {
    budget: &'a LoadBudget,
    bytes: u64,
}

impl Drop for Held<'_> {
    fn drop(&mut self) {
        self.budget.taken.fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// Something that would take more memory than a load may.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{what} need {} on top of {}, but limits.load_memory allows {} in all; make it smaller or raise the limit, for example with --set limits.load_memory={}",
    Size(*bytes), Size(*taken), Size(*limit), bytes.saturating_add(*taken).div_ceil(GIB)
)]
pub struct OverBudget {
    /// What it is, in the plural.
    pub what: String,
    /// Bytes that it needs.
    pub bytes: u64,
    /// Bytes that the load has taken so far.
    pub taken: u64,
    /// Bytes that it may take in all.
    pub limit: u64,
}

/// A number of bytes for people.
struct Size(u64);

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const MIB: u64 = 1 << 20;
        match self.0 {
            0..MIB => write!(f, "{} bytes", self.0),
            MIB..GIB => write!(f, "{:.1} MiB", self.0 as f64 / MIB as f64),
            _ => write!(f, "{:.1} GiB", self.0 as f64 / GIB as f64),
        }
    }
}

/// The product of sizes and counts, at most `u64::MAX`.
pub fn product(factors: &[u64]) -> u64 {
    factors
        .iter()
        .fold(1, |all, next| all.saturating_mul(*next))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn budget(memory_bytes: u64) -> LoadBudget {
        LoadBudget::new(LoadLimits {
            memory_bytes,
            allow_outside: false,
        })
    }

    #[test]
    fn the_sum_counts_and_what_is_held_comes_back() {
        let budget = budget(100);
        budget.take(60, "stones").unwrap();
        let held = budget.hold(40, "sticks").unwrap();
        let refused = budget.take(1, "straws").unwrap_err();
        assert_eq!((refused.bytes, refused.taken, refused.limit), (1, 100, 100));
        drop(held);
        budget.take(40, "straws").unwrap();
        assert!(budget.take(u64::MAX, "worlds").is_err());
    }

    #[test]
    fn the_message_says_what_needs_how_much_and_which_setting_allows_it() {
        let budget = budget(4 * GIB);
        budget.take(GIB, "stones").unwrap();
        let refused = budget
            .take(5 * GIB + 1, "9 images")
            .unwrap_err()
            .to_string();
        assert!(
            refused.starts_with("9 images need 5.0 GiB on top of 1.0 GiB"),
            "{refused}"
        );
        assert!(refused.contains("allows 4.0 GiB"), "{refused}");
        assert!(refused.ends_with("--set limits.load_memory=7"), "{refused}");
    }

    #[test]
    fn the_default_is_at_most_4_gib() {
        let limits = LoadLimits::default();
        assert!((1..=4 * GIB).contains(&limits.memory_bytes));
        assert!(!limits.allow_outside);
    }
}
