//! Slave arm in motion: rate servos, joint friction, a tool behind a wrist sensor, and contact with a scene.
//!
//! One step of at most [`MAX_STEP`] advances the rates, with the wrench of the scene at its start, and servo and friction
//! at its end (`joint`). The new rates advance the positions (symplectic Euler). A spring of stiffness k at an effective
//! mass m is stable up to `h² k / m = 4`, 64 MN/m for 1 kg. Feed-forward of this model, with the payload, compensates
//! gravity and Coriolis torques; the integrators of the servos compensate contact and friction. Joints have no end stops:
//! the commands keep the limits.
//!
//! The sensed wrench at {S} is that of environment and gravity on the body beyond the sensor, minus the body's inertial
//! wrench (Newton-Euler). It is a mean over the step: `f_s = contact + m (g - a)`.

mod joint;
mod solve;

use nalgebra::{Isometry3, Vector3};

use crate::arm::{
    Arm, Dynamics, InvalidJointCount, JointMatrix, Joints, LinkSettings, Load, Posture,
};
use crate::contact::{Contact, InvalidContact, Scene, Shape};
use crate::manipulator::joint::{Gains, Law, Limits, Servo};
use crate::wrist_sensor::{WristSensor, WristSensorSettings};
use units::spatial::{Jacobian, Twist, Wrench};

/// Maximum number of joints.
pub const MAX_JOINTS: usize = 9;

/// Maximum step of the integration, in s.
pub const MAX_STEP: f64 = 250e-6;

/// One joint and the link after it.
#[derive(Clone, Copy, Debug)]
pub struct JointSettings {
    /// Kinematics and mass.
    pub link: LinkSettings,
    /// Position at the start, in rad or m.
    pub start: f64,
    /// Dry friction, in N·m or N.
    pub coulomb: f64,
    /// Viscous friction, in N·m·s/rad or N·s/m.
    pub viscous: f64,
    /// Maximum torque of the servo, in N·m or N.
    pub max_torque: f64,
}

/// Arm with its servos.
#[derive(Clone, Debug)]
pub struct ManipulatorSettings {
    /// Joints, base first; 1 to [`MAX_JOINTS`].
    pub joints: Vec<JointSettings>,
    /// Pose of the arm's base {0} in {b}.
    pub x_b_0: Isometry3<f64>,
    /// Pose of {M} in the last link.
    pub x_n_m: Isometry3<f64>,
    /// Gravity in {b}, in m/s².
    pub gravity: Vector3<f64>,
    /// Lag of the joint rates behind those commanded, in s.
    pub servo_time_constant: f64,
    /// Errors of the wrist sensor.
    pub sensor: WristSensorSettings,
    /// Seed of the sensor's noise and drift.
    pub seed: u64,
}

/// Body beyond the wrist sensor.
#[derive(Clone, Copy, Debug)]
pub struct Tool {
    /// Shape in contact, fixed to {M}.
    pub shape: Shape,
    /// Pose of the sensor {S} in {M}.
    pub x_m_s: Isometry3<f64>,
    /// Mass properties in {S}.
    pub load: Load,
}

