//! Keys: what a figure depends on, in 128 bits.

use std::fmt;

use serde::Serialize;

/// FNV-1a of 128 bits (Fowler, Noll and Vo). No defence against forgery, which nobody gains from here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint(u128);

impl Default for Fingerprint {
    fn default() -> Self {
        Self(0x6c62_272e_07bb_0142_62b8_2175_6295_c58d)
    }
}

impl Fingerprint {
    /// Takes bytes in, with their number, so that two fields never run into each other.
    #[must_use]
    pub fn with(mut self, bytes: &[u8]) -> Self {
        for &byte in (bytes.len() as u64).to_le_bytes().iter().chain(bytes) {
            self.0 = (self.0 ^ u128::from(byte)).wrapping_mul((1 << 88) + 0x13b);
        }
        self
    }

    /// Takes text in.
    #[must_use]
    pub fn with_text(self, text: &str) -> Self {
        self.with(text.as_bytes())
    }

    /// Takes a value in as JSON.
    #[must_use]
    pub fn with_value(self, value: &impl Serialize) -> Self {
        // What cannot be written as JSON (a map with keys that are no text) is no part of any key here.
        self.with(&serde_json::to_vec(value).unwrap_or_default())
    }
}

impl fmt::Display for Fingerprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_byte_and_every_border_counts() {
        let of = |parts: &[&str]| {
            parts
                .iter()
                .fold(Fingerprint::default(), |hash, part| hash.with_text(part))
        };
        assert_eq!(of(&["a", "bc"]), of(&["a", "bc"]));
        assert_ne!(of(&["a", "bc"]), of(&["ab", "c"]));
        assert_ne!(of(&["a"]), of(&["b"]));
        assert_ne!(of(&[]), of(&[""]));
        assert_eq!(of(&[]).to_string().len(), 32);
    }
}
