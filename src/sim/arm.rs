//! The arm as a body: kinematics and dynamics of a serial chain in Craig's modified DH.
//!
//! Nothing here is shared with the controller, which computes the same arm another way: motions are
//! carried outward and forces inward, link by link, in the links' own frames (Craig 1989, 6.5).

use nalgebra::Isometry3;
use nalgebra::Matrix3;
use nalgebra::SMatrix;
use nalgebra::SVector;
use nalgebra::Translation3;
use nalgebra::UnitQuaternion;
use nalgebra::Vector3;

use crate::spatial::Jacobian;
use crate::spatial::Twist;
use crate::spatial::Wrench;

/// One number per joint, base first.
pub type Joints = SVector<f64, 6>;

/// One link and the joint before it.
#[derive(Clone, Copy, Debug)]
pub struct LinkSettings {
    /// Whether the joint slides rather than turns.
    pub is_prismatic: bool,
    /// α of the axis before, in rad.
    pub alpha: f64,
    /// a of the axis before, in m.
    pub a: f64,
    /// d, in m; a sliding joint's position comes on top.
    pub d: f64,
    /// θ, in rad; a turning joint's position comes on top.
    pub theta: f64,
    /// In kg.
    pub mass: f64,
    /// In the link's frame, in m.
    pub centre_of_mass: Vector3<f64>,
    /// About the centre of mass, in kg·m².
    pub inertia: Matrix3<f64>,
    /// Of the rotor, seen at the joint, in kg·m² (kg for a sliding joint).
    pub rotor_inertia: f64,
}

/// A whole arm.
#[derive(Clone, Copy, Debug)]
pub struct ArmSettings {
    /// Its links, base first.
    pub links: [LinkSettings; 6],
    /// Pose of the grip in the last link.
    pub x_6_g: Isometry3<f64>,
    /// In {0}, in m/s².
    pub gravity: Vector3<f64>,
}

/// A serial chain of six joints with a grip.
#[derive(Clone, Copy, Debug)]
pub struct Arm {
    settings: ArmSettings,
}

/// Where each link is, seen from the one before.
#[derive(Clone, Copy, Debug)]
pub struct Posture([Isometry3<f64>; 6]);

impl Arm {
    /// As described.
    pub const fn new(settings: ArmSettings) -> Self {
        Self { settings }
    }

    /// Where each link is at joint positions `q`, in rad or m.
    pub fn posture(&self, q: &Joints) -> Posture {
        let mut steps = [Isometry3::identity(); 6];
        for ((step, link), q) in steps.iter_mut().zip(&self.settings.links).zip(q.iter()) {
            *step = link.step(*q);
        }
        Posture(steps)
    }

    /// The pose of the grip in {0}.
    pub fn pose(&self, posture: &Posture) -> Isometry3<f64> {
        posture.0.iter().fold(Isometry3::identity(), |x, step| x * step) * self.settings.x_6_g
    }

    /// The body Jacobian of the grip, in {G}.
    pub fn jacobian(&self, posture: &Posture) -> Jacobian<6> {
        let mut columns = [Twist::ZERO; 6];
        // From the grip inward: where link i is, seen from the grip.
        let mut x_g_i = self.settings.x_6_g.inverse();
        let joints = columns.iter_mut().zip(&self.settings.links).zip(&posture.0);
        for ((column, link), step) in joints.rev() {
            *column = link.unit_motion().at(&x_g_i);
            x_g_i *= step.inverse();
        }
        Jacobian::from_columns(&columns)
    }

    /// The torques that hold the arm against gravity, in N·m or N.
    pub fn gravity(&self, posture: &Posture) -> Joints {
        let rest = Joints::zeros();
        self.inverse_dynamics(posture, &rest, &rest, &self.settings.gravity)
    }

    /// What joint velocities and gravity ask for: `C(q, qd) qd + g(q)`.
    pub fn bias(&self, posture: &Posture, qd: &Joints) -> Joints {
        self.inverse_dynamics(posture, qd, &Joints::zeros(), &self.settings.gravity)
    }

    /// The mass matrix: each column is what a unit acceleration of one joint asks for.
    pub fn mass_matrix(&self, posture: &Posture) -> SMatrix<f64, 6, 6> {
        let rest = Joints::zeros();
        let mut mass = SMatrix::<f64, 6, 6>::zeros();
        for (joint, mut column) in mass.column_iter_mut().enumerate() {
            let unit = Joints::ith(joint, 1.0);
            column.copy_from(&self.inverse_dynamics(posture, &rest, &unit, &Vector3::zeros()));
        }
        mass
    }

