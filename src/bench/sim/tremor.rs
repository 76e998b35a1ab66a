//! Tremor of the operator's hand: smooth, small, and determined by its seed.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use crate::random::SplitMix;

/// Amplitude and frequency of a tremor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shake {
    /// Maximum displacement per axis, in m.
    pub amplitude: f64,
    /// Lowest and highest frequency, in Hz.
    pub band: [f64; 2],
}

/// Waves per axis.
const WAVES: usize = 3;

/// Sum of waves of random frequency and phase on each axis.
#[derive(Clone, Copy, Debug)]
pub struct Tremor {
    amplitude: f64,
    waves: [[Wave; WAVES]; 3],
    t: f64,
}

#[derive(Clone, Copy, Debug, Default)]
struct Wave {
    frequency: f64,
    phase: f64,
}

impl Tremor {
    /// Creates the tremor of a seed.
    pub fn new(shake: Shake, seed: u64) -> Self {
        let Shake { amplitude, band: [slowest, fastest] } = shake;
        let mut random = SplitMix::new(seed);
        let mut waves = [[Wave::default(); WAVES]; 3];
        for wave in waves.as_flattened_mut() {
            let frequency = slowest + (fastest - slowest) * random.unit();
            *wave = Wave { frequency, phase: TAU * random.unit() };
        }
        Self { amplitude, waves, t: 0.0 }
    }

    /// Advances by `dt` s and returns the displacement, in m.
    pub fn next(&mut self, dt: f64) -> Vector3<f64> {
        self.t += dt;
        let axis = |waves: &[Wave; WAVES]| {
            let wave = |wave: &Wave| (TAU * wave.frequency * self.t + wave.phase).sin();
            self.amplitude / 3.0 * waves.iter().map(wave).sum::<f64>()
        };
        let [x, y, z] = &self.waves;
        Vector3::new(axis(x), axis(y), axis(z))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AMPLITUDE: f64 = 0.2e-3;

    fn path(seed: u64) -> Vec<Vector3<f64>> {
        let mut tremor = Tremor::new(Shake { amplitude: AMPLITUDE, band: [6.0, 12.0] }, seed);
        (0..1_000).map(|_| tremor.next(1e-3)).collect()
    }

    #[test]
    fn seed_determines_the_tremor() {
        assert_eq!(path(7), path(7));
        assert_ne!(path(7), path(8));
    }

    #[test]
    fn tremor_is_small_and_smooth() {
        let path = path(1);
        assert!(path.iter().all(|place| place.amax() <= AMPLITUDE));
        assert!(path.windows(2).all(|pair| (pair[1] - pair[0]).amax() < 0.1 * AMPLITUDE));
    }
}
