//! What stands between a drive's current loop and the arm: a motor and its gear.
//!
//! Not the drive: it is asked for per mille of rated torque, and gives N·m at its joint.

use crate::sim::actuator::ActuatorSettings;
use crate::sim::actuator::TorqueCurve;

/// What a drive senses of its motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensed {
    /// Of the motor, as its joint would have to be for it, in rad (m).
    pub position: f64,
    /// The same, in rad/s (m/s).
    pub velocity: f64,
    /// The torque its current makes, in ‰ of rated torque.
    pub per_mille: f64,
    /// Of its winding, in °C.
    pub temperature: f64,
}

/// The motor and the gear of one joint.
#[derive(Clone, Copy, Debug)]
pub struct Drivetrain {
    curve: TorqueCurve,
    demand: f64,
    torque: f64,
}

impl Drivetrain {
    /// At rest and cold.
    pub const fn new(settings: &ActuatorSettings) -> Self {
        Self { curve: TorqueCurve::new(settings), demand: 0.0, torque: 0.0 }
    }

    /// The current loop asks for `per_mille` of rated torque from now on.
    pub fn demand(&mut self, per_mille: f64) {
        if (self.demand - per_mille).abs() > 0.0 {
            self.demand = per_mille;
            self.torque = self.curve.torque(per_mille);
        }
    }

    /// What it exerts on its joint, in N·m (N).
    pub const fn torque(&self) -> f64 {
        self.torque
    }

    /// The torque its current makes, in ‰ of rated torque.
    pub const fn per_mille(&self) -> f64 {
        self.demand
    }

    /// Of its winding, in °C.
    pub const fn temperature(&self) -> f64 {
        ROOM
    }
}

/// In °C.
const ROOM: f64 = 25.0;
