//! Monitoring of the operator's switches and of the grip.
//!
//! | file                 | detects                                                 | hazard |
//! |----------------------|---------------------------------------------------------|--------|
//! | [`deadman`]          | deadman released, stuck, bouncing, closed at power-up   | 38, 39 |
//! | `buttons`            | bouncing switches and buttons                            | 39     |
//! | `gripper`            | gripper input beyond its range or contradictory          | 50     |
//! | `anti_tie_down`      | deadman held for a minute without motion of the grip    | 39     |
//! | `uncommanded_motion` | joint driven by gravity or friction compensation         | 41     |
//! | `instability`        | oscillation that does not decay, power into the hand    | 45     |
//!
//! `sampled_motion` is the motion that `instability` checks.

mod anti_tie_down;
mod buttons;
pub mod deadman;
mod gripper;
mod instability;
mod sampled_motion;
mod uncommanded_motion;

use std::time::Duration;

use crate::cause::Cause;
use crate::operator::anti_tie_down::AntiTieDown;
use crate::operator::buttons::Buttons;
use crate::operator::deadman::{Deadman, EnableState};
use crate::operator::gripper::GripperLever;
use crate::operator::instability::Instability;
use crate::operator::sampled_motion::{Motion, SampledMotion};
use crate::operator::uncommanded_motion::{DrivenOn, UncommandedMotion};
use crate::permit::Permit;
use crate::record::GripperRecord;
use config::GripperInput;
use config::switch_inputs::SwitchInputs;
use controller::switches::Switches;
use controller::torque_delay::TorqueDelay;
use controller::{JointVector, Output};
use remote::Gripper;
use units::adjustment::Adjustment;
use units::time::Instant;

/// All monitors of the operator.
#[derive(Clone, Debug)]
pub(super) struct OperatorMonitors {
    period: Duration,
    /// Deadman; `None` without a switch box, so that the node can neither arm nor engage.
    deadman: Option<Deadman>,
    buttons: Buttons,
    /// Input for a gripper; `None` if the switch box has none.
    gripper: Option<GripperLever>,
    anti_tie_down: AntiTieDown,
    uncommanded_motion: UncommandedMotion,
    driven_on: DrivenOn,
    sampled_motion: SampledMotion,
    instability: Instability,
    /// Joint positions of the last cycle.
    previous_q: Option<JointVector>,
    /// Torques sent: the total, and the part without gravity compensation, which acts on the hand.
    sent: TorqueDelay<[JointVector; 2]>,
}

impl OperatorMonitors {
    /// Returns monitors before the first cycle, with a cycle every `period`. `buttons` are the adjustments of the switch
    /// box's buttons; `None` without a switch box.
    pub(super) fn new(period: Duration, buttons: Option<[Option<Adjustment>; 4]>) -> Self {
        Self {
            period,
            deadman: buttons.map(|_| Deadman::silent()),
            buttons: Buttons::new(buttons.unwrap_or_default()),
            gripper: None,
            anti_tie_down: AntiTieDown::default(),
            uncommanded_motion: UncommandedMotion::default(),
            driven_on: DrivenOn::default(),
            sampled_motion: SampledMotion::default(),
            instability: Instability::default(),
            previous_q: None,
            sent: TorqueDelay::new([JointVector::zeros(); 2]),
        }
    }

    /// Adds an input for a gripper.
    pub(super) fn with_gripper(self, input: Option<GripperInput>) -> Self {
        let gripper = input.map(|input| GripperLever::new(input, self.period));
        Self { gripper, ..self }
    }

    /// Takes the input of the gripper in this cycle, from the digital inputs or the analogue one; `None` if they are missing
    /// or stale.
    pub(super) fn watch_gripper(
        &mut self,
        now: Instant,
        inputs: Option<SwitchInputs>,
        counts: Option<i16>,
    ) -> Option<Cause> {
        self.gripper.as_mut()?.read(now, inputs, counts)
    }

    /// Returns the command to the gripper, and `measured`, the report of the commanded side; `None` without an input for a
    /// gripper.
    pub(super) fn gripper_command(
        &mut self,
        permit: &Permit,
        measured: Option<Gripper>,
    ) -> Option<GripperRecord> {
        let command = self.gripper.as_mut()?.command(permit.mode, measured);
        Some(GripperRecord { command, measured })
    }

    /// Takes the switches of this cycle; `None` if those of the switch box are missing or stale.
    pub(super) fn update(&mut self, now: Instant, inputs: Option<SwitchInputs>) -> Option<Cause> {
        self.buttons.read(now, inputs);
        let deadman = self.deadman.as_mut()?;
        deadman.read(now, inputs.map(|inputs| inputs.deadman()));
        deadman.check_discrepancy(now)
    }

