//! Configuration with another part of its values. No PDO depends on these, so the exchange of the file remains valid.

use crate::Config;
use crate::link::RemoteLink;
use crate::plant::JointPlant;
use crate::robots::RobotArm;
use ::remote::site::Virtual;
use ::robot::accommodation::Accommodation;
use controller::Settings;
use controller::calibration::{Calibration, TorqueCurve};
use controller::gains::Gains;

impl Config {
    /// Replaces the settings of the controller.
    #[must_use]
    pub fn with_controller(mut self, controller: Settings) -> Self {
        self.parameters.controller = controller;
        self
    }

    /// Replaces the commanded side.
    #[must_use]
    pub fn with_remote(mut self, remote: Virtual) -> Self {
        self.parameters.remote = remote;
        self
    }

    /// Replaces the link to the commanded side.
    #[must_use]
    pub const fn with_link(mut self, link: RemoteLink) -> Self {
        self.parameters.link = link;
        self
    }

    /// Replaces the arm that holds the commanded object, and starts it at that arm's start.
    #[must_use]
    pub fn with_robot(mut self, robot: RobotArm) -> Self {
        let following = robot.following();
        self.parameters.remote.x_b_m = following.pose();
        self.parameters.remote.arm = Some(following);
        self.parameters.robot = Some(robot);
        self
    }

    /// Replaces the gains K_T of reflection and K_FA of accommodation.
    #[must_use]
    pub fn with_switches_at(mut self, k_t: Gains, k_fa: Accommodation) -> Self {
        let reflection = &mut self.parameters.controller.reflection;
        *reflection = reflection.with_gain(k_t);
        self.parameters.remote.interaction.accommodation = k_fa;
        self
    }

    /// Scales the friction of every joint by `share`.
    #[must_use]
    pub fn with_friction(mut self, share: f64) -> Self {
        for joint in &mut self.parameters.joints {
            joint.plant.friction.coulomb *= share;
            joint.plant.friction.viscous *= share;
        }
        self
    }

    /// Changes each joint of the simulated arm, base first, and not what the controller knows of it.
    #[must_use]
    pub fn with_plant(mut self, change: impl FnMut(&mut JointPlant)) -> Self {
        self.parameters.joints.iter_mut().map(|joint| &mut joint.plant).for_each(change);
        self
    }

    /// Starts the simulated arm at `q`, in rad or m.
    #[must_use]
    pub fn with_start(mut self, q: [f64; 6]) -> Self {
        for (joint, start) in self.parameters.joints.iter_mut().zip(q) {
            joint.plant.start = start;
        }
        self
    }

    /// Replaces the torque curves of the controller and of the simulated motors.
    #[must_use]
    pub fn with_torque_curves(mut self, curves: [TorqueCurve; 6]) -> Self {
        for (joint, curve) in self.parameters.joints.iter_mut().zip(curves) {
            joint.calibration = joint.calibration.with_curve(curve);
            joint.plant.actuator.torque_curve = curve.coefficients();
        }
        let coupling = *self.parameters.controller.calibration.coupling();
        let actuators = self.parameters.joints.each_ref().map(|joint| joint.calibration);
        self.parameters.controller.calibration = Calibration::new(actuators).coupled(coupling);
        self
    }

    /// Enables the proof test of every drive at bring-up, regardless of the file.
    #[must_use]
    pub const fn with_proof(mut self) -> Self {
        self.parameters.safety.protection.proves_drives = true;
        self
    }
}
