//! Trial of one drive: does a positive torque raise its position?
//!
//! ```text
//!  ready ──► all drives off ──► torque limit = bound, read back ──► deadman held: enabled alone ──► up, zero, down, zero ──► off
//!    ▲                                ▲                                                                                      │
//!    └── boot ◄── reset ◄─────────────┴────────────────── next trial ◄───────────────────────────────────────────────────────┘
//! ```
//!
//! All other drives stay off, no gravity is compensated, and no hand is on the arm, which lies at rest. The torque rises slowly, in
//! one direction and then in the other, until the joint has moved by 0.3° (0.5 mm); its position tells the direction. A drive whose
//! limit is reduced stays so until a boot, which is the only way back to `Ready`.
//!
//! `status` is what can be seen of it, `ramp` the torque of one cycle, `run` what the node does around it.

mod ramp;
mod run;
pub mod status;

pub use status::{Answer, End, Stage, TrialRequest, TrialStatus};

use std::time::Duration;

use thiserror::Error;

use crate::rest::NotAtRest;
use crate::safety::Refusal;
use crate::trial::ramp::Ramp;
use crate::zero::UnknownZeros;
use canopen::master::event::Event;
use config::Config;
use units::drive::PerMille;
use units::numbering::Joint;
use units::time::Instant;

/// Reason why a drive is not tried.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum TrialError {
    /// The mode, the deadman or a stop forbids it.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// Another trial is under way.
    #[error("joint {0}: its drive is being tried: wait for its end, or release the deadman")]
    Busy(Joint),
    /// A hand at the grip would be part of the measurement.
    #[error(
        "the deadman is at the grip, where a hand would be part of the measurement: connect a second enabling switch apart from \
         the arm, and set switches.deadman_at = \"apart\""
    )]
    DeadmanAtGrip,
    /// The bound is beyond what the joint can need.
    #[error(
        "joint {joint}: a bound of {share} ‰ of its capacity is beyond {most} ‰: 1.6 times its weight, with centres of mass off by \
         2 cm, and 4 times its friction, as described"
    )]
    Bound {
        /// Joint.
        joint: Joint,
        /// Bound that was requested, in ‰ of the capacity.
        share: u16,
        /// Maximum bound, in ‰ of the capacity.
        most: u16,
    },
    /// A zero is unknown, and with it the weight.
    #[error(transparent)]
    UnknownZeros(#[from] UnknownZeros),
    /// The arm does not lie in its rest posture.
    #[error(transparent)]
    NotAtRest(#[from] NotAtRest),
}

/// Trials since the last boot.
#[derive(Clone, Debug)]
pub(super) struct Trials {
    /// Settings of each joint's ramp.
    ramps: [ramp::Settings; 6],
    /// Time in which a drive must be enabled.
    enable_timeout: Duration,
    is_deadman_apart: bool,
    current: Option<Trial>,
}

#[derive(Clone, Copy, Debug)]
struct Trial {
    status: TrialStatus,
    /// Start of the stage.
    since: Instant,
    /// The limit is being written, and has been read back.
    is_requested: bool,
    is_limited: bool,
    ramp: Ramp,
    target: PerMille,
}

impl Trials {
    /// Returns no trial.
    pub(super) fn new(config: &Config) -> Self {
        Self {
            ramps: ramp::settings(config),
            enable_timeout: config.safety.enable_timeout,
            is_deadman_apart: config.switches.as_ref().is_some_and(|it| it.is_deadman_apart),
            current: None,
        }
    }

    /// Forgets the trials, before the network boots.
    pub(super) const fn restart(&mut self) {
        self.current = None;
    }

    /// Returns the newest trial since the last boot.
    pub(super) fn status(&self) -> Option<TrialStatus> {
        self.current.as_ref().map(|trial| trial.status)
    }

    /// Returns joint and target torque of a drive that is pushed.
    pub(super) fn target(&self) -> Option<(Joint, PerMille)> {
        let trial = self.current.as_ref()?;
        (trial.status.stage == Stage::Pushing).then_some((trial.status.request.joint, trial.target))
    }

    /// Takes an event of the master.
    pub(super) fn on_event(&mut self, event: &Event) {
        if let (Event::TorqueLimited { node }, Some(trial)) = (event, &mut self.current)
            && node.joint() == Some(trial.status.request.joint)
        {
            trial.is_limited = true;
        }
    }
}
