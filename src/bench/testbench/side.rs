//! Commanded side of a simulation: a virtual object in the node's scene, or a simulated robot with or without a link.

use config::Config;
use remote::site::VirtualSite;
use remote::stated::Misfit;
use remote::{Command, Remote, RemoteSample, RobotJoints, SideError};
use units::spatial::CommandMode;
use units::time::Instant;

use crate::linked_robot::LinkedRobot;
use crate::robot_site::RobotSite;

/// Receiver of the commands.
#[derive(Clone, Debug)]
pub enum Side {
    /// Object of a configuration, free or held by the kinematic model of an arm.
    Virtual(Box<VirtualSite>),
    /// Arm with masses, servos and a sensor.
    Robot(Box<RobotSite>),
    /// Arm with masses, servos and a sensor, behind a link.
    Linked(Box<LinkedRobot>),
}

impl Side {
    /// Returns the commanded side of a configuration, as `frhc run` has it.
    pub fn from_config(config: &Config) -> Self {
        Self::Virtual(Box::new(VirtualSite::new(&config.remote, config.period)))
    }

    /// Returns the simulated robot; `None` for any other side.
    pub const fn robot(&self) -> Option<&RobotSite> {
        match self {
            Self::Robot(site) => Some(site),
            Self::Linked(linked) => Some(linked.robot().site()),
            Self::Virtual(_) => None,
        }
    }
}

impl From<RobotSite> for Side {
    fn from(site: RobotSite) -> Self {
        Self::Robot(Box::new(site))
    }
}

impl From<LinkedRobot> for Side {
    fn from(linked: LinkedRobot) -> Self {
        Self::Linked(Box::new(linked))
    }
}

impl Remote for Side {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        match self {
            Self::Virtual(site) => site.exchange(now, command),
            Self::Robot(site) => site.exchange(now, command),
            Self::Linked(linked) => linked.exchange(now, command),
        }
    }

    fn begin_epoch(&mut self) {
        match self {
            Self::Virtual(site) => site.begin_epoch(),
            Self::Robot(site) => site.begin_epoch(),
            Self::Linked(linked) => linked.begin_epoch(),
        }
    }

    fn misfits(&mut self, now: Instant, mode: CommandMode) -> Vec<Misfit> {
        match self {
            Self::Virtual(site) => site.misfits(now, mode),
            Self::Robot(site) => site.misfits(now, mode),
            Self::Linked(linked) => linked.misfits(now, mode),
        }
    }

    fn mode_misfit(&mut self, mode: CommandMode) -> Option<Misfit> {
        match self {
            Self::Virtual(site) => site.mode_misfit(mode),
            Self::Robot(site) => site.mode_misfit(mode),
            Self::Linked(linked) => linked.mode_misfit(mode),
        }
    }

    fn error(&mut self) -> Option<SideError> {
        match self {
            Self::Virtual(site) => site.error(),
            Self::Robot(site) => site.error(),
            Self::Linked(linked) => linked.error(),
        }
    }

    fn joints(&self) -> Option<RobotJoints> {
        match self {
            Self::Virtual(site) => site.joints(),
            Self::Robot(site) => site.joints(),
            Self::Linked(linked) => linked.joints(),
        }
    }
}
