//! Position counter of a drive: encoder position at power-up, and increments counted from there.
//!
//! In encoder increments, before the factor group. What a homing has set is not part of it.

use crate::actuator::{ActuatorSettings, Encoder};
use crate::motion::wrapped;
use crate::quirks::EncoderQuirks;

/// Encoder kind: position at power-up (6064h), in encoder increments.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum EncoderKind {
    /// Multi-turn absolute encoder: the same position after every power-up.
    #[default]
    Absolute,
    /// Absolute encoder within some motor revolutions: the position at power-up is modulo these, and never negative.
    SingleTurn {
        /// Motor revolutions with different positions, positive.
        unique_turns: f64,
    },
    /// Incremental encoder: zero at power-up, in any posture.
    Incremental,
}

/// Position counter of one drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct PositionCounter {
    kind: EncoderKind,
    encoder: Encoder,
    /// Increments per motor revolution.
    turn: f64,
    /// Increments by which the encoder is turned on its shaft.
    slip: f64,
    /// Increments added to the counter at power-up.
    error: f64,
    /// Last encoder position, in increments. Whole, as all of them; it does not wrap.
    position: f64,
    /// Encoder position that reads as zero.
    origin: f64,
    /// Set until the first reading since power-up.
    is_powering_up: bool,
}

impl PositionCounter {
    /// Creates the counter at power-up, at joint position zero until the first reading.
    pub(super) fn new(
        kind: EncoderKind,
        actuator: &ActuatorSettings,
        is_prismatic: bool,
        quirks: &EncoderQuirks,
    ) -> Self {
        let encoder = Encoder::new(actuator);
        let slip = if is_prismatic { 1e-3 * quirks.slip } else { quirks.slip.to_radians() };
        let slip = encoder.increments(slip) - encoder.increments(0.0);
        let mut counter = Self {
            kind: if quirks.is_incremental { EncoderKind::Incremental } else { kind },
            encoder,
            turn: actuator.counts_per_rev,
            slip,
            error: (actuator.counts_per_rev * f64::from(quirks.revolutions)).round(),
            position: encoder.increments(0.0) + slip,
            origin: 0.0,
            is_powering_up: true,
        };
        counter.power_up();
        counter
    }

    /// Starts the counter again. The next reading is the position at power-up: an arm without power can be moved.
    pub(super) fn power_up(&mut self) {
        self.is_powering_up = true;
        self.set_origin();
    }

    /// Takes the position of the motor, in rad (m) of the joint. During the initialisation of the drive each reading is
    /// the position at power-up.
    pub(super) fn sense(&mut self, position: f64, is_initialising: bool) {
        self.position = self.encoder.increments(position) + self.slip;
        if self.is_powering_up || is_initialising {
            self.is_powering_up = false;
            self.set_origin();
        }
    }

    /// Returns the counter; it wraps at 32 bits.
    pub(super) fn counts(&self) -> i32 {
        wrapped(self.position - self.origin + self.error)
    }

    /// Returns the velocity for that of the motor, in rad/s (m/s) of the joint; in increments/s.
    pub(super) fn rate(&self, velocity: f64) -> f64 {
        f64::from(self.encoder.rate(velocity))
    }

    /// Returns the counter at an index pulse; there is one per motor revolution, at the same angles after every power-up.
    pub(super) fn index(&self) -> f64 {
        (self.error - self.origin).rem_euclid(self.turn)
    }

