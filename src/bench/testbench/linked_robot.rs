//! Robot behind the contract of docs/link.md, with both ends in this process: for demonstrations in virtual time of
//! configurations with a remote robot.
//!
//! ```text
//!  exchange k      node's end takes the feedback of cycle k - 1, and sends command k
//!                  robot's end takes it, moves for a period, and measures
//! ```

use crate::far_robot::{FarRobot, RobotLimits};
use crate::robot_site::NoRobot;
use config::Config;
use contract::{Feedback, NodeEnd};
use remote::link::FarView;
use remote::stated::{Misfit, StatedCapability};
use remote::{Command, Remote, RemoteSample, SideError, messages};
use units::spatial::CommandMode;
use units::time::Instant;

/// Sessions of the two ends, the only ones on this link.
const NODE_SESSION: u64 = 1;
const ROBOT_SESSION: u64 = 2;

/// Robot with the node's end of the link to it.
#[derive(Clone, Debug)]
pub struct LinkedRobot {
    end: NodeEnd,
    robot: FarRobot,
    stated: Option<StatedCapability>,
    feedback: Option<[u8; Feedback::LENGTH]>,
    view: FarView,
}

impl LinkedRobot {
    /// Creates the robot of `config` at rest at its start. `seed` is that of the sensor's noise.
    ///
    /// # Errors
    /// Returns an error if the configuration has no robot, or one that cannot be simulated or starts in contact.
    pub fn new(config: &Config, seed: u64) -> Result<Self, NoRobot> {
        let arm = config.far_side.arm;
        Ok(Self {
            end: NodeEnd::new(arm, NODE_SESSION),
            robot: FarRobot::new(config, RobotLimits::default(), arm, ROBOT_SESSION, seed)?,
            stated: config.far_side.agreement.map(|agreement| agreement.stated),
            feedback: None,
            view: FarView::default(),
        })
    }

    /// Returns the far side at the other end of the link.
    pub const fn robot(&self) -> &FarRobot {
        &self.robot
    }

    /// Takes the feedback of the previous cycle.
    fn receive(&mut self, now: Instant) {
        let received = self.feedback.take();
        let sample = received.and_then(|feedback| self.end.on_message(now, &feedback));
        let Some(sample) = sample else { return };
        self.view.sensed = messages::sensed(&sample).or(self.view.sensed);
        (self.view.feedback, self.view.sample_at) = (Some(sample.feedback), Some(sample.at));
    }
}

impl Remote for LinkedRobot {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        self.receive(now);
        let message = self.end.command(now, &messages::order(command));
        self.robot.on_message(now, &message);
        let outgoing = self.robot.step(now);
        self.feedback = Some(outgoing.feedback);
        if let Some(figures) = outgoing.capability {
            self.end.on_message(now, &figures);
        }
        self.view.sensed
    }

    fn begin_epoch(&mut self) {
        self.end.begin_epoch();
    }

    fn misfits(&mut self, _: Instant, mode: CommandMode) -> Vec<Misfit> {
        let Some(capability) = self.end.capability() else { return vec![Misfit::Unknown] };
        let pose = self.view.feedback.and_then(|feedback| feedback.measured.pose);
        let stated = self.stated.as_ref();
        stated.map_or_else(Vec::new, |stated| stated.misfits(capability, mode, pose.as_ref()))
    }

    fn error(&mut self) -> Option<SideError> {
        self.view.hold(self.end.epoch()).map(SideError::Holds)
    }
}
