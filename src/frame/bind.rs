//! Resolves the names that shaders declare to buffers, by owner and name, with six rules:
//!
//! 1. A step may rename.
//! 2. `dispatch` is the stage's table; scene and uniforms are given.
//! 3. `pixel_list`, `pixel_count` and `list_groups` are those of the step's list, `appended_list` and `appended_count` of the one
//!    that it appends to.
//! 4. Any other name belongs to the step's eye, its photon map, or the frame.
//! 5. `left_NAME` is the left eye's, `other_NAME` the other eye's.
//! 6. `NAME_before` is the previous frame's `NAME`, which is double-buffered.

use std::collections::BTreeMap;

use super::buffers::{self, BufferRow, Holds, ImageLayout, Moment, Scope, TOKEN_BYTES};
use super::homes::{Home, Homes, settle};
use super::photon_layout::{MapKind, MapLayout};
use super::step::{Eye, Owner};
use crate::gpu::buffers::{allocated_bytes, read_buffer};
use crate::gpu::kernel::BindingKind;
use crate::gpu::texels::TexelCopy;
use crate::gpu::{GpuContext, GpuError, Resources, storage_buffer};

/// Owner of a buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Whose {
    /// An eye.
    Eye(Eye),
    /// The frame.
    Frame,
    /// A photon map.
    Map(MapKind),
    /// A batch of a photon map's paths.
    Batch(MapKind, u32),
}

/// A buffer by owner and name.
pub type Place = (Whose, &'static str);

/// What a name of a shader resolves to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Meaning {
    /// The buffer.
    pub place: Place,
    /// Whether it is the previous frame's.
    pub is_before: bool,
}

/// Resolves `name` for `owner` by rules 4 to 6; `None` if there is no such buffer.
#[must_use]
pub fn meaning(name: &str, owner: Owner) -> Option<Meaning> {
    if let Some(row) = buffers::row(name) {
        return Some(Meaning {
            place: (whose(row, owner), row.name),
            is_before: false,
        });
    }
    let of_eye = |name, eye| meaning(name, Owner { eye, ..owner });
    if let Some(rest) = name.strip_prefix("left_") {
        return of_eye(rest, Eye::Left);
    }
    if let Some(rest) = name.strip_prefix("other_") {
        return of_eye(rest, owner.eye.other());
    }
    let now = meaning(name.strip_suffix("_before")?, owner)?;
    buffers::row(now.place.1)?.takes_turns().then_some(Meaning {
        is_before: true,
        ..now
    })
}

/// Who owns the buffer of a row in a step of `owner`.
pub(super) fn whose(row: &BufferRow, owner: Owner) -> Whose {
    match row.scope {
        Scope::Eye(_) => Whose::Eye(owner.eye),
        Scope::Frame(_) => Whose::Frame,
        Scope::Map(_) => Whose::Map(owner.map),
        Scope::Batch(_) => Whose::Batch(owner.map, owner.batch),
    }
}

/// How a buffer is used by the passes of a plan.
#[derive(Debug, Clone, Copy, Default)]
pub struct Use {
    /// A pass writes it.
    pub is_written: bool,
    /// A pass reads its copy in a texture.
    pub is_copied: bool,
    /// The first pass that is bound to it only reads it: it holds something from before.
    pub is_read_first: bool,
    /// It is read after the frame, and keeps its place whatever else there is.
    pub is_kept: bool,
    /// Bytes that it had to have some time: its place is chosen as if it still had, so that it stays where it is.
    pub most_bytes: u64,
    /// Moments of the first and the last step that use this frame's, and the previous frame's ([`super::homes::moments`]).
    pub now: Option<[u32; 2]>,
    /// The same of the previous frame's.
    pub before: Option<[u32; 2]>,
}

impl Use {
    /// Adds a binding of a step at moment `at`; steps come in order.
    pub fn add(&mut self, kind: BindingKind, is_before: bool, at: u32) {
        let is_written = kind == BindingKind::ReadWrite;
        self.is_written |= is_written;
        self.is_copied |= kind == BindingKind::Texels;
        self.is_read_first |= !is_before && self.now.is_none() && !is_written;
        let span = if is_before {
            &mut self.before
        } else {
            &mut self.now
        };
        *span = Some(span.map_or([at, at], |[first, last]| [first.min(at), last.max(at)]));
    }

