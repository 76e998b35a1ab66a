//! Force/torque sensor: cross-talk, bias, drift, noise, saturation and quantisation of a true wrench.
//!
//! The wrench acts on the body beyond the sensor. Readings are always finite: an axis whose value is not finite keeps
//! its last reading.

use units::spatial::Wrench;

use crate::random::SplitMix;

/// Errors of a sensor; the components are those of a wrench, in N and N·m. [`Default`] is an ideal sensor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WristSensorSettings {
    /// Reading per true component, a row for each reading.
    pub cross_talk: [[f64; 6]; 6],
    /// Constant error.
    pub bias: [f64; 6],
    /// Standard deviation of the random walk after 1 s.
    pub drift: [f64; 6],
    /// Standard deviation of the noise of one reading.
    pub noise: [f64; 6],
    /// Step of the readings; zero for none.
    pub resolution: [f64; 6],
    /// Largest magnitude of a reading.
    pub range: [f64; 6],
}

impl WristSensorSettings {
    /// Ideal sensor, which reads the true wrench.
    pub const IDEAL: Self = Self {
        cross_talk: [
            [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
        ],
        bias: [0.0; 6],
        drift: [0.0; 6],
        noise: [0.0; 6],
        resolution: [0.0; 6],
        range: [f64::INFINITY; 6],
    };
}

impl Default for WristSensorSettings {
    fn default() -> Self {
        Self::IDEAL
    }
}

/// Force/torque sensor with its errors.
#[derive(Clone, Copy, Debug)]
pub struct WristSensor {
    settings: WristSensorSettings,
    /// Random walk so far.
    drifted: [f64; 6],
    last: [f64; 6],
    random: SplitMix,
}

impl WristSensor {
    /// Creates a sensor whose noise and drift follow from `seed`.
    pub const fn new(settings: WristSensorSettings, seed: u64) -> Self {
        Self { settings, drifted: [0.0; 6], last: [0.0; 6], random: SplitMix::new(seed) }
    }

    /// Returns the reading of the true wrench `f_s`, `dt` s after the one before.
    pub fn read(&mut self, f_s: &Wrench, dt: f64) -> Wrench {
        let truth = f_s.components();
        let Self { settings, drifted, last, random } = self;
        let step = dt.max(0.0).sqrt();
        let errors = settings.bias.iter().zip(&settings.drift).zip(&settings.noise);
        let limits = settings.resolution.iter().zip(&settings.range);
        let axes = settings.cross_talk.iter().zip(errors).zip(limits);
        let states = drifted.iter_mut().zip(last.iter_mut());
        for (((row, ((bias, drift), noise)), (resolution, range)), (drifted, last)) in
            axes.zip(states)
        {
            // Both are drawn in any case, so that one error does not change another's numbers.
            let (walk, jitter) = (random.normal(), random.normal());
            *drifted += drift * step * walk;
            let mixed: f64 =
                row.iter().zip(&truth).map(|(share, value)| product(*share, *value)).sum();
            let value = mixed + bias + *drifted + noise * jitter;
            if !value.is_nan() {
                *last = quantised(value.clamp(-range.abs(), range.abs()), *resolution);
            }
        }
        Wrench::from_components(*last)
    }
}

/// Multiplies; a share of zero takes nothing of a value that is not finite.
fn product(share: f64, value: f64) -> f64 {
    if share.abs() > 0.0 { share * value } else { 0.0 }
}

/// Rounds to the nearest multiple of `resolution`.
fn quantised(value: f64, resolution: f64) -> f64 {
    let is_stepped = resolution > 0.0 && value.is_finite();
    if is_stepped { (value / resolution).round() * resolution } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    const F_S: Wrench = Wrench::from_components([10.0, -20.0, 3.0, 0.5, -0.2, 0.1]);

    fn sensor(settings: WristSensorSettings) -> WristSensor {
        WristSensor::new(settings, 7)
    }

    #[test]
    fn ideal_sensor_reads_the_truth() {
        assert_eq!(sensor(WristSensorSettings::IDEAL).read(&F_S, 1e-3), F_S);
    }

    #[test]
    fn bias_and_cross_talk_add_to_the_truth() {
        let mut settings = WristSensorSettings::IDEAL;
        settings.bias = [1.0, 0.0, 0.0, 0.0, 0.0, -0.3];
        settings.cross_talk[2][0] = 0.02;
        let read = sensor(settings).read(&F_S, 1e-3).components();
        let expected = [11.0, -20.0, 3.2, 0.5, -0.2, -0.2];
        assert!(read.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{read:?}");
    }

    #[test]
    fn noise_has_its_standard_deviation_and_drift_grows_as_a_root() {
        let noisy = WristSensorSettings { noise: [0.5; 6], ..WristSensorSettings::IDEAL };
        let mut noisy = sensor(noisy);
        let readings: Vec<f64> =
            (0..5_000).map(|_| noisy.read(&Wrench::ZERO, 1e-3).force.x).collect();
        let square = readings.iter().map(|value| value * value).sum::<f64>() / 5_000.0;
        assert!((square.sqrt() - 0.5).abs() < 0.02, "{}", square.sqrt());

        let settings = WristSensorSettings { drift: [0.2; 6], ..WristSensorSettings::IDEAL };
        let after = |seconds: f64, seed| {
            let mut sensor = WristSensor::new(settings, seed);
            let mut last = 0.0;
            for _ in 0..100 {
                last = sensor.read(&Wrench::ZERO, seconds / 100.0).force.x;
            }
            last * last
        };
        let spread =
            |seconds| ((0..400).map(|seed| after(seconds, seed)).sum::<f64>() / 400.0).sqrt();
        assert!((spread(1.0) - 0.2).abs() < 0.02, "{}", spread(1.0));
        assert!((spread(4.0) - 0.4).abs() < 0.04, "{}", spread(4.0));
    }

    #[test]
    fn readings_are_steps_within_the_range() {
        let mut settings = WristSensorSettings::IDEAL;
        settings.resolution = [0.25; 6];
        settings.range = [15.0; 6];
        let read = sensor(settings).read(&F_S, 1e-3);
        assert_eq!(read, Wrench::from_components([10.0, -15.0, 3.0, 0.5, -0.25, 0.0]));
    }

    #[test]
    fn reading_of_a_nan_is_the_one_before() {
        let mut sensor = sensor(WristSensorSettings::IDEAL);
        sensor.read(&F_S, 1e-3);
        let mut broken = F_S;
        broken.force.y = f64::NAN;
        broken.force.x = 11.0;
        let expected = Wrench::from_components([11.0, -20.0, 3.0, 0.5, -0.2, 0.1]);
        assert_eq!(sensor.read(&broken, 1e-3), expected);
        assert_eq!(sensor.read(&F_S, 1e-3), F_S);
    }

    #[test]
    fn seed_repeats_the_readings() {
        let settings =
            WristSensorSettings { noise: [0.1; 6], drift: [0.1; 6], ..WristSensorSettings::IDEAL };
        let read = |seed| WristSensor::new(settings, seed).read(&F_S, 1e-3);
        assert_eq!(read(3), read(3));
        assert!(read(3) != read(4));
    }
}