    fn set_origin(&mut self) {
        self.origin = match self.kind {
            EncoderKind::Absolute => 0.0,
            EncoderKind::SingleTurn { unique_turns } => {
                self.position - self.position.rem_euclid(unique_turns * self.turn).floor()
            }
            EncoderKind::Incremental => self.position,
        };
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use proptest::prelude::*;

    use super::*;

    const TURN: f64 = 4_096.0;
    const GEAR: f64 = -50.0;
    const ZERO: i32 = 1_200;

    fn counter(kind: EncoderKind, quirks: EncoderQuirks) -> PositionCounter {
        let actuator = ActuatorSettings {
            counts_per_rev: TURN,
            gear_ratio: GEAR,
            zero_counts: ZERO,
            rated_torque: 0.3,
            torque_curve: [10.0, 0.0, 0.0],
            max_torque: 30.0,
        };
        PositionCounter::new(kind, &actuator, false, &quirks)
    }

    /// Returns the joint position of whole increments, in rad.
    fn joint(increments: f64) -> f64 {
        (increments - f64::from(ZERO)) * TAU / (TURN * GEAR)
    }

    /// Returns the counter at power-up at the first of these encoder positions, then at the second.
    fn counts(kind: EncoderKind, quirks: EncoderQuirks, positions: [f64; 2]) -> [i32; 2] {
        let mut counter = counter(kind, quirks);
        positions.map(|position| {
            counter.sense(joint(position), false);
            counter.counts()
        })
    }

    fn any_kind() -> impl Strategy<Value = EncoderKind> {
        let unique_turns = prop::sample::select(vec![0.3, 1.0, 2.5, 16.0]);
        prop_oneof![
            Just(EncoderKind::Absolute),
            Just(EncoderKind::Incremental),
            unique_turns.prop_map(|unique_turns| EncoderKind::SingleTurn { unique_turns }),
        ]
    }

    proptest! {
        #[test]
        fn counter_moves_by_the_increments_of_any_encoder(
            kind in any_kind(), start in -1_000_000..1_000_000_i32, distance in -1_000_000..1_000_000_i32,
            revolutions: i8, slip in -180.0..180.0_f64,
        ) {
            let positions = [start, start + distance].map(f64::from);
            let quirks = EncoderQuirks { is_incremental: false, slip, revolutions };
            let [before, after] = counts(kind, quirks, positions);
            prop_assert_eq!(after - before, distance);
        }

        #[test]
        fn position_at_power_up_follows_the_encoder_kind(
            start in -1_000_000..1_000_000_i32, turns in 1..20_i32,
        ) {
            let at = |kind| counts(kind, EncoderQuirks::default(), [f64::from(start); 2])[0];
            let unique_turns = f64::from(turns);
            prop_assert_eq!(at(EncoderKind::Absolute), start);
            prop_assert_eq!(at(EncoderKind::SingleTurn { unique_turns }), start.rem_euclid(4_096 * turns));
            prop_assert_eq!(at(EncoderKind::Incremental), 0);
        }

        #[test]
        fn fractional_turns_are_within_their_range(
            start in -1_000_000..1_000_000_i32, unique_turns in 0.01..3.0_f64,
        ) {
            let kind = EncoderKind::SingleTurn { unique_turns };
            let [at, _] = counts(kind, EncoderQuirks::default(), [f64::from(start); 2]);
            prop_assert!(at >= 0 && f64::from(at) < TURN * unique_turns, "{at}");
        }

        #[test]
        fn index_pulse_is_at_the_same_angle_after_power_up(
            kind in any_kind(), start in -1_000_000..1_000_000_i32, revolutions in -100..100_i8,
        ) {
            let mut counter = counter(kind, EncoderQuirks { revolutions, ..EncoderQuirks::default() });
            counter.sense(joint(f64::from(start)), false);
            let from_index = (f64::from(counter.counts()) - counter.index()).rem_euclid(TURN);
            prop_assert!((from_index - f64::from(start).rem_euclid(TURN)).abs() < 1e-6);
        }
    }

    #[test]
    fn reading_during_initialisation_is_the_power_up_position() {
        let mut counter = counter(EncoderKind::Incremental, EncoderQuirks::default());
        for (increments, is_initialising, counts) in
            [(500.0, true, 0), (700.0, true, 0), (900.0, false, 200)]
        {
            counter.sense(joint(increments), is_initialising);
            assert_eq!(counter.counts(), counts, "at {increments}");
        }
        counter.power_up();
        assert_eq!(counter.counts(), 0, "before the first reading");
        counter.sense(joint(1_500.0), false);
        assert_eq!(counter.counts(), 0);
    }

    #[test]
    fn counter_wraps_at_32_bits() {
        let mut counter = counter(EncoderKind::Absolute, EncoderQuirks::default());
        counter.sense(joint(f64::from(i32::MAX) + 1.0), false);
        assert_eq!(counter.counts(), i32::MIN);
        counter.sense(f64::NAN, false);
        assert_eq!(counter.counts(), ZERO);
    }

    #[test]
    fn slip_is_in_degrees_or_mm_of_the_joint() {
        let quirks = EncoderQuirks { slip: 90.0, ..EncoderQuirks::default() };
        let [slipped, _] = counts(EncoderKind::Absolute, quirks, [0.0; 2]);
        assert_eq!(slipped, -51_200, "a quarter of 50 turns, against the joint");
        let prismatic = |slip| {
            let actuator = ActuatorSettings {
                counts_per_rev: TURN,
                gear_ratio: 100.0,
                zero_counts: 0,
                rated_torque: 0.3,
                torque_curve: [10.0, 0.0, 0.0],
                max_torque: 30.0,
            };
            let quirks = EncoderQuirks { slip, ..EncoderQuirks::default() };
            PositionCounter::new(EncoderKind::Absolute, &actuator, true, &quirks).counts()
        };
        assert_eq!(prismatic(0.0), 0);
        assert_eq!(prismatic(20.0), 1_304, "2 rad of the motor, at 100 rad per m");
    }
}
