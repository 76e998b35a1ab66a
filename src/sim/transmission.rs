//! The linkage between six actuators and six joints: `q = C m + offset`.
//!
//! Seen from the arm: where its joints put the actuators, and what the actuators' torques come to at
//! the joints. The controller looks from the other side.

use crate::arm::JointMatrix;
use crate::arm::Joints;

/// A linkage without play or elasticity.
#[derive(Clone, Copy, Debug)]
pub struct Transmission {
    /// `C⁻¹`: how the actuators turn with the joints.
    ratios: JointMatrix,
    offset: Joints,
}

impl Transmission {
    /// From `C`, a row for each joint, and the joints' positions when all actuators are at zero.
    /// Behind a `C` that has no inverse no actuator moves and none moves anything.
    pub fn new(matrix: &JointMatrix, offset: Joints) -> Self {
        let ratios = matrix.full_piv_lu().try_inverse().unwrap_or_else(JointMatrix::zeros);
        Self { ratios, offset }
    }

    /// Each joint on its own actuator.
    pub fn direct() -> Self {
        Self { ratios: JointMatrix::identity(), offset: Joints::zeros() }
    }

    /// Where the actuators are when the joints are at `q`, in rad or m.
    pub fn positions(&self, q: &Joints) -> Joints {
        self.ratios * (q - self.offset)
    }

    /// How fast the actuators move when the joints move with `qd`, in rad/s or m/s.
    pub fn velocities(&self, qd: &Joints) -> Joints {
        self.ratios * qd
    }

    /// What the actuators' torques come to at the joints, in N·m or N.
    pub fn joint_torques(&self, tau_m: &Joints) -> Joints {
        self.ratios.transpose() * tau_m
    }

    /// What inertia at the actuators comes to at the joints: half of it times the actuators' speeds
    /// squared is the same energy.
    pub fn joint_inertia(&self, actuators: &JointMatrix) -> JointMatrix {
        self.ratios.transpose() * actuators * self.ratios
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::Value;

    use super::*;

    /// An elbow whose actuator stands on the base, a differential in the wrist.
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
        fn what_the_actuators_do_the_joints_do(qd in joints(), tau_m in joints()) {
            let at_joints = linkage().joint_torques(&tau_m).dot(&qd);
            let at_actuators = tau_m.dot(&linkage().velocities(&qd));
            prop_assert!((at_joints - at_actuators).abs() < 1e-12);
        }

        #[test]
        fn a_rotor_has_one_energy(qd in joints()) {
            let rotors = JointMatrix::from_diagonal(&Joints::from([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]));
            let md = linkage().velocities(&qd);
            let difference =
                qd.dot(&(linkage().joint_inertia(&rotors) * qd)) - md.dot(&(rotors * md));
            prop_assert!(difference.abs() < 1e-12);
        }

        #[test]
        fn velocities_are_the_positions_derivative(q in joints(), qd in joints()) {
            let moved = linkage().positions(&(q + qd)) - linkage().positions(&q);
            prop_assert!((moved - linkage().velocities(&qd)).amax() < 1e-12);
        }
    }

    #[test]
    fn a_parallelogram_is_what_an_independent_program_says() {
        let text = include_str!("../../tests/oracles/paper.json");
        let oracle = &serde_json::from_str::<Value>(text).unwrap()["coupling"];
        let six = |key: &str| Joints::from_fn(|row, _| oracle[key][row].as_f64().unwrap());
        let matrix = JointMatrix::from_fn(|row, column| oracle["C"][row][column].as_f64().unwrap());
        let linkage = Transmission::new(&matrix, Joints::zeros());
        assert!((linkage.positions(&six("theta")) - six("measured")).amax() < 1e-12);
        assert!((linkage.joint_torques(&six("tau_actuator")) - six("tau_joint")).amax() < 1e-12);
    }
}
