//! The commanded side of a simulation: a virtual object in the node's own scene, or a robot that is simulated.

use config::Config;
use remote::site::VirtualSite;
use remote::{Remote, RobotJoints, Sensed};
use units::spatial::Motion;
use units::time::Instant;

use crate::robot_site::RobotSite;

/// Receiver of the commands.
#[derive(Clone, Debug)]
pub enum Side {
    /// The object of a configuration, free or held by the kinematic model of an arm.
    Virtual(Box<VirtualSite>),
    /// An arm with masses, servos and a sensor.
    Robot(Box<RobotSite>),
}

impl Side {
    /// Returns the commanded side of a configuration, as `frhc run` has it.
    pub fn of(config: &Config) -> Self {
        Self::Virtual(Box::new(VirtualSite::new(&config.remote, config.period)))
    }

    /// Returns the simulated robot, if it is one.
    pub const fn robot(&self) -> Option<&RobotSite> {
        match self {
            Self::Robot(site) => Some(site),
            Self::Virtual(_) => None,
        }
    }
}

impl From<RobotSite> for Side {
    fn from(site: RobotSite) -> Self {
        Self::Robot(Box::new(site))
    }
}

impl Remote for Side {
    fn exchange(&mut self, now: Instant, command: &Motion) -> Option<Sensed> {
        match self {
            Self::Virtual(site) => site.exchange(now, command),
            Self::Robot(site) => site.exchange(now, command),
        }
    }

    fn begin_epoch(&mut self) {
        match self {
            Self::Virtual(site) => site.begin_epoch(),
            Self::Robot(site) => site.begin_epoch(),
        }
    }

    fn joints(&self) -> Option<RobotJoints> {
        match self {
            Self::Virtual(site) => site.joints(),
            Self::Robot(site) => site.joints(),
        }
    }
}