    /// Returns the state of the deadman; `None` without a switch box.
    pub(super) fn enable_state(&self) -> Option<EnableState> {
        self.deadman.as_ref().map(Deadman::enable_state)
    }

    /// Returns the adjustments of the buttons that were pressed in this cycle.
    pub(super) fn pressed_adjustments(&self) -> impl Iterator<Item = Adjustment> + use<> {
        self.buttons.pressed()
    }

    /// Returns whether the deadman is held.
    pub(super) fn is_held(&self) -> bool {
        self.enable_state() == Some(EnableState::Held)
    }

    /// Returns the debounced switches, input of the controller.
    pub(super) const fn switches(&self, is_engaged: bool) -> Switches {
        Switches {
            deadman: is_engaged,
            reference: self.buttons.reference(),
            reflection: self.buttons.reflection(),
        }
    }

    /// Returns the cause for a joint `found` beyond its limit while gravity compensation ramps up.
    pub(super) fn check_limit(&self, permit: &Permit, found: Option<Cause>) -> Option<Cause> {
        uncommanded_motion::of_limit(found, permit.gravity_ramps_up && !self.is_held())
    }

    /// Checks the motion since the last cycle against the torques that acted meanwhile. After a gap (`restart`) the
    /// motion is not checked. A joint has a sample of this cycle if it is `fresh`.
    pub(super) fn check(
        &mut self,
        now: Instant,
        permit: &Permit,
        output: &Output,
        restart: bool,
        fresh: &[bool; 6],
    ) -> Option<Cause> {
        let (is_held, is_complete) = (self.is_held(), *fresh == [true; 6]);
        let felt = output.tau - output.ledger.carried();
        let [acted, acted_felt] = self.sent.acted();
        self.sent.push([output.tau, felt]);
        let previous_q = self.previous_q.replace(output.q);
        let tied_down = self.anti_tie_down.check(now, is_held, &output.x_0_g);
        let Some(q) = previous_q.filter(|_| !restart) else {
            self.sampled_motion.restart(is_complete);
            return tied_down;
        };
        let dq = output.q - q;
        let dt = self.period.as_secs_f64();
        let is_unheld_ramp = permit.gravity_ramps_up && !is_held;
        let uncommanded = self.uncommanded_motion.check(dt, is_unheld_ramp, &acted, &dq, fresh);
        let self_driven = output.ledger.self_driven.filter(|_| permit.engaged);
        let driven_on = self.driven_on.check(dt, self_driven, &dq, fresh);
        let uncommanded = uncommanded.or(driven_on);
        let motion = Motion::new(self.period, &output.twist.v_g, acted_felt.dot(&dq));
        let sampled = self.sampled_motion.add(&motion, is_complete);
        if !permit.engaged {
            self.instability.reset();
            return tied_down.or(uncommanded);
        }
        let unstable = sampled.and_then(|motion| self.instability.check(now, &motion));
        tied_down.or(uncommanded).or(unstable)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;
    use std::path::Path;
    use std::sync::LazyLock;

    use nalgebra::Isometry3;
    use proptest::prelude::*;

    use super::*;
    use crate::record::Mode;
    use config::Config;
    use controller::switches::{CommandMode, Switches};
    use controller::{Controller, Input};
    use units::drive::Counts;
    use units::math;
    use units::numbering::Joint;
    use units::spatial::Wrench;

    const CYCLE: Duration = Duration::from_millis(1);

    /// Joint positions in rad, amid the ranges of the arm.
    const START: JointVector = JointVector::new(0.0, -0.87, 1.66, -0.79, 0.0, 0.0);

    /// Controller of `config/kraft_like.toml`, before its first cycle.
    static CONTROLLER: LazyLock<Controller> = LazyLock::new(|| {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        Controller::new(&config.controller)
    });

    /// Input of the first cycle.
    static FIRST: LazyLock<Input> = LazyLock::new(|| Input {
        counts: [Counts(0); 6],
        f_s: Wrench::ZERO,
        x_b_m: Isometry3::identity(),
        switches: Switches { deadman: false, reference: false, reflection: false },
        mode: CommandMode::Rate,
        gravity_share: 0.0,
        reflection_share: 0.0,
        hold: false,
        held: None,
        restart: true,
    });

    fn permit(engaged: bool) -> Permit {
        Permit {
            mode: if engaged { Mode::Engaged } else { Mode::Armed },
            gravity_share: 0.5,
            gravity_ramps_up: !engaged,
            reflection_share: 1.0,
            hold: false,
            trial: false,
            engaged,
            drives_on: true,
        }
    }

    /// Returns the first cause in 900 ms. A torque of alternating sign moves the elbow at ±1.5 rad/s, `delay` cycles after
    /// its computation.
    fn cause(delay: usize, engaged: bool) -> Option<Cause> {
        let mut operator = OperatorMonitors::new(CYCLE, Some([None; 4]));
        let template = { *CONTROLLER }.step(&FIRST);
        let permit = permit(engaged);
        let torque = |cycle: usize| if cycle.is_multiple_of(2) { 20.0 } else { -20.0 };
        let mut q = 0.0;
        (0..900).find_map(|cycle: usize| {
            let acting = cycle.checked_sub(delay).map_or(0.0, torque);
            q += acting / 20.0 * 1.5e-3;
            let tau = JointVector::from([0.0, 0.0, torque(cycle), 0.0, 0.0, 0.0]);
            let mut output = Output { q: template.q, tau, ..template };
            output.ledger.gravity = JointVector::zeros();
            output.q[2] += q;
            let now = Instant::from_micros(1_000 * u64::try_from(cycle).unwrap());
            operator.check(now, &permit, &output, cycle == 0, &[true; 6])
        })
    }

    #[test]
    fn hazard_41_motion_is_compared_with_the_torque_that_acted() {
        assert_eq!(cause(2, false), Some(Cause::UncommandedMotion));
        assert_eq!(cause(1, false), None, "against the torque that acted");
    }

    #[test]
    fn hazard_45_power_is_that_of_the_torque_that_acted() {
        assert_eq!(cause(2, true), Some(Cause::Unstable));
        assert_eq!(cause(1, true), None, "against the torque that acted");
    }

    /// Returns the time in ms of the trip within 0.5 s. `q` are the joint positions in rad at a time in s; torques of
    /// 0.05 N·m drive every joint on, with less than the power that is tolerated. `lost` is the joint without a sample in a cycle of 1 ms.
    fn trips(q: impl Fn(f64) -> JointVector, lost: impl Fn(u32) -> Option<Joint>) -> Option<u32> {
        let (mut controller, mut operator) =
            (*CONTROLLER, OperatorMonitors::new(CYCLE, Some([None; 4])));
        let mut seen = q(0.0);
        (0..500).find(|ms: &u32| {
            let s = f64::from(*ms) * 1e-3;
            let (now, next) = (q(s), q(s + 1e-3));
            for joint in Joint::ALL.into_iter().filter(|joint| lost(*ms) != Some(*joint)) {
                seen[joint.index()] = now[joint.index()];
            }
            let restart = *ms == 0;
            let mut output = controller.step_at(&seen, &Input { restart, ..*FIRST });
            output.ledger.gravity = JointVector::zeros();
            output.tau = (next - now).map(|dq| 0.05 * dq.signum());
            let at = Instant::from_micros(u64::from(*ms) * 1_000);
            let fresh = Joint::ALL.map(|joint| lost(*ms) != Some(joint));
            operator.check(at, &permit(true), &output, restart, &fresh).is_some()
        })
    }

    /// Returns every `apart`th cycle without the sample of a joint.
    fn every(apart: u32, joint: Joint) -> impl Fn(u32) -> Option<Joint> {
        move |ms| (ms % apart == apart - 1).then_some(joint)
    }

    fn joint() -> impl Strategy<Value = Joint> {
        prop::sample::select(Joint::ALL.to_vec())
    }

    proptest! {
        #[test]
        fn promise_14_lost_samples_are_no_oscillation(
            qd in prop::array::uniform6(-1.5..1.5_f64), joint in joint(), apart in 3..99_u32
        ) {
            let q = |s| START + JointVector::from(qd) * s;
            prop_assert_eq!(trips(q, every(apart, joint)), None);
        }

        #[test]
        fn hazard_45_oscillation_with_lost_samples_trips(
            hertz in 6.0..30.0_f64, speed in 0.7..1.5_f64, joint in joint(), apart in 3..99_u32
        ) {
            let angle = |s: f64| speed / (TAU * hertz) * math::sin(TAU * hertz * s);
            let q = |s| START + JointVector::from([0.0, 0.0, angle(s), 0.0, 0.0, 0.0]);
            let (all, lossy) = (trips(q, |_| None), trips(q, every(apart, joint)));
            prop_assert!(all.is_some_and(|ms| ms <= 400), "{all:?}");
            prop_assert!(lossy.is_some_and(|lossy| Some(lossy) <= all.map(|ms| ms + 2)), "{lossy:?}, {all:?}");
        }
    }
}
