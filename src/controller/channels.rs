//! Channels: a deadband and a constant-force return to centre on each Cartesian axis (Fig. 4, 3.3, Eq. 8).
//!
//! The deadband separates six inputs of one hand; the return force marks its edge. [`assist`](crate::assist) combines
//! the axes to a wrench. The law is odd in the displacement, as in Fig. 4 and the text (decision 14). As printed, the
//! first line of Eq. 8 repels a hand on the negative side without bound.

use nalgebra::Vector3;
use thiserror::Error;

use crate::gains::{Gains, InvalidGain};
use crate::reference::Displacement;

/// Deadband, return force and wall of all six axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channels([Channel; 6]);

/// Channel of one axis, in m and N or in rad and N·m.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Channel {
    deadband: f64,
    plateau: f64,
    /// Return force is linear: the plateau at the edge of the deadband, and more beyond.
    is_spring: bool,
    wall: f64,
    stiffness: f64,
}

/// Reason why channels are invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidChannels {
    /// Value that is negative, too large or NaN.
    #[error(transparent)]
    Number(#[from] InvalidGain),
    /// Plateau without a deadband: a step at the centre.
    #[error("return to centre of {plateau} on axis {axis} needs a deadband to rise in")]
    Step {
        /// Cartesian axis, 1 to 6.
        axis: usize,
        /// Configured plateau, in N or N·m.
        plateau: f64,
    },
}

impl Channels {
    /// Creates channels from half-widths of the deadband (m, rad) and plateaus of the return force (N, N·m). In the
    /// paper's parabola, the constant `a` is the plateau over the deadband squared.
    ///
    /// # Errors
    /// Returns the first invalid value, or a plateau without a deadband.
    pub fn new(deadband: [f64; 6], plateau: [f64; 6]) -> Result<Self, InvalidChannels> {
        let deadband = Gains::new(deadband, "deadband")?;
        let plateau = Gains::new(plateau, "return to centre")?;
        let mut channels = [Channel::default(); 6];
        let pairs = deadband.values().iter().zip(plateau.values());
        for ((axis, channel), (&deadband, &plateau)) in (1..).zip(&mut channels).zip(pairs) {
            if plateau > 0.0 && deadband < f64::MIN_POSITIVE {
                return Err(InvalidChannels::Step { axis, plateau });
            }
            *channel = Channel { deadband, plateau, ..Channel::default() };
        }
        Ok(Self(channels))
    }

    /// Adds the third zone of Fig. 4: beyond `wall` (m, rad), a spring of `stiffness` (N/m, N·m/rad) in addition to the
    /// plateau. Off by default, as in the paper (decision 16).
    ///
    /// # Errors
    /// Returns the first invalid value.
    pub fn with_wall(self, wall: [f64; 6], stiffness: [f64; 6]) -> Result<Self, InvalidChannels> {
        let wall = Gains::new(wall, "wall")?;
        let stiffness = Gains::new(stiffness, "stiffness of the wall")?;
        let mut channels = self.0;
        let pairs = wall.values().iter().zip(stiffness.values());
        for (channel, (&wall, &stiffness)) in channels.iter_mut().zip(pairs) {
            *channel = Channel { wall, stiffness, ..*channel };
        }
        Ok(Self(channels))
    }

    /// Replaces the constant force by springs that reach the plateau at the edge of the deadband (3.3 compares both).
    #[must_use]
    pub fn as_springs(self) -> Self {
        Self(self.0.map(|channel| Channel { is_spring: true, ..channel }))
    }

    /// Removes the return force, so that only walls remain: they may mark the end of the workspace in pose mode (3.5).
    #[must_use]
    pub fn walls_only(self) -> Self {
        Self(self.0.map(|channel| Channel { plateau: 0.0, ..channel }))
    }

    /// Half-widths of the deadband, in m and rad.
    pub fn deadbands(&self) -> [f64; 6] {
        self.0.map(|channel| channel.deadband)
    }

    /// Plateaus of the return force, in N and N·m.
    pub fn plateaus(&self) -> [f64; 6] {
        self.0.map(|channel| channel.plateau)
    }

    /// Displacements at which walls begin, in m and rad; `None` without a wall.
    pub fn walls(&self) -> [Option<f64>; 6] {
        self.0.map(|channel| (channel.stiffness > 0.0).then_some(channel.wall))
    }

    /// Force in N of return and walls on a hand displaced by `reach` m along every axis.
    pub fn strongest_force(&self, reach: f64) -> f64 {
        let [x, y, z, ..] = self.0.map(|channel| channel.centring(reach));
        Vector3::new(x, y, z).norm()
    }

