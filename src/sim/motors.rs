//! Six motors behind the linkage that turns them with the joints.

use crate::arm::Joints;
use crate::drivetrain::Drivetrain;
use crate::drivetrain::Sensed;
use crate::transmission::Transmission;

/// The six drivetrains of an arm, base first.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motors {
    trains: [Drivetrain; 6],
    transmission: Transmission,
}

impl Motors {
    /// Each behind its own joint.
    pub(super) fn new(trains: [Drivetrain; 6]) -> Self {
        Self { trains, transmission: Transmission::direct() }
    }

    /// The same behind a linkage.
    #[must_use]
    pub(super) fn coupled(self, transmission: Transmission) -> Self {
        Self { transmission, ..self }
    }

    /// What is asked of each, in ‰ of rated torque.
    pub(super) fn demands(&self) -> [f64; 6] {
        self.trains.each_ref().map(Drivetrain::demand)
    }

    /// Asks something of each from now on, in ‰ of rated torque.
    pub(super) fn ask(&mut self, per_mille: [f64; 6]) {
        for (train, per_mille) in self.trains.iter_mut().zip(per_mille) {
            train.ask(per_mille);
        }
    }

    /// Lets `h` s pass; what the motors come to at the joints in their mean, in N·m or N.
    pub(super) fn exert(&mut self, h: f64) -> Joints {
        let tau_m = self.trains.each_mut().map(|train| train.exert(h));
        self.transmission.joint_torques(&Joints::from(tau_m))
    }

    /// The joints have moved to `q` with `qd`, in rad and rad/s or m and m/s.
    pub(super) fn follow(&mut self, q: &Joints, qd: &Joints) {
        let m = self.transmission.positions(q);
        let md = self.transmission.velocities(qd);
        for (train, (position, velocity)) in self.trains.iter_mut().zip(m.iter().zip(md.iter())) {
            train.follow(*position, *velocity);
        }
    }

    /// What each exerted last on what it moves, in N·m (N).
    pub(super) fn torques(&self) -> Joints {
        Joints::from(self.trains.each_ref().map(Drivetrain::torque))
    }

    /// What the drive of each senses.
    pub(super) fn sensed(&self) -> [Sensed; 6] {
        self.trains.each_ref().map(Drivetrain::sensed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actuator::ActuatorSettings;
    use crate::arm::JointMatrix;
    use crate::drivetrain::DrivetrainSettings;

    const SETTINGS: DrivetrainSettings = DrivetrainSettings::good(ActuatorSettings {
        counts_per_rev: 4_096.0,
        gear_ratio: 1.0,
        zero_counts: 0,
        rated_torque: 1.0,
        torque_curve: [100.0, 0.0, 0.0],
        max_torque: 100.0,
    });

    #[test]
    fn motors_behind_a_linkage_give_the_joints_the_power_they_take() {
        let mut matrix = JointMatrix::identity();
        matrix[(2, 1)] = -1.0;
        let linkage = Transmission::new(&matrix, Joints::repeat(0.1));
        let mut motors = Motors::new([Drivetrain::new(&SETTINGS); 6]).coupled(linkage);
        motors.ask([100.0, -200.0, 300.0, 0.0, 50.0, -50.0]);
        let tau = (0..100).map(|_| motors.exert(1e-3)).last().unwrap();
        let qd = Joints::from([0.3, -0.2, 0.5, 0.1, 0.7, -0.4]);
        motors.follow(&Joints::zeros(), &qd);
        let velocities = Joints::from(motors.sensed().map(|sensed| sensed.velocity));
        assert!((tau.dot(&qd) - motors.torques().dot(&velocities)).abs() < 1e-12);
        assert!((motors.torques()[2] - 3.0).abs() < 1e-12 && (tau[1] - 1.0).abs() < 1e-12, "{tau}");
    }
}