    /// The accelerations that torques `tau` and a wrench on the grip, at {G} in {G}, give.
    pub fn acceleration(
        &self,
        posture: &Posture,
        qd: &Joints,
        tau: &Joints,
        f_g: &Wrench,
    ) -> Joints {
        let push = tau + self.jacobian(posture).torques(f_g) - self.bias(posture, qd);
        let mass = self.mass_matrix(posture);
        mass.cholesky().map_or_else(Joints::zeros, |mass| mass.solve(&push))
    }

    /// The torques that a motion asks for: velocities and accelerations are carried out to the last
    /// link, the forces that move each link are carried back in.
    fn inverse_dynamics(
        &self,
        posture: &Posture,
        qd: &Joints,
        qdd: &Joints,
        gravity: &Vector3<f64>,
    ) -> Joints {
        let mut efforts = [(Vector3::zeros(), Vector3::zeros()); 6];
        let (mut omega, mut alpha) = (Vector3::zeros(), Vector3::zeros());
        // A base that accelerates upwards weighs like one that rests.
        let mut acceleration = -gravity;
        let links = self.settings.links.iter().zip(&posture.0);
        for ((effort, (link, step)), (qd, qdd)) in
            efforts.iter_mut().zip(links).zip(qd.iter().zip(qdd.iter()))
        {
            let p = step.translation.vector;
            let carried = acceleration + alpha.cross(&p) + omega.cross(&omega.cross(&p));
            acceleration = step.rotation.inverse() * carried;
            omega = step.rotation.inverse() * omega;
            alpha = step.rotation.inverse() * alpha;
            let (rate, change) = (Vector3::z() * *qd, Vector3::z() * *qdd);
            if link.is_prismatic {
                acceleration += 2.0 * omega.cross(&rate) + change;
            } else {
                alpha += omega.cross(&rate) + change;
                omega += rate;
            }
            let c = link.centre_of_mass;
            let of_mass = acceleration + alpha.cross(&c) + omega.cross(&omega.cross(&c));
            let force = link.mass * of_mass;
            let moment = link.inertia * alpha + omega.cross(&(link.inertia * omega));
            *effort = (force, moment + c.cross(&force));
        }

        let mut tau = Joints::zeros();
        let (mut force, mut moment) = (Vector3::zeros(), Vector3::zeros());
        let links = self.settings.links.iter().zip(&posture.0).zip(&efforts);
        for ((tau, qdd), ((link, step), (own_force, own_moment))) in
            tau.iter_mut().zip(qdd.iter()).zip(links).rev()
        {
            force += own_force;
            moment += own_moment;
            let along = if link.is_prismatic { force.z } else { moment.z };
            *tau = along + link.rotor_inertia * qdd;
            force = step.rotation * force;
            moment = step.rotation * moment + step.translation.vector.cross(&force);
        }
        tau
    }
}