    /// Adds a step without a pass at moment `at`, such as a clear.
    pub fn touch(&mut self, at: u32) {
        if let Some([first, last]) = &mut self.now {
            self.is_read_first &= *first <= at;
            (*first, *last) = ((*first).min(at), (*last).max(at));
        }
    }

    /// Bytes of the buffer; `None` for one that is declared and never written.
    pub fn bytes(
        self,
        row: &BufferRow,
        whose: Whose,
        image: &ImageLayout,
        maps: &[MapLayout],
    ) -> Option<u64> {
        (self.is_written || row.host_writes).then(|| bytes_of(row, whose, image, maps))
    }
}

/// The buffer's name for people.
#[must_use]
pub fn label((whose, name): Place) -> String {
    let owner = match whose {
        Whose::Eye(eye) => eye.name(),
        Whose::Frame => "shared",
        Whose::Map(kind) | Whose::Batch(kind, _) => kind.label(),
    };
    format!("{owner} {}", name.replace('_', " "))
}

struct Held {
    /// Whether it is declared but never written.
    is_token: bool,
    /// Bytes that the plan in use needs of it; it may have more.
    bytes: u64,
    /// One, or one for frames of either parity.
    turns: Vec<wgpu::Buffer>,
}

/// The frame's buffers.
#[derive(Default)]
pub struct Buffers {
    held: BTreeMap<Place, Held>,
    /// Those that have no memory of their own with the plan in use.
    guests: BTreeMap<Place, Held>,
    /// Memory that images use in turn.
    in_turn: Vec<wgpu::Buffer>,
    /// Most bytes that plans needed of each buffer.
    most_bytes: BTreeMap<Place, u64>,
    texels: BTreeMap<Place, TexelCopy>,
    /// Whether all have memory of their own.
    apart: bool,
}

impl Buffers {
    /// Allocates all that is used. Buffers that exist and are large enough stay, with their contents; what holds data within a
    /// frame alone may lie elsewhere afterwards.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`], [`GpuError::Validation`]: a buffer does not fit the adapter.
    pub fn allocate(
        &mut self,
        context: &GpuContext,
        uses: &BTreeMap<Place, Use>,
        image: &ImageLayout,
        maps: &[MapLayout],
    ) -> Result<(), GpuError> {
        let mut uses = uses.clone();
        for (place, usage) in &mut uses {
            let row = buffers::row(place.1).filter(|row| row.holds != Holds::Always);
            if row.is_some_and(BufferRow::is_scratch) && self.most_bytes.contains_key(place) {
                // Without photons nothing writes it, and nothing is read of it; its place will do.
                (usage.is_written, usage.is_read_first) = (true, false);
            }
            if let Some(bytes) = row.and_then(|row| usage.bytes(row, place.0, image, maps)) {
                let most = self.most_bytes.entry(*place).or_default();
                *most = bytes.max(*most);
                usage.most_bytes = *most;
            }
        }
        let homes = match self.apart {
            true => Homes::default(),
            false => {
                let held = self.held.iter().filter(|(_, held)| !held.is_token);
                let held = held.map(|(&place, held)| (place, held.turns[0].size()));
                settle(&uses, held, image, maps)
            }
        };
        for (index, &bytes) in homes.turn_bytes.iter().enumerate() {
            let make = || storage_buffer(context, &label_in_turn(index), bytes);
            match self.in_turn.get_mut(index) {
                Some(held) if held.size() >= bytes => {}
                Some(held) => *held = make()?,
                None => self.in_turn.push(make()?),
            }
        }
        let known = uses.iter().filter_map(|(&place, usage)| {
            let row = buffers::row(place.1)?;
            let bytes = usage.bytes(row, place.0, image, maps);
            Some((place, homes.of(&place), row, bytes))
        });
        // Hosts before their guests.
        let (own, guests): (Vec<_>, Vec<_>) = known.partition(|known| known.1 == Home::Own);
        for (place, _, row, bytes) in own {
            self.hold(context, place, row, bytes)?;
        }
        let guests = guests.into_iter().map(|(place, home, _, bytes)| {
            let held = Held {
                is_token: false,
                bytes: allocated_bytes(bytes.unwrap_or(TOKEN_BYTES)),
                turns: self.memory(home),
            };
            (place, held)
        });
        self.guests = guests.collect();
        for (&place, _) in uses.iter().filter(|(_, usage)| usage.is_copied) {
            let most = self.most_bytes.get(&place).copied();
            let own = self.held.get(&place).map_or(0, |held| held.turns[0].size());
            let bytes = most.map_or(own, allocated_bytes);
            let copy = self.texels.entry(place).or_insert(TexelCopy::new(place.1));
            copy.fit(context, bytes)?;
        }
        Ok(())
    }

