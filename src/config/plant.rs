//! Plant model: mechanics and actuators of the arm, input of a simulation.
//!
//! The controller has its own model of the same numbers: an arm, and a calibration for each joint.

use nalgebra::Isometry3;

use controller::arm::Link;
use controller::coupling::Coupling;

/// Arm with all joints.
#[derive(Clone, Debug)]
pub struct Plant {
    /// Joints, base first.
    pub joints: [JointPlant; 6],
    /// Pose of {G} in link 6.
    pub x_6_g: Isometry3<f64>,
    /// Gravity in {0}, in m/s².
    pub gravity: [f64; 3],
    /// Coupling of actuators and joints.
    pub coupling: Coupling<6>,
}

/// One joint with its link and its actuator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointPlant {
    /// Kinematics, masses and range.
    pub link: Link,
    /// Start position in simulation, in rad or m.
    pub start: f64,
    /// Friction of bearings and gear, at the joint.
    pub friction: Friction,
    /// Motor, encoder and gear.
    pub actuator: Actuator,
    /// Imperfections from current loop to link.
    pub drivetrain: Drivetrain,
}

/// Coulomb and viscous friction of a joint. Stiction is part of its [`Drivetrain`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Coulomb friction, in N·m or N.
    pub coulomb: f64,
    /// Viscous friction, in N·m·s/rad or N·s/m.
    pub viscous: f64,
}

/// Motor with its encoder and its gear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Actuator {
    /// Encoder counts per revolution of the motor.
    pub counts_per_rev: u32,
    /// Motor revolutions per joint revolution; negative for opposite directions.
    pub gear_ratio: f64,
    /// Counts at joint position zero.
    pub zero_counts: i32,
    /// Rated torque of the motor, in N·m.
    pub rated_torque: f64,
    /// Maximum torque or force at the joint, in N·m or N.
    pub max_torque: f64,
    /// c1, c3, c5 of the torque curve.
    pub torque_curve: [f64; 3],
}

/// Imperfections of motor and gear, unknown to the controller.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drivetrain {
    /// Time constant of the current loop, in s.
    pub current_loop: f64,
    /// c1, c3, c5 of the torque curve for negative torque, if they differ.
    pub torque_curve_reverse: Option<[f64; 3]>,
    /// Excess of static over Coulomb friction, in N·m or N.
    pub stiction: f64,
    /// Width of the torque hysteresis, in N·m or N.
    pub hysteresis: f64,
    /// Backlash between motor and joint, in rad or m.
    pub backlash: f64,
    /// Thermal time constant of the motor's winding, in s.
    pub thermal_time_constant: f64,
}