    /// Subtracts the deadband: zero within, and continuous at its edge (decision 17).
    pub fn beyond_deadband(&self, dx: &Displacement) -> Displacement {
        Displacement::from_components(self.each(dx, Channel::beyond_deadband))
    }

    /// Computes the return force of each axis (Eq. 8), in N along the axes of the reference, and in N·m per rad of each
    /// orientation parameter. It depends on the displacement before the deadband.
    pub fn centring(&self, dx: &Displacement) -> [f64; 6] {
        self.each(dx, Channel::centring)
    }

    fn each(&self, dx: &Displacement, law: impl Fn(&Channel, f64) -> f64) -> [f64; 6] {
        let mut values = dx.components();
        for (channel, value) in self.0.iter().zip(&mut values) {
            *value = law(channel, *value);
        }
        values
    }
}

impl Channel {
    fn beyond_deadband(&self, x: f64) -> f64 {
        (x.abs() - self.deadband).max(0.0).copysign(x)
    }

    fn centring(&self, x: f64) -> f64 {
        let of_deadband = if self.plateau > 0.0 { x.abs() / self.deadband } else { 0.0 };
        let within = of_deadband.min(1.0);
        let share = if self.is_spring { of_deadband } else { within * within };
        let into_wall = (x.abs() - self.wall).max(0.0);
        -(self.plateau * share + self.stiffness * into_wall).copysign(x)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn channels() -> Channels {
        Channels::new([0.01, 0.02, 0.0, 0.05, 0.06, 0.07], [2.0, 3.0, 0.0, 0.1, 0.2, 0.3]).unwrap()
    }

    fn walled() -> Channels {
        channels().with_wall([0.1; 6], [400.0; 6]).unwrap()
    }

    fn dx() -> impl Strategy<Value = [f64; 6]> {
        prop::array::uniform6(-0.3..0.3_f64)
    }

    proptest! {
        #[test]
        fn property_03_the_return_force_is_odd(dx in dx()) {
            let there = walled().centring(&Displacement::from_components(dx));
            let opposite = walled().centring(&Displacement::from_components(dx.map(|x| -x)));
            for (there, opposite) in there.iter().zip(opposite) {
                prop_assert!((there + opposite).abs() == 0.0);
            }
        }

        #[test]
        fn property_03_the_return_force_never_pushes_away(dx in dx()) {
            for (force, x) in walled().centring(&Displacement::from_components(dx)).iter().zip(dx) {
                prop_assert!(force * x <= 0.0);
            }
        }

        #[test]
        fn property_03_the_return_force_is_bounded_by_its_plateau(dx in dx()) {
            let force = channels().centring(&Displacement::from_components(dx));
            for (force, plateau) in force.iter().zip([2.0, 3.0, 0.0, 0.1, 0.2, 0.3]) {
                prop_assert!(force.abs() <= plateau);
            }
        }

        #[test]
        fn property_03_neither_law_has_a_step(dx in dx(), by in -1e-6..1e-6_f64) {
            let (a, b) = (dx, dx.map(|x| x + by));
            let (a, b) = (Displacement::from_components(a), Displacement::from_components(b));
            // Maximum stiffness of both: 2 F / DB = 400 N/m on the first axis, and 400 N/m of the wall.
            for (a, b) in walled().centring(&a).iter().zip(walled().centring(&b)) {
                prop_assert!((a - b).abs() <= 801.0 * by.abs());
            }
            let (a, b) = (walled().beyond_deadband(&a), walled().beyond_deadband(&b));
            for (a, b) in a.components().iter().zip(b.components()) {
                prop_assert!((a - b).abs() <= 1.000_001 * by.abs());
            }
        }

        #[test]
        fn within_the_deadband_nothing_is_commanded(share in prop::array::uniform6(-1.0..=1.0_f64)) {
            let [a, b, c, d, e, f] = share;
            let dx = [0.01 * a, 0.02 * b, 0.0 * c, 0.05 * d, 0.06 * e, 0.07 * f];
            prop_assert!(channels().beyond_deadband(&Displacement::from_components(dx)).is_zero());
        }
    }

    #[test]
    fn a_plateau_needs_a_deadband() {
        let error = Channels::new([0.0; 6], [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]).unwrap_err();
        assert_eq!(error, InvalidChannels::Step { axis: 2, plateau: 1.0 });
        assert!(Channels::new([0.0; 6], [0.0; 6]).is_ok());
        assert!(Channels::new([-0.1; 6], [0.0; 6]).is_err());
        assert!(channels().with_wall([0.0; 6], [f64::NAN; 6]).is_err());
    }
}