    fn find(&self, place: &Place) -> Option<&Held> {
        self.guests.get(place).or_else(|| self.held.get(place))
    }

    /// Gives images that would share memory their own from the next allocation on.
    #[cfg(feature = "internals")]
    pub fn keep_apart(&mut self) {
        self.apart = true;
    }

    /// What lies where a guest is to lie: one buffer, or one for frames of either parity.
    fn memory(&self, home: Home) -> Vec<wgpu::Buffer> {
        match home {
            Home::Own => Vec::new(),
            Home::Turn(index) => self.in_turn.get(index).cloned().into_iter().collect(),
            Home::In { host, is_before } => {
                let held = self.held.get(&host);
                let mut turns = held.map_or(Vec::new(), |held| held.turns.clone());
                if is_before {
                    turns.reverse();
                }
                turns
            }
        }
    }

    /// Gives buffers that no plan uses a token, so that they can be bound.
    ///
    /// # Errors
    /// As [`Buffers::allocate`].
    pub fn give_tokens<'u>(
        &mut self,
        context: &GpuContext,
        places: impl IntoIterator<Item = &'u Place>,
    ) -> Result<(), GpuError> {
        for &place in places {
            if let Some(row) = buffers::row(place.1).filter(|_| self.find(&place).is_none()) {
                self.hold(context, place, row, None)?;
            }
        }
        Ok(())
    }

    fn hold(
        &mut self,
        context: &GpuContext,
        place: Place,
        row: &BufferRow,
        bytes: Option<u64>,
    ) -> Result<(), GpuError> {
        let fits = |held: &Held| {
            let fits = |bytes| !held.is_token && held.turns[0].size() >= allocated_bytes(bytes);
            bytes.is_none_or(fits)
        };
        if let Some(held) = self.held.get_mut(&place).filter(|held| fits(held)) {
            held.bytes = bytes.map_or(held.bytes, allocated_bytes);
            return Ok(());
        }
        let is_token = bytes.is_none();
        let bytes = bytes.unwrap_or(TOKEN_BYTES);
        let label = label(place);
        let turns = (0..row.turns()).map(|_| storage_buffer(context, &label, bytes));
        let turns = turns.collect::<Result<Vec<_>, GpuError>>()?;
        let held = Held {
            is_token,
            bytes: allocated_bytes(bytes),
            turns,
        };
        self.held.insert(place, held);
        Ok(())
    }

    /// Gives images that no plan uses memory of their own; they are forgotten with the others ([`Buffers::forget_images`]).
    ///
    /// # Errors
    /// As [`Buffers::allocate`].
    pub fn hold_images(
        &mut self,
        context: &GpuContext,
        places: &[Place],
        image: &ImageLayout,
    ) -> Result<(), GpuError> {
        for &place in places {
            if let Some(row) = buffers::row(place.1) {
                let bytes = bytes_of(row, place.0, image, &[]);
                self.hold(context, place, row, Some(bytes))?;
            }
        }
        Ok(())
    }

    /// Bytes that all buffers have on the device, copies in textures aside.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let own = self.held.values().flat_map(|held| &held.turns);
        own.chain(&self.in_turn).map(wgpu::Buffer::size).sum()
    }

    /// Whether a buffer is another one in every other frame.
    #[must_use]
    pub fn takes_turns(&self, place: &Place) -> bool {
        self.find(place).is_some_and(|held| held.turns.len() > 1)
    }

    /// Drops the images of the eyes, for another size.
    pub fn forget_images(&mut self) {
        let is_of_map = |whose: &Whose| matches!(whose, Whose::Map(_) | Whose::Batch(..));
        self.held.retain(|(whose, _), _| is_of_map(whose));
        self.texels.retain(|(whose, _), _| is_of_map(whose));
        self.most_bytes.retain(|(whose, _), _| is_of_map(whose));
        self.guests.clear();
        self.in_turn.clear();
    }

    /// The buffer in frames of `parity` (0 or 1); `None` if no pass uses it.
    #[must_use]
    pub fn get(&self, meaning: &Meaning, parity: usize) -> Option<&wgpu::Buffer> {
        let held = self.find(&meaning.place)?;
        let turn = parity ^ usize::from(meaning.is_before);
        held.turns.get(turn).or_else(|| held.turns.first())
    }

    /// As [`Buffers::get`], to be bound. Of a photon map's buffers only what its layout needs: shaders ask how long they are.
    #[must_use]
    pub fn bound(&self, meaning: &Meaning, parity: usize) -> Option<wgpu::BindingResource<'_>> {
        let buffer = self.get(meaning, parity)?;
        let size = match meaning.place.0 {
            Whose::Map(_) | Whose::Batch(..) => self.find(&meaning.place)?.bytes,
            Whose::Eye(_) | Whose::Frame => buffer.size(),
        };
        Some(wgpu::BindingResource::Buffer(wgpu::BufferBinding {
            buffer,
            offset: 0,
            size: wgpu::BufferSize::new(size),
        }))
    }

    /// The texture copy of a buffer, if a pass reads it.
    #[must_use]
    pub fn texels(&self, meaning: &Meaning) -> Option<&TexelCopy> {
        self.texels.get(&meaning.place)
    }

    /// Binds those of `names` that exist for `owner`, for passes outside the frame's plan.
    #[must_use]
    pub fn give<'a>(
        &'a self,
        given: Resources<'a>,
        owner: Owner,
        names: &[&'static str],
    ) -> Resources<'a> {
        names.iter().fold(given, |given, name| {
            let Some(found) = meaning(name, owner) else {
                return given;
            };
            let view = self.texels(&found).and_then(TexelCopy::view);
            match (view, self.get(&found, 0)) {
                (Some(view), _) => given.with_texture(name, view),
                (None, Some(buffer)) => given.with(name, buffer),
                (None, None) => given,
            }
        })
    }

    /// Buffers of `owner` that are zeroed at `moment`, and how many bytes of each.
    pub fn cleared(
        &self,
        moment: Moment,
        owner: Owner,
    ) -> impl Iterator<Item = (wgpu::Buffer, u64)> {
        let rows = buffers::BUFFERS.iter();
        rows.filter(move |row| row.cleared.contains(&moment))
            .filter_map(move |row| self.find(&(whose(row, owner), row.name)))
            .flat_map(|held| held.turns.iter().map(|turn| (turn.clone(), held.bytes)))
    }

    /// Whether a pass writes a buffer that holds nothing after the frame.
    pub fn is_spent(&self, place: &Place) -> bool {
        self.guests.contains_key(place)
    }

    /// Reads the first `count` elements of a buffer back; `None` if no pass writes it, or if it holds nothing after the frame.
    /// Waits for the device.
    ///
    /// # Errors
    /// As [`read_buffer`].
    pub fn read<T: bytemuck::Pod>(
        &self,
        context: &GpuContext,
        (whose, name): Place,
        parity: usize,
        count: usize,
    ) -> Result<Option<Vec<T>>, GpuError> {
        let place = (whose, name);
        let held = self.held.get(&place).filter(|held| !held.is_token);
        let Some(held) = held.filter(|_| !self.is_spent(&place)) else {
            return Ok(None);
        };
        let buffer = &held.turns[parity % held.turns.len()];
        read_buffer(context, &name.replace('_', " "), buffer, count).map(Some)
    }

    /// Bytes of a buffer, one turn of it; 0 if no pass writes it.
    pub fn bytes_of(&self, place: &Place) -> u64 {
        let held = self.find(place).filter(|held| !held.is_token);
        held.map_or(0, |held| held.bytes)
    }

    /// A buffer that takes no turns; `None` if no pass writes it.
    pub fn written(&self, place: Place) -> Option<&wgpu::Buffer> {
        let held = self.held.get(&place).filter(|held| !held.is_token);
        held.and_then(|held| held.turns.first())
    }

    /// Writes to the start of a buffer, if a pass uses it.
    pub fn write(&self, context: &GpuContext, place: Place, data: &[u8]) {
        if let Some(held) = self.held.get(&place) {
            context.queue.write_buffer(&held.turns[0], 0, data);
        }
    }
}

