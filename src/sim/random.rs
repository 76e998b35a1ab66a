//! Numbers that look random and are the same again from the same seed.

/// SplitMix64 (Steele et al. 2014).
pub(super) struct SplitMix(pub(super) u64);

impl SplitMix {
    /// The next number in 0 to 1.
    pub(super) fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        let [.., a, b, c, d] = z.to_le_bytes();
        f64::from(u32::from_le_bytes([a, b, c, d])) / f64::from(u32::MAX)
    }

    /// The next of a normal distribution of mean 0 and variance 1, near enough: the sum of twelve.
    pub(super) fn next_normal(&mut self) -> f64 {
        (0..12).map(|_| self.next()).sum::<f64>() - 6.0
    }
}
