//! Transmission between six actuators and six joints: `q = C m + offset`.
//!
//! Maps joint motion to actuators, and actuator torques to joints. The controller has the inverse maps.

use crate::arm::{JointMatrix, Joints};

/// Rigid transmission without backlash.
#[derive(Clone, Copy, Debug)]
pub struct Transmission {
    /// `C⁻¹`: actuator velocities per joint velocity.
    ratios: JointMatrix,
    offset: Joints,
}

impl Transmission {
    /// Creates a transmission from `C`, a row per joint, and the joint positions with all actuators at zero. With a
    /// singular `C` no actuator moves, and none drives a joint.
    pub fn new(matrix: &JointMatrix, offset: Joints) -> Self {
        let ratios = matrix.full_piv_lu().try_inverse().unwrap_or_else(JointMatrix::zeros);
        Self { ratios, offset }
    }

    /// Returns the transmission in which each actuator drives its own joint.
    pub fn direct() -> Self {
        Self { ratios: JointMatrix::identity(), offset: Joints::zeros() }
    }

    /// Returns the actuator positions at joint positions `q`, in rad or m.
    pub fn positions(&self, q: &Joints) -> Joints {
        self.ratios * (q - self.offset)
    }

    /// Returns the actuator velocities at joint velocities `qd`, in rad/s or m/s.
    pub fn velocities(&self, qd: &Joints) -> Joints {
        self.ratios * qd
    }

    /// Returns the joint torques of actuator torques, in N·m or N.
    pub fn joint_torques(&self, tau_m: &Joints) -> Joints {
        self.ratios.transpose() * tau_m
    }

    /// Maps an inertia matrix of the actuators to the joints, with equal kinetic energy.
    pub fn joint_inertia(&self, actuators: &JointMatrix) -> JointMatrix {
        self.ratios.transpose() * actuators * self.ratios
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::Value;

    use super::*;

    /// Elbow driven from the base, and a differential wrist.
    fn linkage() -> Transmission {
        let mut matrix = JointMatrix::identity();
        matrix[(2, 1)] = -1.0;
        (matrix[(3, 4)], matrix[(4, 3)], matrix[(4, 4)]) = (1.0, -0.5, 0.5);
        Transmission::new(&matrix, Joints::from([0.0, 0.1, -0.2, 0.0, 0.3, 0.0]))
    }

    fn joints() -> impl Strategy<Value = Joints> {
        prop::array::uniform6(-3.0..3.0_f64).prop_map(Joints::from)
    }

    proptest! {
        #[test]
        fn actuator_and_joint_power_are_equal(qd in joints(), tau_m in joints()) {
            let at_joints = linkage().joint_torques(&tau_m).dot(&qd);
            let at_actuators = tau_m.dot(&linkage().velocities(&qd));
            prop_assert!((at_joints - at_actuators).abs() < 1e-12);
        }

        #[test]
        fn rotor_energy_is_equal_on_both_sides(qd in joints()) {
            let rotors = JointMatrix::from_diagonal(&Joints::from([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]));
            let md = linkage().velocities(&qd);
            let difference =
                qd.dot(&(linkage().joint_inertia(&rotors) * qd)) - md.dot(&(rotors * md));
            prop_assert!(difference.abs() < 1e-12);
        }

        #[test]
        fn velocities_are_the_derivative_of_positions(q in joints(), qd in joints()) {
            let moved = linkage().positions(&(q + qd)) - linkage().positions(&q);
            prop_assert!((moved - linkage().velocities(&qd)).amax() < 1e-12);
        }
    }

    #[test]
    fn parallelogram_matches_an_independent_program() {
        let text = include_str!("../../../tests/oracles/paper.json");
        let oracle = &serde_json::from_str::<Value>(text).unwrap()["coupling"];
        let six = |key: &str| Joints::from_fn(|row, _| oracle[key][row].as_f64().unwrap());
        let matrix = JointMatrix::from_fn(|row, column| oracle["C"][row][column].as_f64().unwrap());
        let linkage = Transmission::new(&matrix, Joints::zeros());
        assert!((linkage.positions(&six("theta")) - six("measured")).amax() < 1e-12);
        assert!((linkage.joint_torques(&six("tau_actuator")) - six("tau_joint")).amax() < 1e-12);
    }
}
