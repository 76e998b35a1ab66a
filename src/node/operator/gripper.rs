//! Command to a gripper, from an analogue or two digital inputs of the switch box.
//!
//! The commanded opening follows the operator with limited speed while the node is engaged, and otherwise remains
//! constant. After each arming it starts at the reported opening of the gripper; without a report nothing is commanded.
//! An input that is silent, out of range or contradictory does not move the gripper.

use std::time::Duration;

use crate::cause::Cause;
use crate::operator::deadman::DEBOUNCE_TIME;
use crate::record::Mode;
use config::switch_inputs::SwitchInputs;
use config::{GripperInput, GripperTerminals};
use remote::Gripper;
use units::time::Instant;

/// Share of its range by which an analogue input may exceed it, for the tolerance of a lever's stops.
const TOLERANCE: f64 = 0.05;

/// Time for which an input must be invalid to be a fault, equal to the debounce time of contacts. Valid time is deducted:
/// a single glitch does not count, a wire that is loose more often than not does.
const INVALID_TIME: Duration = DEBOUNCE_TIME;

/// Input of the operator for a gripper.
#[derive(Clone, Copy, Debug)]
pub(super) struct GripperLever {
    input: GripperInput,
    /// Motion of the commanded opening in one cycle, in m.
    travel: f64,
    /// Opening demanded by the operator, in m; `None` to hold.
    aim: Option<f64>,
    /// Time of the last reading, and whether it was invalid.
    last: Option<(Instant, bool)>,
    /// Invalid time less valid time.
    invalid_for: Duration,
    /// Commanded opening, in m; `None` before the first engagement after an arming.
    opening: Option<f64>,
}

impl GripperLever {
    /// Returns the input before its first reading, with a cycle every `period`.
    pub(super) fn new(input: GripperInput, period: Duration) -> Self {
        let travel = input.max_speed * period.as_secs_f64();
        Self { input, travel, aim: None, last: None, invalid_for: Duration::ZERO, opening: None }
    }

    /// Takes the inputs of this cycle; `None` if they are missing or stale. Returns a cause if they have been invalid for
    /// too long.
    pub(super) fn read(
        &mut self,
        now: Instant,
        inputs: Option<SwitchInputs>,
        counts: Option<i16>,
    ) -> Option<Cause> {
        let aim = match self.input.terminals {
            GripperTerminals::Analogue { open, closed, .. } => {
                counts.map(|counts| analogue(counts, closed, open).map(Some))
            }
            GripperTerminals::Digital { open, close } => {
                inputs.map(|inputs| digital(inputs.bits(), open, close))
            }
        };
        // A silent switch box releases the deadman; its missed heartbeat is a cause.
        let aim = aim.unwrap_or(Ok(None));
        self.aim = aim.ok().flatten().map(|share| share * self.input.stroke);
        let passed = self.last.replace((now, aim.is_err()));
        if let Some((before, was_invalid)) = passed {
            let span = now.since(before);
            self.invalid_for = match was_invalid {
                true => (self.invalid_for + span).min(INVALID_TIME),
                false => self.invalid_for.saturating_sub(span),
            };
        }
        aim.err().filter(|_| self.invalid_for >= INVALID_TIME)
    }

    /// Returns the command of a cycle in this mode; `measured` is the gripper in the newest sample.
    pub(super) fn command(&mut self, mode: Mode, measured: Option<Gripper>) -> Option<Gripper> {
        self.opening = match mode {
            Mode::Engaged => {
                self.opening.or(measured.map(|it| it.position)).map(|at| self.moved(at))
            }
            Mode::Armed => self.opening,
            Mode::Boot
            | Mode::Ready
            | Mode::ReflectionOff
            | Mode::ZeroTorque
            | Mode::DrivesOff
            | Mode::Measuring => None,
        };
        self.opening.map(|position| Gripper { position, force: self.input.max_force })
    }

    /// Returns the opening one cycle after `opening`.
    fn moved(&self, opening: f64) -> f64 {
        let aim = self.aim.unwrap_or(opening);
        aim.max(opening - self.travel).min(opening + self.travel)
    }
}

/// Returns the share of the stroke that an analogue input demands.
fn analogue(counts: i16, closed: i16, open: i16) -> Result<f64, Cause> {
    let [at, low, high] = [counts, closed, open].map(f64::from);
    let share = (at - low) / (high - low);
    let is_within = (-TOLERANCE..=1.0 + TOLERANCE).contains(&share);
    let cause = Cause::GripperInputInvalid { counts, closed, open };
    if is_within { Ok(share.clamp(0.0, 1.0)) } else { Err(cause) }
}

