//! The little a hand shakes: smooth, small, and the same again from the same seed.

use std::f64::consts::TAU;

use nalgebra::Vector3;

/// How far, in m, on each axis.
const AMPLITUDE: f64 = 0.2e-3;

/// Waves on each axis, between 6 and 12 Hz as physiological tremor is.
const WAVES: usize = 3;

/// A few waves of random frequency and phase on each axis.
#[derive(Clone, Copy, Debug)]
pub struct Tremor {
    waves: [[Wave; WAVES]; 3],
    t: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Wave {
    frequency: f64,
    phase: f64,
}

impl Tremor {
    /// The tremor of one seed.
    pub fn new(seed: u64) -> Self {
        let mut random = SplitMix(seed);
        let mut waves = [[Wave::default(); WAVES]; 3];
        for wave in waves.as_flattened_mut() {
            *wave = Wave { frequency: 6.0 + 6.0 * random.next(), phase: TAU * random.next() };
        }
        Self { waves, t: 0.0 }
    }

    /// Where the hand has shaken to after `dt` s more, in m.
    pub fn next(&mut self, dt: f64) -> Vector3<f64> {
        self.t += dt;
        let axis = |waves: &[Wave; WAVES]| {
            let wave = |wave: &Wave| (TAU * wave.frequency * self.t + wave.phase).sin();
            AMPLITUDE / 3.0 * waves.iter().map(wave).sum::<f64>()
        };
        let [x, y, z] = &self.waves;
        Vector3::new(axis(x), axis(y), axis(z))
    }
}

/// SplitMix64 (Steele et al. 2014).
struct SplitMix(u64);

impl SplitMix {
    /// The next number in 0 to 1.
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ z >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^= z >> 31;
        let [.., a, b, c, d] = z.to_le_bytes();
        f64::from(u32::from_le_bytes([a, b, c, d])) / f64::from(u32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(seed: u64) -> Vec<Vector3<f64>> {
        let mut tremor = Tremor::new(seed);
        (0..1_000).map(|_| tremor.next(1e-3)).collect()
    }

    #[test]
    fn one_seed_shakes_one_way() {
        assert_eq!(path(7), path(7));
        assert_ne!(path(7), path(8));
    }

    #[test]
    fn it_is_small_and_smooth() {
        let path = path(1);
        assert!(path.iter().all(|place| place.amax() <= AMPLITUDE));
        assert!(path.windows(2).all(|pair| (pair[1] - pair[0]).amax() < 0.1 * AMPLITUDE));
    }
}