/// Reason why a manipulator cannot be simulated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InvalidManipulator {
    /// Number of joints outside 1..=[`MAX_JOINTS`].
    #[error(transparent)]
    JointCount(#[from] InvalidJointCount),
    /// Tool or scene.
    #[error(transparent)]
    Contact(#[from] InvalidContact),
    /// Parameter out of range.
    #[error("{name} must be {constraint} and finite, got {got}")]
    Parameter {
        /// Name of the parameter.
        name: &'static str,
        /// Valid values.
        constraint: &'static str,
        /// Value.
        got: f64,
    },
}

/// Arm in motion.
#[derive(Clone, Debug)]
pub struct Manipulator {
    arm: Arm<MAX_JOINTS>,
    x_b_0: Isometry3<f64>,
    gravity: Vector3<f64>,
    tool: Tool,
    contact: Contact,
    gains: Gains,
    limits: [Limits; MAX_JOINTS],
    servos: [Servo; MAX_JOINTS],
    q: Joints<MAX_JOINTS>,
    qd: Joints<MAX_JOINTS>,
    tau: Joints<MAX_JOINTS>,
    posture: Posture<MAX_JOINTS>,
    j_m: Jacobian<MAX_JOINTS>,
    x_b_m: Isometry3<f64>,
    f_m_contact: Wrench,
    f_s_true: Wrench,
    sensor: WristSensor,
    f_s_sensed: Wrench,
}

impl Manipulator {
    /// Creates an arm at rest at its start position.
    ///
    /// # Errors
    ///
    /// Returns an error if the number of joints, a parameter, the tool or the scene is invalid.
    pub fn new(
        settings: &ManipulatorSettings,
        tool: Tool,
        scene: Scene,
    ) -> Result<Self, InvalidManipulator> {
        check(settings, &tool)?;
        let links: Vec<LinkSettings> = settings.joints.iter().map(|joint| joint.link).collect();
        let gravity = settings.x_b_0.rotation.inverse() * settings.gravity;
        let arm = Arm::padded(&links, settings.x_n_m, gravity)?
            .carrying(&tool.load, &(settings.x_n_m * tool.x_m_s));
        let contact = Contact::new(tool.shape, scene)?;
        let still = Limits { coulomb: 0.0, viscous: 0.0, max_torque: 0.0 };
        let (mut limits, mut q) = ([still; MAX_JOINTS], Joints::<MAX_JOINTS>::zeros());
        for ((limits, q), joint) in limits.iter_mut().zip(q.iter_mut()).zip(&settings.joints) {
            let JointSettings { coulomb, viscous, max_torque, start, .. } = *joint;
            *limits = Limits { coulomb, viscous, max_torque };
            *q = start;
        }
        let posture = arm.posture(&q);
        let mut manipulator = Self {
            arm,
            x_b_0: settings.x_b_0,
            gravity: settings.gravity,
            tool,
            contact,
            gains: Gains::new(settings.servo_time_constant),
            limits,
            servos: [Servo::default(); MAX_JOINTS],
            q,
            qd: Joints::zeros(),
            tau: Joints::zeros(),
            posture,
            j_m: arm.jacobian(&posture),
            x_b_m: settings.x_b_0 * arm.pose(&posture),
            f_m_contact: Wrench::ZERO,
            f_s_true: Wrench::ZERO,
            sensor: WristSensor::new(settings.sensor, settings.seed),
            f_s_sensed: Wrench::ZERO,
        };
        manipulator.f_s_true = manipulator.load_wrench(&Twist::ZERO);
        manipulator.f_s_sensed = manipulator.sensor.read(&manipulator.f_s_true, 0.0);
        Ok(manipulator)
    }

    /// Advances by `dt` s with commanded joint rates, in rad/s or m/s. Those beyond the last joint have no effect.
    pub fn step(&mut self, dt: f64, qd_commanded: &[f64; MAX_JOINTS]) {
        let v_m = self.v_m();
        let (mut f_m, mut left, mut steps) = (Wrench::ZERO, dt, 0.0);
        while left > MAX_STEP * 1e-6 {
            // Equal steps: the number of those left is rounded up.
            let h = left / (left / MAX_STEP - 1e-6).ceil().max(1.0);
            f_m = f_m + self.substep(h, qd_commanded) * h;
            left -= h;
            steps += h;
        }
        if steps > 0.0 {
            self.f_m_contact = f_m * (1.0 / steps);
            let change = self.v_m() + v_m * -1.0;
            self.f_s_true = self.load_wrench(&(change * (1.0 / steps)));
            self.f_s_sensed = self.sensor.read(&self.f_s_true, steps);
        }
    }

    /// Advances by `h` s; returns the wrench of the scene at {M} in {M}.
    fn substep(&mut self, h: f64, qd_commanded: &[f64; MAX_JOINTS]) -> Wrench {
        let f_m = self.contact.wrench(&self.x_b_m, &self.v_m());
        let Dynamics { mass, bias } = self.arm.dynamics(&self.posture, &self.qd);
        let momentum = mass * self.qd + (self.j_m.torques(&f_m) - bias) * h;
        let laws = self.laws(h, qd_commanded, &mass, &bias);
        self.qd = solve::rates(&mass, &momentum, &laws, self.qd);
        let states = self.servos.iter_mut().zip(self.tau.iter_mut());
        for ((servo, tau), (law, rate)) in states.zip(laws.iter().zip(self.qd.iter())) {
            servo.integrate(h, *rate, law);
            *tau = law.servo(*rate) / h;
        }
        self.q += self.qd * h;
        self.posture = self.arm.posture(&self.q);
        self.j_m = self.arm.jacobian(&self.posture);
        self.x_b_m = self.x_b_0 * self.arm.pose(&self.posture);
        f_m
    }

    /// Returns the laws of all joints over `h` s; the feed-forward has the `bias` and the inertial torques of the arm.
    fn laws(
        &mut self,
        h: f64,
        qd_commanded: &[f64; MAX_JOINTS],
        mass: &JointMatrix<MAX_JOINTS>,
        bias: &Joints<MAX_JOINTS>,
    ) -> [Law; MAX_JOINTS] {
        let count = self.arm.count();
        let mut wanted = Joints::<MAX_JOINTS>::zeros();
        let servos = self.servos.iter_mut().zip(qd_commanded).take(count);
        for (wanted, (servo, commanded)) in wanted.iter_mut().zip(servos) {
            *wanted = servo.follow(h, &self.gains, *commanded);
        }
        let (inertia, carried) = (mass.diagonal(), bias + mass * wanted);
        let mut laws = [Law::default(); MAX_JOINTS];
        let joints = self.servos.iter().zip(&self.limits).take(count);
        for ((law, (servo, limits)), (inertia, carried)) in
            laws.iter_mut().zip(joints).zip(inertia.iter().zip(carried.iter()))
        {
            *law = servo.law(h, &self.gains, limits, [*inertia, *carried]);
        }
        laws
    }

    /// Returns the wrench at {S} on the load, minus its inertial wrench.
    fn load_wrench(&self, a_m: &Twist) -> Wrench {
        let x_s_m = self.tool.x_m_s.inverse();
        let Load { mass, centre_of_mass, inertia } = self.tool.load;
        let x_c_m = Isometry3::from(-centre_of_mass) * x_s_m;
        let (v_c, a_c) = (self.v_m().at(&x_c_m), a_m.at(&x_c_m));
        let acceleration = a_c.linear + v_c.angular.cross(&v_c.linear);
        let gravity = (self.x_b_m.rotation * self.tool.x_m_s.rotation).inverse() * self.gravity;
        let spin = v_c.angular.cross(&(inertia * v_c.angular));
        let f_c = Wrench {
            force: (gravity - acceleration) * mass,
            moment: -(inertia * a_c.angular + spin),
        };
        self.f_m_contact.at(&x_s_m) + f_c.at(&Isometry3::from(centre_of_mass))
    }

    /// Returns the joint positions, in rad or m; those beyond the last joint are zero.
    pub fn q(&self) -> [f64; MAX_JOINTS] {
        self.q.into()
    }

    /// Returns the joint rates, in rad/s or m/s.
    pub fn qd(&self) -> [f64; MAX_JOINTS] {
        self.qd.into()
    }

    /// Returns the torques of the servos in the last substep, in N·m or N.
    pub fn tau(&self) -> [f64; MAX_JOINTS] {
        self.tau.into()
    }

    /// Returns the number of joints.
    pub const fn joint_count(&self) -> usize {
        self.arm.count()
    }

    /// Returns the pose of {M} in {b}.
    pub const fn x_b_m(&self) -> &Isometry3<f64> {
        &self.x_b_m
    }

    /// Returns the twist of {M}, in {M}.
    pub fn v_m(&self) -> Twist {
        self.j_m.twist(&self.qd)
    }

    /// Returns the wrench of the scene on the tool, at {M} in {M}, as a mean over the last step.
    pub const fn f_m_contact(&self) -> &Wrench {
        &self.f_m_contact
    }

    /// Returns the true wrench at {S} in {S} on the body beyond the sensor, as a mean over the last step: contact and
    /// `m (g - a)`.
    pub const fn f_s_true(&self) -> &Wrench {
        &self.f_s_true
    }

    /// Returns the reading of the wrist sensor after the last step: the true wrench with the errors of the sensor.
    pub const fn f_s_sensed(&self) -> &Wrench {
        &self.f_s_sensed
    }

    /// Returns the tool in its scene.
    pub const fn contact(&self) -> &Contact {
        &self.contact
    }

    /// Returns kinetic and potential energy of the arm with its load, in J, without that of contact.
    pub fn energy(&self) -> f64 {
        self.arm.energy(&self.posture, &self.qd)
    }
}

/// Checks the numbers of a manipulator.
fn check(settings: &ManipulatorSettings, tool: &Tool) -> Result<(), InvalidManipulator> {
    let positive = |name, got: f64| {
        let constraint = "positive";
        let is_valid = got.is_finite() && got > 0.0;
        if is_valid { Ok(()) } else { Err(InvalidManipulator::Parameter { name, constraint, got }) }
    };
    let not_negative = |name, got: f64| {
        let constraint = "0 or above";
        let is_valid = got.is_finite() && got >= 0.0;
        if is_valid { Ok(()) } else { Err(InvalidManipulator::Parameter { name, constraint, got }) }
    };
    positive("servo_time_constant", settings.servo_time_constant)?;
    not_negative("mass of the tool", tool.load.mass)?;
    for joint in &settings.joints {
        not_negative("coulomb", joint.coulomb)?;
        not_negative("viscous", joint.viscous)?;
        positive("max_torque", joint.max_torque)?;
        not_negative("mass of a link", joint.link.mass)?;
        not_negative("rotor inertia", joint.link.rotor_inertia)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests;
