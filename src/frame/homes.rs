//! Where the frame's images lie: those that are not needed at the same time share memory.
//!
//! An image that holds data only within a frame ([`Holds::Within`]) needs memory from the first step that touches it to the
//! last. It lies where another image holds nothing meanwhile, or in memory that such images use in turn. This is linear-scan
//! register allocation (Poletto and Sarkar 1999, section 4) with images for registers, the largest placed first. What only the making of
//! a photon map needs lies there too.

use std::collections::BTreeMap;

use super::bind::{Place, Use, Whose};
use super::buffers::{self, BufferRow, Holds, ImageLayout};
use super::photon_layout::MapLayout;
use super::step::{Action, PlannedStage, Stage, Step};
use crate::gpu::buffers::allocated_bytes;

/// First and last moment of a range.
type Span = [u32; 2];
/// All of a frame.
const ALWAYS: Span = [0, u32::MAX];

/// Where a buffer lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Home {
    /// In memory of its own.
    Own,
    /// In another buffer, which holds nothing meanwhile; of one that is double-buffered in that of this or the previous frame.
    In {
        /// The other buffer.
        host: Place,
        /// Whether in that of the previous frame.
        is_before: bool,
    },
    /// In memory of this number that images use in turn.
    Turn(usize),
}

/// Where all buffers of a plan lie.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Homes {
    of: BTreeMap<Place, Home>,
    /// Bytes of each memory that images use in turn, the largest first.
    pub turn_bytes: Vec<u64>,
}

impl Homes {
    /// Where a buffer lies.
    #[must_use]
    pub fn of(&self, place: &Place) -> Home {
        self.of.get(place).copied().unwrap_or(Home::Own)
    }
}

/// The steps of a frame and the moments at which they run. Of the right eye's two stages a frame runs one; the short one counts
/// as a single moment, so that where images lie does not depend on the number of slices that a pass is cut into.
pub fn moments(stages: &[PlannedStage]) -> impl Iterator<Item = (u32, &Step)> {
    let (mut begins, mut next) = (0, 0);
    stages.iter().flat_map(move |planned| {
        let is_instead = planned.stage == Stage::RightEqual;
        if !is_instead {
            begins = next;
            next += planned.steps.len() as u32;
        }
        let first = begins;
        let steps = (0..).zip(&planned.steps);
        steps.map(move |(step_index, step)| {
            let at = if is_instead {
                first
            } else {
                first + step_index
            };
            (at, step)
        })
    })
}

/// Notes what steps without a pass do with the buffers that passes use: clears, copies, and until when they are kept.
pub fn note_the_rest(stages: &[PlannedStage], uses: &mut BTreeMap<Place, Use>) {
    for (at, step) in moments(stages) {
        for row in buffers::BUFFERS {
            let (is_named, is_kept) = match step.action {
                Action::Clear(moment) => (row.cleared.contains(&moment), false),
                Action::Copy { from, to } => (row.name == from || row.name == to, false),
                Action::Keep(name) => (row.name == name, true),
                Action::Run { .. } | Action::CopyTexels(_) => continue,
            };
            let place = (super::bind::whose(row, step.owner), row.name);
            if let Some(usage) = uses.get_mut(&place).filter(|_| is_named) {
                usage.touch(at);
                usage.is_kept |= is_kept;
            }
        }
    }
}

/// Memory that may take images in, and when it is taken.
struct Room {
    home: Home,
    bytes: u64,
    taken: Vec<Span>,
}

impl Room {
    fn is_free(&self, [first, last]: Span) -> bool {
        let apart = |taken: &Span| taken[1] < first || last < taken[0];
        self.taken.iter().all(apart)
    }

    fn takes_turns(&self) -> bool {
        match self.home {
            Home::In { host, .. } => buffers::row(host.1).is_some_and(BufferRow::takes_turns),
            _ => false,
        }
    }
}

/// Places the buffers of a plan. `held`: buffers with memory of their own, whichever plan needs it, and its bytes.
#[must_use]
pub fn settle(
    uses: &BTreeMap<Place, Use>,
    held: impl IntoIterator<Item = (Place, u64)>,
    image: &ImageLayout,
    maps: &[MapLayout],
) -> Homes {
    // What other plans keep for readers after a frame is read before a frame of this one begins.
    let idle = held.into_iter().filter(|(place, _)| {
        let is_within = |row: &BufferRow| row.holds == Holds::Within && !row.is_scratch();
        !uses.contains_key(place) && buffers::row(place.1).is_some_and(is_within)
    });
    let idle = idle.map(|(host, bytes)| Room {
        home: Home::In {
            host,
            is_before: false,
        },
        bytes,
        taken: Vec::new(),
    });
    let mut rooms: Vec<_> = idle.collect();
    let mut guests = Vec::new();
    for (&place, usage) in uses {
        // Shares of the paths are kept from frame to frame.
        let is_kept = matches!(place.0, Whose::Batch(kind, _)
            if maps.iter().any(|map| map.config.kind == kind && map.keeps_batches()));
        let row = buffers::row(place.1).filter(|row| row.holds != Holds::Always && !is_kept);
        let Some(row) = row else { continue };
        let Some(bytes) = usage.bytes(row, place.0, image, maps) else {
            continue;
        };
        let bytes = allocated_bytes(bytes.max(usage.most_bytes));
        let now = usage.now.filter(|_| !usage.is_read_first).unwrap_or(ALWAYS);
        let mut room = |is_before, taken| {
            let home = Home::In {
                host: place,
                is_before,
            };
            let taken = vec![taken];
            rooms.push(Room { home, bytes, taken });
        };
        match row.holds {
            Holds::Turns => {
                room(false, [now[0], u32::MAX]);
                room(true, [0, usage.before.map_or(u32::MAX, |before| before[1])]);
            }
            Holds::Within if now == ALWAYS => {}
            Holds::Within if usage.is_kept => room(false, [now[0], u32::MAX]),
            Holds::Always => {}
            Holds::Within => guests.push((place, row, bytes, now)),
        }
    }
    // The largest first: a smaller one finds room in what they leave. Images before photons' scratch, so that where they lie does
    // not depend on the number of photons.
    guests.sort_by_key(|&(place, row, bytes, [first, _])| {
        (row.is_scratch(), std::cmp::Reverse(bytes), first, place)
    });
    let mut homes = Homes::default();
    for (place, row, bytes, span) in guests {
        let has_room = |room: &&mut Room| {
            // A clear does not know whose turn it is.
            let is_apart = row.cleared.is_empty() || !room.takes_turns();
            is_apart && room.bytes >= bytes && room.is_free(span)
        };
        let smallest = rooms
            .iter_mut()
            .filter(has_room)
            .min_by_key(|room| room.bytes);
        let home = if let Some(room) = smallest {
            room.taken.push(span);
            room.home
        } else {
            let home = Home::Turn(homes.turn_bytes.len());
            homes.turn_bytes.push(bytes);
            let taken = vec![span];
            rooms.push(Room { home, bytes, taken });
            home
        };
        homes.of.insert(place, home);
    }
    homes
}
