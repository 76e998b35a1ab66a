//! Samples over the displacement: averages on the way out and on the way back, in bins of equal width.

use nalgebra::Vector3;
use serde::Serialize;

/// Number of bins from end to end.
const BINS: u16 = 96;

/// Speed below which a sample belongs to neither way, as a share of the reach per second.
const MIN_SPEED: f64 = 0.01;

/// Felt and commanded forces at one displacement, along the axis: negative where it acts towards negative values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Felt {
    /// Force or moment on the hand.
    pub total: f64,
    /// Return to centre that the controller commanded.
    pub centring: f64,
    /// Damping that it commanded.
    pub damping: f64,
}

/// One displacement.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Point {
    /// Displacement, in m or rad.
    pub x: f64,
    /// The law's return to centre.
    pub law: f64,
    /// Return to centre that the controller commanded, mean of both ways.
    pub commanded: f64,
    /// Force or moment on the hand on the way out, in N or N·m.
    pub felt_out: f64,
    /// The same on the way back.
    pub felt_back: f64,
    /// Commanded damping: half the difference of both ways.
    pub damping: f64,
}

impl Point {
    /// Returns the mean of both ways: friction and damping cancel.
    pub const fn felt(&self) -> f64 {
        f64::midpoint(self.felt_out, self.felt_back)
    }

    /// Returns the width of the hysteresis: resistance on the way out less that on the way back.
    pub fn hysteresis(&self) -> f64 {
        (self.felt_back - self.felt_out) * self.x.signum()
    }
}

/// Sums of one way through one bin.
#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    count: f64,
    felt: Vector3<f64>,
}

impl Sum {
    fn add(&mut self, felt: &Felt) {
        self.count += 1.0;
        self.felt += Vector3::new(felt.total, felt.centring, felt.damping);
    }

    fn mean(&self) -> Option<Felt> {
        let [total, centring, damping] = (self.felt / self.count).into();
        (self.count > 0.0).then_some(Felt { total, centring, damping })
    }
}

/// Samples in bins.
#[derive(Clone, Debug)]
pub struct Bins {
    reach: f64,
    /// Way out and way back of each bin.
    sums: Vec<[Sum; 2]>,
}

impl Bins {
    /// Creates empty bins over displacements of at most `reach` to both sides.
    pub fn new(reach: f64) -> Self {
        Self { reach, sums: vec![[Sum::default(); 2]; BINS.into()] }
    }

    /// Adds a sample at displacement `x`, which changes by `speed` per s.
    pub fn add(&mut self, x: f64, speed: f64, felt: &Felt) {
        let place = (x / self.reach + 1.0) / 2.0 * f64::from(BINS);
        if speed.abs() < MIN_SPEED * self.reach || !(0.0..f64::from(BINS)).contains(&place) {
            return;
        }
        let bin = (0..BINS).rfind(|bin| f64::from(*bin) <= place).map(usize::from);
        let Some([out, back]) = bin.and_then(|bin| self.sums.get_mut(bin)) else { return };
        let way = if x * speed > 0.0 { out } else { back };
        way.add(felt);
    }

    /// Returns the points that were crossed both ways; `law` is the curve to compare with.
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
                bins.add(x, speed, &Felt { total, ..Felt::default() });
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
        bins.add(0.5, 0.0, &Felt::default());
        bins.add(-1.2, 1.0, &Felt::default());
        bins.add(1.2, 1.0, &Felt::default());
        assert!(bins.points(|_| 0.0).is_empty());
    }
}
