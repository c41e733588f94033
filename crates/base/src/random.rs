//! Random numbers that are the same everywhere: SplitMix64 (Steele, Lea and Flood 2014, "Fast splittable pseudorandom number
//! generators", figure 16). The state begins as the seed.

/// The next 64 random bits.
pub fn bits(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The next number, uniform in [0, 1).
pub fn unit(state: &mut u64) -> f64 {
    (bits(state) >> 11) as f64 / (1_u64 << 53) as f64
}
