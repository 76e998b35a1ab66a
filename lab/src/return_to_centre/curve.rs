//! Mean forces over the displacement, outwards and back, in bins of equal width.

use nalgebra::Vector3;
use serde::Serialize;

/// Number of bins from end to end.
const BINS: u16 = 96;

/// Minimum speed of a sample, as a share of the reach per second; slower ones have no direction.
const MIN_SPEED: f64 = 0.01;

/// Forces on the hand at one displacement, along the axis, in N or N·m; negative towards negative displacements.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ForceSample {
    /// Sum of all forces.
    pub total: f64,
    /// Return to centre commanded by the controller.
    pub centring: f64,
    /// Damping commanded by the controller.
    pub damping: f64,
}

/// Point of the curve; forces in N, moments in N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Point {
    /// Displacement, in m or rad.
    pub x: f64,
    /// Return to centre of the law (Eq. 8).
    pub law: f64,
    /// Return to centre commanded by the controller, mean of both directions.
    pub commanded: f64,
    /// Force or moment on the hand while it moves outwards.
    pub felt_out: f64,
    /// Force or moment on the hand while it moves back.
    pub felt_back: f64,
    /// Commanded damping: half the difference of both directions.
    pub damping: f64,
}

impl Point {
    /// Returns the mean of both directions: friction and damping cancel.
    pub const fn felt(&self) -> f64 {
        f64::midpoint(self.felt_out, self.felt_back)
    }

    /// Returns the width of the hysteresis: resistance outwards minus resistance back.
    pub fn hysteresis(&self) -> f64 {
        (self.felt_back - self.felt_out) * self.x.signum()
    }
}

/// Sums of the samples of one bin in one direction.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    count: f64,
    felt: Vector3<f64>,
}

impl Sum {
    fn add(&mut self, felt: &ForceSample) {
        self.count += 1.0;
        self.felt += Vector3::new(felt.total, felt.centring, felt.damping);
    }

    fn mean(&self) -> Option<ForceSample> {
        let [total, centring, damping] = (self.felt / self.count).into();
        (self.count > 0.0).then_some(ForceSample { total, centring, damping })
    }
}

/// Samples binned by displacement and direction.
#[derive(Clone, Debug)]
pub struct Bins {
    reach: f64,
    /// Sums of each bin, outwards and back.
    sums: Vec<[Sum; 2]>,
}

impl Bins {
    /// Creates empty bins over the displacements from -`reach` to `reach`, in m or rad.
    pub fn new(reach: f64) -> Self {
        Self { reach, sums: vec![[Sum::default(); 2]; BINS.into()] }
    }

    /// Adds a sample at displacement `x` and rate `speed`, in m and m/s or rad and rad/s.
    pub fn add(&mut self, x: f64, speed: f64, felt: &ForceSample) {
        let place = (x / self.reach + 1.0) / 2.0 * f64::from(BINS);
        if speed.abs() < MIN_SPEED * self.reach || !(0.0..f64::from(BINS)).contains(&place) {
            return;
        }
        let bin = (0..BINS).rfind(|bin| f64::from(*bin) <= place).map(usize::from);
        let Some([out, back]) = bin.and_then(|bin| self.sums.get_mut(bin)) else { return };
        let way = if x * speed > 0.0 { out } else { back };
        way.add(felt);
    }

    /// Returns the points of the bins with samples in both directions; `law` is the curve to compare with.
    pub fn points(&self, law: impl Fn(f64) -> f64) -> Vec<Point> {
        let width = 2.0 * self.reach / f64::from(BINS);
        let bins = (0..BINS).zip(&self.sums).filter_map(|(bin, [out, back])| {
            let x = (f64::from(bin) + 0.5) * width - self.reach;
            let (out, back) = (out.mean()?, back.mean()?);
            Some(Point {
                x,
                law: law(x),
                commanded: f64::midpoint(out.centring, back.centring),
                felt_out: out.total,
                felt_back: back.total,
                damping: (back.damping - out.damping) / 2.0 * x.signum(),
            })
        });
        bins.collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn friction_cancels_in_the_mean_and_is_the_hysteresis() {
        let mut bins = Bins::new(1.0);
        for step in -99..=99_i32 {
            for speed in [0.5, -0.5_f64] {
                let x = f64::from(step) / 100.0;
                // A return of 2 to the centre, and friction of 0.3 against the motion.
                let total = -2.0 * x.signum() - 0.3 * speed.signum();
                bins.add(x, speed, &ForceSample { total, ..ForceSample::default() });
            }
        }
        let points = bins.points(|x| -2.0 * x.signum());
        assert_eq!(points.len(), usize::from(BINS));
        for point in points.iter().filter(|point| point.x.abs() > 0.02) {
            assert!((point.felt() - point.law).abs() < 1e-12, "{point:?}");
            assert!((point.hysteresis() - 0.6).abs() < 1e-12, "{point:?}");
        }
    }

    #[test]
    fn samples_at_rest_or_beyond_the_reach_are_left_out() {
        let mut bins = Bins::new(1.0);
        bins.add(0.5, 0.0, &ForceSample::default());
        bins.add(-1.2, 1.0, &ForceSample::default());
        bins.add(1.2, 1.0, &ForceSample::default());
        assert!(bins.points(|_| 0.0).is_empty());
    }
}