/// Bytes on the device of buffers with memory of their own, both of those that take turns and copies in textures with it; and
/// of memory that images use in turn.
#[derive(Debug, Clone, Default)]
pub struct BytesHeld {
    /// Of each buffer.
    pub own: BTreeMap<Place, u64>,
    /// Of each memory that images use in turn.
    pub in_turn: Vec<u64>,
}

impl BytesHeld {
    /// Adds what [`Buffers::allocate`] would allocate for one more plan.
    pub fn add(&mut self, uses: &BTreeMap<Place, Use>, image: &ImageLayout, maps: &[MapLayout]) {
        let held = self.own.iter().map(|(&place, &bytes)| (place, bytes));
        let homes = settle(uses, held, image, maps);
        for (&(whose, name), usage) in uses {
            let Some(row) = buffers::row(name) else {
                continue;
            };
            let bytes = usage.bytes(row, whose, image, maps).unwrap_or(TOKEN_BYTES);
            let own = match homes.of(&(whose, name)) {
                Home::Own => row.turns(),
                _ => 0,
            };
            let bytes = allocated_bytes(bytes) * (own + u64::from(usage.is_copied));
            if bytes > 0 {
                let held = self.own.entry((whose, name)).or_default();
                *held = bytes.max(*held);
            }
        }
        let most = homes.turn_bytes.len().max(self.in_turn.len());
        self.in_turn.resize(most, 0);
        for (held, bytes) in self.in_turn.iter_mut().zip(homes.turn_bytes) {
            *held = bytes.max(*held);
        }
    }
}

