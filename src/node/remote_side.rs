//! Commanded side: a robot or virtual object, and its newest valid sample.

use std::time::Duration;

use crate::cause::Cause;
use crate::newest_remote_sample::NewestRemoteSample;
use crate::record::Mode;
use config::Config;
use remote::model::{Difference, Model};
use remote::{Command, Remote, RobotJoints, SideError};
use units::time::Instant;

/// Commanded side, its newest valid sample, and the model of its robot.
#[derive(Clone, Debug)]
pub(super) struct RemoteSide<R> {
    pub(super) remote: R,
    pub(super) newest: NewestRemoteSample,
    model: Option<Model>,
    was_armed: bool,
}

/// Age of the newest sample, the robot's joint positions, and its difference to its model.
#[derive(Clone, Copy, Debug)]
pub(super) struct SideState {
    pub(super) sample_age: Option<Duration>,
    pub(super) q_r: Option<RobotJoints>,
    pub(super) model: Option<Difference>,
}

impl<R: Remote> RemoteSide<R> {
    /// Sends `Hold` and takes the first sample.
    pub(super) fn new(config: &Config, now: Instant, remote: R) -> Self {
        let newest = NewestRemoteSample::new(config.link.max_age);
        let limit = config.far_side.model_limit;
        let model = limit.map(|limit| Model::new(&config.remote, limit, config.period));
        let mut side = Self { remote, newest, model, was_armed: false };
        side.exchange(now, &Command::HOLD, Mode::Boot);
        side
    }

    /// Returns the cause of an error of the commanded side that matters in this mode. A stop ends the watch: only the reset
    /// makes the epoch in which the commanded side goes on.
    pub(super) fn cause(&mut self, mode: Mode) -> Option<Cause> {
        if !is_armed(mode) {
            return None;
        }
        let error = self.remote.error().and_then(|error| match error {
            SideError::Holds(reason) => Some(Cause::FarSideHolds { reason }),
            SideError::Slow { p99_us, stated_us } => {
                (mode == Mode::Engaged).then_some(Cause::LinkSlow { p99_us, stated_us })
            }
        });
        error.or_else(|| self.model.as_ref()?.excess().map(Cause::of_model))
    }

    /// Returns the state of the commanded side at SYNC.
    pub(super) fn state(&self, sync_at: Instant) -> SideState {
        SideState {
            sample_age: self.newest.age(sync_at),
            q_r: self.model.as_ref().map_or_else(|| self.remote.joints(), Model::joints),
            model: self.model.as_ref().and_then(Model::difference),
        }
    }

    /// Sends a command and takes the sample received with it, if any. The first command after the node has left the armed
    /// modes ends the epoch.
    pub(super) fn exchange(&mut self, now: Instant, command: &Command, mode: Mode) {
        if std::mem::replace(&mut self.was_armed, is_armed(mode)) && !self.was_armed {
            self.remote.end_epoch();
        }
        let sensed = self.remote.exchange(now, command);
        self.newest.update(now, sensed);
        if let Some(model) = &mut self.model {
            model.exchange(now, &command.motion, self.newest.sample());
        }
    }
}

const fn is_armed(mode: Mode) -> bool {
    matches!(mode, Mode::Armed | Mode::Engaged)
}
