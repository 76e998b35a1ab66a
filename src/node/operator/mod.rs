//! What is watched of the operator and of the hand: whether somebody is there, and whether the arm does
//! what a hand would not.
//!
//! | file            | watches for                                            | hazard |
//! |-----------------|--------------------------------------------------------|--------|
//! | [`deadman`]     | released, stuck, bouncing, closed at power-up          | 38, 39 |
//! | `taped`         | a deadman held for a minute over a grip that is still  | 39     |
//! | `unheld`        | an arm that is driven away while its weight is taken up | 41    |
//! | `instability`   | swings that do not die away, power into the hand       | 45     |

pub mod deadman;
mod instability;
mod taped;
mod unheld;

use std::time::Duration;

use crate::canopen::pdo::SwitchInputs;
use crate::controller::JointVector;
use crate::controller::Output;
use crate::node::operator::deadman::Deadman;
use crate::node::operator::deadman::Grasp;
use crate::node::operator::instability::Instability;
use crate::node::operator::taped::Taped;
use crate::node::operator::unheld::Unheld;
use crate::node::safety::Permit;
use crate::telemetry::cause::Cause;
use crate::time::Instant;

/// All of it.
#[derive(Clone, Debug)]
pub(super) struct Operator {
    period: Duration,
    deadman: Deadman,
    taped: Taped,
    unheld: Unheld,
    instability: Instability,
    /// The cycle before: the joints, all torques, and those of them that are felt.
    before: Option<(JointVector, JointVector, JointVector)>,
}

impl Operator {
    /// Nothing seen yet; a cycle every `period`.
    pub(super) fn new(period: Duration) -> Self {
        Self {
            period,
            deadman: Deadman::unheard(),
            taped: Taped::default(),
            unheld: Unheld::default(),
            instability: Instability::default(),
            before: None,
        }
    }

    /// Takes the switches of this cycle; `None` while the switch box is silent.
    pub(super) fn feel(&mut self, now: Instant, inputs: Option<SwitchInputs>) -> Option<Cause> {
        self.deadman.read(now, inputs.map(|inputs| inputs.deadman()));
        self.deadman.disagrees(now)
    }

    /// What the hand does with the deadman.
    pub(super) const fn grasp(&self) -> Grasp {
        self.deadman.grasp()
    }

    /// Whether the deadman is held.
    pub(super) fn is_held(&self) -> bool {
        self.grasp() == Grasp::Held
    }

    /// Watches the arm: where it came to by the torques of the cycle before. After a gap (`restart`) that
    /// says nothing.
    pub(super) fn watch(
        &mut self,
        now: Instant,
        permit: &Permit,
        output: &Output,
        restart: bool,
    ) -> Option<Cause> {
        let is_held = self.is_held();
        let felt = output.tau - output.ledger.gravity;
        let before = self.before.replace((output.q, output.tau, felt));
        let taped = self.taped.watch(now, is_held, &output.x_0_g);
        let Some((q, tau, felt)) = before.filter(|_| !restart) else { return taped };
        let came = output.q - q;
        let dt = self.period.as_secs_f64();
        let unheld = self.unheld.watch(dt, permit.takes_up && !is_held, &tau, &came);
        if !permit.engaged {
            self.instability.forget();
            return taped.or(unheld);
        }
        let v_g = &output.moving.v_g;
        let unstable = self.instability.watch(now, self.period, v_g, felt.dot(&came));
        taped.or(unheld).or(unstable)
    }
}