/// What memory that images use in turn is called.
#[must_use]
pub fn label_in_turn(index: usize) -> String {
    format!("images in turn {}", index + 1)
}

fn bytes_of(row: &BufferRow, whose: Whose, image: &ImageLayout, maps: &[MapLayout]) -> u64 {
    let of_map = |bytes: fn(&MapLayout) -> u64| {
        let (Whose::Map(kind) | Whose::Batch(kind, _)) = whose else {
            return TOKEN_BYTES;
        };
        let map = maps.iter().find(|map| map.config.kind == kind);
        map.map_or(TOKEN_BYTES, bytes)
    };
    match row.scope {
        Scope::Eye(bytes) | Scope::Frame(bytes) => bytes(image),
        Scope::Map(bytes) | Scope::Batch(bytes) => of_map(bytes),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_follow_the_rules() {
        let owner = Owner {
            eye: Eye::Right,
            map: MapKind::Caustics,
            batch: 2,
        };
        let of = |name| meaning(name, owner).map(|found| found.place);
        assert_eq!(of("hit_rays"), Some((Whose::Eye(Eye::Right), "hit_rays")));
        assert_eq!(
            of("left_hit_rays"),
            Some((Whose::Eye(Eye::Left), "hit_rays"))
        );
        assert_eq!(
            of("other_moments"),
            Some((Whose::Eye(Eye::Left), "moments"))
        );
        assert_eq!(of("provenance"), Some((Whose::Frame, "provenance")));
        assert_eq!(
            of("photons"),
            Some((Whose::Map(MapKind::Caustics), "photons"))
        );
        let batch = Whose::Batch(MapKind::Caustics, 2);
        assert_eq!(of("path_counts"), Some((batch, "path_counts")));
        let before = meaning("anti_aliased_before", owner).unwrap();
        assert!(before.is_before && before.place.1 == "anti_aliased");
        // Only what takes turns has a before.
        assert_eq!(of("motion_before"), None);
        assert_eq!(of("no_such_buffer"), None);
    }
}
