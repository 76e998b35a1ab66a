//! Six drivetrains behind the transmission to the joints.

use crate::arm::Joints;
use crate::drivetrain::{Drivetrain, MotorReading};
use crate::transmission::Transmission;

/// Six drivetrains of an arm, base first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motors {
    trains: [Drivetrain; 6],
    transmission: Transmission,
}

impl Motors {
    /// Creates motors that each drive their own joint.
    pub(super) fn new(trains: [Drivetrain; 6]) -> Self {
        Self { trains, transmission: Transmission::direct() }
    }

    /// Sets the transmission.
    #[must_use]
    pub(super) fn coupled(self, transmission: Transmission) -> Self {
        Self { transmission, ..self }
    }

    /// Returns the torque demands, in ‰ of rated torque.
    pub(super) fn demands(&self) -> [f64; 6] {
        self.trains.each_ref().map(Drivetrain::demand)
    }

    /// Sets the torque demands, in ‰ of rated torque.
    pub(super) fn set_demands(&mut self, per_mille: [f64; 6]) {
        for (train, per_mille) in self.trains.iter_mut().zip(per_mille) {
            train.set_demand(per_mille);
        }
    }

    /// Advances by `h` s and returns the mean joint torques, in N·m or N.
    pub(super) fn step(&mut self, h: f64) -> Joints {
        let tau_m = self.trains.each_mut().map(|train| train.step(h));
        self.transmission.joint_torques(&Joints::from(tau_m))
    }

    /// Sets joint positions and velocities, in rad and rad/s or m and m/s.
    pub(super) fn set_joint_motion(&mut self, q: &Joints, qd: &Joints) {
        let m = self.transmission.positions(q);
        let md = self.transmission.velocities(qd);
        for (train, (position, velocity)) in self.trains.iter_mut().zip(m.iter().zip(md.iter())) {
            train.set_joint_motion(*position, *velocity);
        }
    }

    /// Returns the last torque of each actuator, in N·m (N).
    pub(super) fn torques(&self) -> Joints {
        Joints::from(self.trains.each_ref().map(Drivetrain::torque))
    }

    /// Returns the values that each drive measures.
    pub(super) fn sensed(&self) -> [MotorReading; 6] {
        self.trains.each_ref().map(Drivetrain::sensed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actuator::ActuatorSettings;
    use crate::arm::JointMatrix;
    use crate::drivetrain::DrivetrainSettings;

    const SETTINGS: DrivetrainSettings = DrivetrainSettings::ideal(ActuatorSettings {
        counts_per_rev: 4_096.0,
        gear_ratio: 1.0,
        zero_counts: 0,
        rated_torque: 1.0,
        torque_curve: [100.0, 0.0, 0.0],
        max_torque: 100.0,
    });

    #[test]
    fn transmission_conserves_power() {
        let mut matrix = JointMatrix::identity();
        matrix[(2, 1)] = -1.0;
        let linkage = Transmission::new(&matrix, Joints::repeat(0.1));
        let mut motors = Motors::new([Drivetrain::new(&SETTINGS); 6]).coupled(linkage);
        motors.set_demands([100.0, -200.0, 300.0, 0.0, 50.0, -50.0]);
        let tau = (0..100).map(|_| motors.step(1e-3)).last().unwrap();
        let qd = Joints::from([0.3, -0.2, 0.5, 0.1, 0.7, -0.4]);
        motors.set_joint_motion(&Joints::zeros(), &qd);
        let velocities = Joints::from(motors.sensed().map(|sensed| sensed.velocity));
        assert!((tau.dot(&qd) - motors.torques().dot(&velocities)).abs() < 1e-12);
        assert!((motors.torques()[2] - 3.0).abs() < 1e-12 && (tau[1] - 1.0).abs() < 1e-12, "{tau}");
    }
}