/// Returns the share of the stroke that two digital inputs demand; `None` to hold.
const fn digital(bits: u8, open: u8, close: u8) -> Result<Option<f64>, Cause> {
    match (bits >> open & 1 == 1, bits >> close & 1 == 1) {
        (false, false) => Ok(None),
        (true, false) => Ok(Some(1.0)),
        (false, true) => Ok(Some(0.0)),
        (true, true) => Err(Cause::GripperInputsContradict { open_bit: open, close_bit: close }),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const STROKE: f64 = 0.08;
    const PERIOD: Duration = Duration::from_millis(1);

    fn lever(terminals: GripperTerminals) -> GripperLever {
        let input = GripperInput { terminals, stroke: STROKE, max_force: 20.0, max_speed: 0.1 };
        GripperLever::new(input, PERIOD)
    }

    /// Fully open at -1,000 counts and fully closed at 9,000.
    fn analogue_lever() -> GripperLever {
        lever(GripperTerminals::Analogue { number: 1, open: -1_000, closed: 9_000 })
    }

    fn digital_lever() -> GripperLever {
        lever(GripperTerminals::Digital { open: 4, close: 5 })
    }

    fn at(millis: u64) -> Instant {
        Instant::from_micros(millis * 1_000)
    }

    fn reported(position: f64) -> Option<Gripper> {
        Some(Gripper { position, force: 0.0 })
    }

    /// Runs cycles of 1 ms in a mode; returns the last command.
    fn run(
        lever: &mut GripperLever,
        mode: Mode,
        cycles: u64,
        bits: Option<u8>,
        counts: Option<i16>,
    ) -> Option<f64> {
        let inputs = bits.map(SwitchInputs::from_bits);
        (0..cycles).fold(None, |_, cycle| {
            lever.read(at(cycle), inputs, counts);
            lever.command(mode, reported(0.05)).map(|command| command.position)
        })
    }

    fn is_at(command: Option<f64>, expected: f64) -> bool {
        command.is_some_and(|command| (command - expected).abs() < 1e-9)
    }

    #[test]
    fn command_begins_at_the_reported_opening_when_engaged() {
        let mut lever = analogue_lever();
        assert_eq!(run(&mut lever, Mode::Ready, 100, None, Some(9_000)), None);
        assert_eq!(run(&mut lever, Mode::Armed, 100, None, Some(9_000)), None);
        assert!(is_at(run(&mut lever, Mode::Engaged, 1, None, Some(9_000)), 0.05 - 1e-4));
        assert!(is_at(run(&mut lever, Mode::Engaged, 99, None, Some(9_000)), 0.04), "0.1 m/s");
        assert!(is_at(run(&mut lever, Mode::Armed, 100, None, Some(-1_000)), 0.04), "it stays");
        assert!(is_at(run(&mut lever, Mode::Engaged, 900, None, Some(-1_000)), STROKE));
        assert_eq!(run(&mut lever, Mode::ReflectionOff, 1, None, Some(0)), None);
        assert!(is_at(run(&mut lever, Mode::Engaged, 1, None, Some(9_000)), 0.05 - 1e-4), "anew");
    }

    #[test]
    fn gripper_that_reports_nothing_is_not_commanded() {
        let mut lever = analogue_lever();
        lever.read(at(0), None, Some(0));
        assert_eq!(lever.command(Mode::Engaged, None), None);
        let begun = lever.command(Mode::Engaged, reported(0.05));
        assert!(begun.is_some_and(|begun| begun.force.to_bits() == 20.0_f64.to_bits()));
        assert!(lever.command(Mode::Engaged, None).is_some(), "it goes on without a report");
    }

    #[test]
    fn bits_open_and_close_while_they_are_set() {
        let mut lever = digital_lever();
        assert!(is_at(run(&mut lever, Mode::Engaged, 10, Some(0b0000), None), 0.05));
        assert!(is_at(run(&mut lever, Mode::Engaged, 10, Some(1 << 4), None), 0.051));
        assert!(is_at(run(&mut lever, Mode::Engaged, 30, Some(1 << 5), None), 0.048));
        assert!(is_at(run(&mut lever, Mode::Engaged, 10, Some(0b1111), None), 0.048), "it stays");
        assert!(is_at(run(&mut lever, Mode::Engaged, 9_999, Some(1 << 5), None), 0.0));
    }

    #[test]
    fn hazard_50_silent_input_moves_nothing() {
        for mut lever in [analogue_lever(), digital_lever()] {
            let begun = run(&mut lever, Mode::Engaged, 10, Some(1 << 5), Some(9_000));
            let silent = run(&mut lever, Mode::Engaged, 1_000, None, None);
            assert_eq!((silent, lever.read(at(9_999), None, None)), (begun, None));
        }
    }

    #[test]
    fn hazard_50_invalid_input_stops_after_25_ms_and_moves_nothing() {
        let contradicts = Cause::GripperInputsContradict { open_bit: 4, close_bit: 5 };
        let beyond = |counts| Cause::GripperInputInvalid { counts, closed: 9_000, open: -1_000 };
        for (mut lever, bits, counts, cause) in [
            (analogue_lever(), None, Some(9_501), beyond(9_501)),
            (analogue_lever(), None, Some(i16::MIN), beyond(i16::MIN)),
            (digital_lever(), Some(0b11 << 4), None, contradicts),
        ] {
            let before = run(&mut lever, Mode::Engaged, 1, Some(0), Some(4_000));
            let inputs = bits.map(SwitchInputs::from_bits);
            let causes: Vec<_> = (1..=27)
                .map(|ms| {
                    let cause = lever.read(at(ms), inputs, counts);
                    let command = lever.command(Mode::Engaged, None).map(|it| it.position);
                    assert_eq!(command, before, "{cause:?}");
                    cause
                })
                .collect();
            assert_eq!(causes.iter().position(Option::is_some), Some(25));
            assert_eq!(causes[25], Some(cause));
            assert_eq!(lever.read(at(28), Some(SwitchInputs::from_bits(0)), Some(9_500)), None);
        }
    }

    /// Returns the time in ms of the fault within 2 s of an input that is invalid for `invalid` of each `of` ms.
    fn flickers(invalid: u64, of: u64) -> Option<u64> {
        let mut lever = analogue_lever();
        (0..2_000).find(|ms| {
            let counts = if ms % of < invalid { i16::MAX } else { 4_000 };
            lever.read(at(*ms), None, Some(counts)).is_some()
        })
    }

    #[test]
    fn hazard_50_loose_wire_is_a_fault_and_a_glitch_is_not() {
        assert!(flickers(20, 21).is_some_and(|ms| ms < 50), "{:?}", flickers(20, 21));
        assert!(flickers(3, 5).is_some_and(|ms| ms < 150), "{:?}", flickers(3, 5));
        for (invalid, of) in [(1, 2), (24, 48), (1, 100), (24, 100)] {
            assert_eq!(flickers(invalid, of), None, "{invalid} of {of} ms");
        }
    }

    proptest! {
        #[test]
        fn opening_stays_in_its_range_and_never_jumps(
            start in 0.0..0.2_f64,
            readings in prop::collection::vec((any::<Option<i16>>(), any::<bool>()), 1..200),
        ) {
            let mut lever = analogue_lever();
            let mut before = start;
            for (counts, is_engaged) in readings {
                lever.read(at(0), None, counts);
                let mode = if is_engaged { Mode::Engaged } else { Mode::Armed };
                let Some(Gripper { position, .. }) = lever.command(mode, reported(start)) else {
                    continue;
                };
                prop_assert!((position - before).abs() <= 1e-4 + 1e-12);
                prop_assert!(is_engaged || position.to_bits() == before.to_bits());
                prop_assert!((0.0..=start.max(STROKE)).contains(&position));
                before = position;
            }
        }

        #[test]
        fn analogue_input_is_valid_up_to_5_percent_beyond(
            counts in any::<i16>(), closed in any::<i16>(), open in any::<i16>(),
        ) {
            prop_assume!(closed != open);
            let share = (f64::from(counts) - f64::from(closed)) / (f64::from(open) - f64::from(closed));
            let demanded = analogue(counts, closed, open);
            prop_assert_eq!(demanded.is_ok(), (-0.05..=1.05).contains(&share));
            prop_assert!(demanded.is_err() || demanded.is_ok_and(|it| (0.0..=1.0).contains(&it)));
        }
    }
}
