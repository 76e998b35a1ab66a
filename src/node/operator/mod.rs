//! What is watched of the operator and of the hand: whether somebody is there, and whether the arm does
//! what a hand would not.
//!
//! | file                 | watches for                                             | hazard |
//! |----------------------|---------------------------------------------------------|--------|
//! | [`deadman`]          | released, stuck, bouncing, closed at power-up           | 38, 39 |
//! | `buttons`            | reference and reflection switches that bounce           | 39     |
//! | `anti_tie_down`      | a deadman held for a minute over a grip that is still   | 39     |
//! | `uncommanded_motion` | an arm driven away while gravity compensation ramps up  | 41     |
//! | `instability`        | swings that do not die away, power into the hand        | 45     |

mod anti_tie_down;
mod buttons;
pub mod deadman;
mod instability;
mod uncommanded_motion;

use std::time::Duration;

use crate::cause::Cause;
use crate::operator::anti_tie_down::AntiTieDown;
use crate::operator::buttons::Buttons;
use crate::operator::deadman::Deadman;
use crate::operator::deadman::EnableState;
use crate::operator::instability::Instability;
use crate::operator::uncommanded_motion::UncommandedMotion;
use crate::permit::Permit;
use config::switch_inputs::SwitchInputs;
use controller::JointVector;
use controller::Output;
use controller::switches::Switches;
use controller::torque_delay::TorqueDelay;
use units::time::Instant;

/// All of it.
#[derive(Clone, Debug)]
pub(super) struct Operator {
    period: Duration,
    deadman: Deadman,
    buttons: Buttons,
    anti_tie_down: AntiTieDown,
    uncommanded_motion: UncommandedMotion,
    instability: Instability,
    /// Joint positions of the last cycle.
    before: Option<JointVector>,
    /// All torques sent, and the part of them that is felt.
    sent: TorqueDelay<[JointVector; 2]>,
}

impl Operator {
    /// Nothing seen yet; a cycle every `period`.
    pub(super) fn new(period: Duration) -> Self {
        Self {
            period,
            deadman: Deadman::unheard(),
            buttons: Buttons::new(),
            anti_tie_down: AntiTieDown::default(),
            uncommanded_motion: UncommandedMotion::default(),
            instability: Instability::default(),
            before: None,
            sent: TorqueDelay::new([JointVector::zeros(); 2]),
        }
    }

    /// Takes the switches of this cycle; `None` while the switch box is silent.
    pub(super) fn update(&mut self, now: Instant, inputs: Option<SwitchInputs>) -> Option<Cause> {
        self.deadman.read(now, inputs.map(|inputs| inputs.deadman()));
        self.buttons.read(now, inputs);
        self.deadman.disagrees(now)
    }

    /// What the hand does with the deadman.
    pub(super) const fn enable_state(&self) -> EnableState {
        self.deadman.enable_state()
    }

    /// Whether the deadman is held.
    pub(super) fn is_held(&self) -> bool {
        self.enable_state() == EnableState::Held
    }

    /// Returns the switches as the controller takes them: those of the box have settled.
    pub(super) const fn switches(&self, is_engaged: bool) -> Switches {
        Switches {
            deadman: is_engaged,
            reference: self.buttons.reference(),
            reflection: self.buttons.reflection(),
        }
    }

    /// Watches the arm: its motion since the last cycle, and the torques that acted meanwhile. After a gap
    /// (`restart`) motion says nothing.
    pub(super) fn watch(
        &mut self,
        now: Instant,
        permit: &Permit,
        output: &Output,
        restart: bool,
    ) -> Option<Cause> {
        let is_held = self.is_held();
        let felt = output.tau - output.ledger.gravity;
        let [acted, acted_felt] = self.sent.acted();
        self.sent.push([output.tau, felt]);
        let before = self.before.replace(output.q);
        let tied_down = self.anti_tie_down.watch(now, is_held, &output.x_0_g);
        let Some(q) = before.filter(|_| !restart) else { return tied_down };
        let came = output.q - q;
        let dt = self.period.as_secs_f64();
        let uncommanded =
            self.uncommanded_motion.watch(dt, permit.gravity_ramps_up && !is_held, &acted, &came);
        if !permit.engaged {
            self.instability.forget();
            return tied_down.or(uncommanded);
        }
        let v_g = &output.moving.v_g;
        let unstable = self.instability.watch(now, self.period, v_g, acted_felt.dot(&came));
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
    use controller::Controller;
    use controller::Input;
    use controller::switches::Mode as CommandMode;
    use controller::switches::Switches;
    use units::drive::Counts;
    use units::spatial::Wrench;

    /// A cycle at rest.
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
            restart: true,
        })
    }

    /// The first cause in 900 ms in which a torque that changes its sign every cycle drives the elbow at
    /// 1.5 rad/s (up, so far as it may), `late` cycles after it was computed; and how often it then drove.
    fn cause(late: usize, engaged: bool) -> Option<Cause> {
        let mut operator = Operator::new(Duration::from_millis(1));
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
            let driving = cycle.checked_sub(late).map_or(0.0, torque);
            q += driving / 20.0 * 1.5e-3;
            let tau = JointVector::from([0.0, 0.0, torque(cycle), 0.0, 0.0, 0.0]);
            let mut output = Output { q: template.q, tau, ..template };
            output.ledger.gravity = JointVector::zeros();
            output.q[2] += q;
            let now = Instant::from_micros(1_000 * u64::try_from(cycle).unwrap());
            operator.watch(now, &permit, &output, cycle == 0)
        })
    }

    #[test]
    fn hazard_41_motion_is_judged_by_the_torque_that_caused_it() {
        assert_eq!(cause(2, false), Some(Cause::UncommandedMotion));
        assert_eq!(cause(1, false), None, "against the torque that acted");
    }

    #[test]
    fn hazard_45_power_is_that_of_the_torque_that_acted() {
        assert_eq!(cause(2, true), Some(Cause::Unstable));
        assert_eq!(cause(1, true), None, "against the torque that acted");
    }
}
