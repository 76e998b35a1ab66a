//! Monitoring of the operator's switches and of the grip.
//!
//! | file                 | detects                                                 | hazard |
//! |----------------------|---------------------------------------------------------|--------|
//! | [`deadman`]          | deadman released, stuck, bouncing, closed at power-up   | 38, 39 |
//! | `buttons`            | bouncing reference and reflection switches              | 39     |
//! | `anti_tie_down`      | deadman held for a minute without motion of the grip    | 39     |
//! | `uncommanded_motion` | joint driven while gravity compensation ramps up        | 41     |
//! | `instability`        | oscillation that does not decay, power into the hand    | 45     |

mod anti_tie_down;
mod buttons;
pub mod deadman;
mod instability;
mod uncommanded_motion;

use std::time::Duration;

use crate::cause::Cause;
use crate::operator::anti_tie_down::AntiTieDown;
use crate::operator::buttons::Buttons;
use crate::operator::deadman::{Deadman, EnableState};
use crate::operator::instability::Instability;
use crate::operator::uncommanded_motion::UncommandedMotion;
use crate::permit::Permit;
use config::switch_inputs::SwitchInputs;
use controller::switches::Switches;
use controller::torque_delay::TorqueDelay;
use controller::{JointVector, Output};
use units::time::Instant;

/// All monitors of the operator.
#[derive(Clone, Debug)]
pub(super) struct Operator {
    period: Duration,
    /// `None` without a switch box: nothing is ever armed or engaged.
    deadman: Option<Deadman>,
    buttons: Buttons,
    anti_tie_down: AntiTieDown,
    uncommanded_motion: UncommandedMotion,
    instability: Instability,
    /// Joint positions of the last cycle.
    previous_q: Option<JointVector>,
    /// Torques sent: all of them, and the part without gravity compensation, which the hand feels.
    sent: TorqueDelay<[JointVector; 2]>,
}

impl Operator {
    /// Returns monitors before the first cycle, with a cycle every `period`.
    pub(super) fn new(period: Duration, has_switch_box: bool) -> Self {
        Self {
            period,
            deadman: has_switch_box.then(Deadman::silent),
            buttons: Buttons::new(),
            anti_tie_down: AntiTieDown::default(),
            uncommanded_motion: UncommandedMotion::default(),
            instability: Instability::default(),
            previous_q: None,
            sent: TorqueDelay::new([JointVector::zeros(); 2]),
        }
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
    /// motion is not checked.
    pub(super) fn check(
        &mut self,
        now: Instant,
        permit: &Permit,
        output: &Output,
        restart: bool,
    ) -> Option<Cause> {
        let is_held = self.is_held();
        let felt = output.tau - output.ledger.carried();
        let [acted, acted_felt] = self.sent.acted();
        self.sent.push([output.tau, felt]);
        let previous_q = self.previous_q.replace(output.q);
        let tied_down = self.anti_tie_down.check(now, is_held, &output.x_0_g);
        let Some(q) = previous_q.filter(|_| !restart) else { return tied_down };
        let dq = output.q - q;
        let dt = self.period.as_secs_f64();
        let uncommanded =
            self.uncommanded_motion.check(dt, permit.gravity_ramps_up && !is_held, &acted, &dq);
        if !permit.engaged {
            self.instability.reset();
            return tied_down.or(uncommanded);
        }
        let v_g = &output.moving.v_g;
        let unstable = self.instability.check(now, self.period, v_g, acted_felt.dot(&dq));
        tied_down.or(uncommanded).or(unstable)
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use nalgebra::Isometry3;

    use super::*;
    use crate::record::Mode;
    use config::Config;
    use controller::switches::{Mode as CommandMode, Switches};
    use controller::{Controller, Input};
    use units::drive::Counts;
    use units::spatial::Wrench;

    /// Returns the output of a cycle at rest.
    fn at_rest() -> Output {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        Controller::new(&config.controller).step(&Input {
            counts: [Counts(0); 6],
            f_s: Wrench::ZERO,
            x_b_m: Isometry3::identity(),
            switches: Switches { deadman: false, reference: false, reflection: false },
            mode: CommandMode::Rate,
            gravity_share: 0.0,
            reflection_share: 0.0,
            held: None,
            restart: true,
        })
    }

    /// Returns the first cause in 900 ms. A torque of alternating sign moves the elbow at ±1.5 rad/s, `delay` cycles after
    /// its computation.
    fn cause(delay: usize, engaged: bool) -> Option<Cause> {
        let mut operator = Operator::new(Duration::from_millis(1), true);
        let template = at_rest();
        let permit = Permit {
            mode: if engaged { Mode::Engaged } else { Mode::Armed },
            gravity_share: 0.5,
            gravity_ramps_up: !engaged,
            reflection_share: 1.0,
            engaged,
            drives_on: true,
        };
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
            operator.check(now, &permit, &output, cycle == 0)
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
}