impl LinkSettings {
    /// The pose of this link in the one before: `Rx(α) Tx(a) Rz(θ) Tz(d)`.
    fn step(&self, q: f64) -> Isometry3<f64> {
        let (d, theta) =
            if self.is_prismatic { (self.d + q, self.theta) } else { (self.d, self.theta + q) };
        let about_x = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), self.alpha);
        let about_z = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), theta);
        let place = about_x * Vector3::new(self.a, 0.0, d);
        Isometry3::from_parts(Translation3::from(place), about_x * about_z)
    }

    /// The twist of this link, in its own frame, when its joint moves by one unit a second.
    fn unit_motion(&self) -> Twist {
        if self.is_prismatic {
            Twist { linear: Vector3::z(), angular: Vector3::zeros() }
        } else {
            Twist { linear: Vector3::zeros(), angular: Vector3::z() }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    fn numbers<const N: usize>(value: &Value) -> [f64; N] {
        std::array::from_fn(|place| value[place].as_f64().unwrap())
    }

    fn joints(value: &Value) -> Joints {
        Joints::from(numbers(value))
    }

    fn pose(value: &Value) -> Isometry3<f64> {
        let row = |row: usize| numbers::<4>(&value[row]);
        let rotation = Matrix3::from_fn(|r, c| row(r)[c]);
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(rotation);
        let place = Translation3::new(row(0)[3], row(1)[3], row(2)[3]);
        Isometry3::from_parts(place, UnitQuaternion::from_rotation_matrix(&rotation))
    }

    fn matrix(value: &Value) -> SMatrix<f64, 6, 6> {
        SMatrix::from_fn(|row, column| value[row][column].as_f64().unwrap())
    }

    fn arm(model: &Value) -> Arm {
        let links = std::array::from_fn(|place| {
            let (row, link) = (&model["rows"][place], &model["links"][place]);
            let number = |key: &str| row[key].as_f64().unwrap();
            LinkSettings {
                is_prismatic: row["type"] == "P",
                alpha: number("alpha_im1"),
                a: number("a_im1"),
                d: number("d"),
                theta: number("theta"),
                mass: link["m"].as_f64().unwrap(),
                centre_of_mass: Vector3::from(numbers(&link["r"])),
                inertia: Matrix3::from_fn(|r, c| link["I"][r][c].as_f64().unwrap()),
                rotor_inertia: link["armature"].as_f64().unwrap(),
            }
        });
        let gravity = Vector3::from(numbers(&model["g0"]));
        Arm::new(ArmSettings { links, x_6_g: pose(&model["T_6G"]), gravity })
    }

    #[test]
    fn every_arm_is_what_independent_programs_say() {
        for text in [
            include_str!("../../tests/oracles/kraft_like.json"),
            include_str!("../../tests/oracles/jpl_like.json"),
            include_str!("../../tests/oracles/sixr_spherical.json"),
            include_str!("../../tests/oracles/puma560_corke_mdh.json"),
        ] {
            let oracle: Value = serde_json::from_str(text).unwrap();
            let arm = arm(&oracle["model"]);
            for config in oracle["configs"].as_array().unwrap() {
                let (q, qd) = (joints(&config["q"]), joints(&config["qd"]));
                let posture = arm.posture(&q);
                let tau = joints(&config["tau"]);
                let f_g = Wrench::from_components(numbers(&config["F_ext_G"]));

                let x_0_g = arm.pose(&posture).to_homogeneous();
                assert!((x_0_g - pose(&config["T_0G"]).to_homogeneous()).norm() < 1e-9);
                let j_g = arm.jacobian(&posture);
                let expected = matrix(&config["J_body_G"]);
                assert!((j_g.linear - expected.fixed_rows::<3>(0)).norm() < 1e-9);
                assert!((j_g.angular - expected.fixed_rows::<3>(3)).norm() < 1e-9);
                let gravity = joints(&config["gravity"]);
                assert!((arm.gravity(&posture) - gravity).norm() < 1e-9);
                let bias = gravity + joints(&config["Cqd"]);
                assert!((arm.bias(&posture, &qd) - bias).norm() < 1e-9);
                assert!((arm.mass_matrix(&posture) - matrix(&config["M"])).norm() < 1e-9);
                let qdd = joints(&config["qdd_forward_dynamics"]);
                let error = arm.acceleration(&posture, &qd, &tau, &f_g) - qdd;
                assert!(error.norm() < 1e-9 * (1.0 + qdd.norm()), "{error}");
            }
        }
    }

    #[test]
    fn without_friction_no_energy_is_lost_or_made() {
        let oracle: Value =
            serde_json::from_str(include_str!("../../tests/oracles/kraft_like.json")).unwrap();
        let arm = arm(&oracle["model"]);
        let energy = |q: &Joints, qd: &Joints| {
            let posture = arm.posture(q);
            let mut x = Isometry3::identity();
            let links = arm.settings.links.iter().zip(&posture.0);
            let potential = links.map(|(link, step)| {
                x *= step;
                -link.mass
                    * arm
                        .settings
                        .gravity
                        .dot(&(x * nalgebra::Point3::from(link.centre_of_mass)).coords)
            });
            0.5 * qd.dot(&(arm.mass_matrix(&posture) * qd)) + potential.sum::<f64>()
        };
        let still = Joints::zeros();
        let rate =
            |q: &Joints, qd: &Joints| arm.acceleration(&arm.posture(q), qd, &still, &Wrench::ZERO);
        let mut q = joints(&oracle["configs"][0]["q"]);
        let mut qd = Joints::from([0.5, -0.3, 0.4, 0.2, -0.6, 0.8]);
        let before = energy(&q, &qd);
        let h = 5e-5;
        for _ in 0..10_000 {
            // Runge and Kutta's fourth-order step.
            let (v1, a1) = (qd, rate(&q, &qd));
            let (v2, a2) =
                (qd + a1 * (h / 2.0), rate(&(q + v1 * (h / 2.0)), &(qd + a1 * (h / 2.0))));
            let (v3, a3) =
                (qd + a2 * (h / 2.0), rate(&(q + v2 * (h / 2.0)), &(qd + a2 * (h / 2.0))));
            let (v4, a4) = (qd + a3 * h, rate(&(q + v3 * h), &(qd + a3 * h)));
            q += (v1 + 2.0 * v2 + 2.0 * v3 + v4) * (h / 6.0);
            qd += (a1 + 2.0 * a2 + 2.0 * a3 + a4) * (h / 6.0);
        }
        let lost = before - energy(&q, &qd);
        assert!(lost.abs() < 1e-6, "{lost} J");
    }
}
