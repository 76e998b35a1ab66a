//! The arm as a body: kinematics and dynamics of a serial chain in Craig's modified DH.
//!
//! Nothing here is shared with the controller, which computes the same arm another way: motions are
//! carried outward and forces inward, link by link, in the links' own frames (Craig 1989, 6.5); inertia
//! is gathered from the grip inward (Featherstone 2008, 6.2).

use nalgebra::Isometry3;
use nalgebra::IsometryMatrix3;
use nalgebra::Matrix3;
use nalgebra::Rotation3;
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
    /// Of the actuator's rotor, seen after its gear, in kg·m² (kg for a sliding joint).
    pub rotor_inertia: f64,
}

/// A matrix over pairs of joints.
pub type JointMatrix = SMatrix<f64, 6, 6>;

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
    links: [Link; 6],
    x_6_g: IsometryMatrix3<f64>,
    gravity: Vector3<f64>,
    /// What the rotors add to the mass matrix.
    rotors: JointMatrix,
}

/// Where each link is, seen from the one before.
#[derive(Clone, Copy, Debug)]
pub struct Posture([IsometryMatrix3<f64>; 6]);

impl Arm {
    /// As described.
    pub fn new(settings: ArmSettings) -> Self {
        Self {
            links: settings.links.map(Link::new),
            x_6_g: nalgebra::convert(settings.x_6_g),
            gravity: settings.gravity,
            rotors: JointMatrix::from_diagonal(&Joints::from(
                settings.links.map(|link| link.rotor_inertia),
            )),
        }
    }

    /// The same arm behind a linkage, which its rotors turn with: `joint_inertia` says what theirs comes
    /// to at the joints. Asked of an arm once.
    #[must_use]
    pub fn driven_through(self, joint_inertia: impl FnOnce(&JointMatrix) -> JointMatrix) -> Self {
        Self { rotors: joint_inertia(&self.rotors), ..self }
    }

    /// Where each link is at joint positions `q`, in rad or m.
    pub fn posture(&self, q: &Joints) -> Posture {
        let mut steps = [IsometryMatrix3::identity(); 6];
        for ((step, link), q) in steps.iter_mut().zip(&self.links).zip(q.iter()) {
            *step = link.step(*q);
        }
        Posture(steps)
    }

    /// The pose of the grip in {0}.
    pub fn pose(&self, posture: &Posture) -> Isometry3<f64> {
        let x_0_6 = posture.0.iter().fold(IsometryMatrix3::identity(), |x, step| x * step);
        let x_0_g = x_0_6 * self.x_6_g;
        let rotation = UnitQuaternion::from_rotation_matrix(&x_0_g.rotation);
        Isometry3::from_parts(x_0_g.translation, rotation)
    }

    /// The body Jacobian of the grip, in {G}.
    pub fn jacobian(&self, posture: &Posture) -> Jacobian<6> {
        let mut columns = [Twist::ZERO; 6];
        // From the grip inward: where the grip is, seen from link i.
        let mut x_i_g = self.x_6_g;
        for ((column, link), step) in columns.iter_mut().zip(&self.links).zip(&posture.0).rev() {
            let axis = x_i_g.rotation.inverse() * Vector3::z();
            let turned = x_i_g.rotation.inverse() * Vector3::z().cross(&x_i_g.translation.vector);
            *column = if link.is_prismatic {
                Twist { linear: axis, angular: Vector3::zeros() }
            } else {
                Twist { linear: turned, angular: axis }
            };
            x_i_g = step * x_i_g;
        }
        Jacobian::from_columns(&columns)
    }

    /// The torques that hold the arm against gravity, in N·m or N.
    pub fn gravity(&self, posture: &Posture) -> Joints {
        self.bias(posture, &Joints::zeros())
    }

    /// Kinetic and potential energy, in J; the latter is zero where every link's mass is in the origin of {0}.
    pub fn energy(&self, posture: &Posture, qd: &Joints) -> f64 {
        let mut x_0_i = IsometryMatrix3::identity();
        let potential = self.links.iter().zip(&posture.0).map(|(link, step)| {
            x_0_i *= step;
            -link.body.carried_in(&x_0_i).first_moment.dot(&self.gravity)
        });
        qd.dot(&(self.mass_matrix(posture) * qd)) / 2.0 + potential.sum::<f64>()
    }

    /// What joint velocities and gravity ask for: `C(q, qd) qd + g(q)`. Velocities and accelerations
    /// are carried out to the last link, the forces that move each link are carried back in.
    pub fn bias(&self, posture: &Posture, qd: &Joints) -> Joints {
        let mut efforts = [Effort::NONE; 6];
        let (mut omega, mut alpha) = (Vector3::zeros(), Vector3::zeros());
        // A base that accelerates upwards weighs like one that rests.
        let mut acceleration = -self.gravity;
        let links = self.links.iter().zip(&posture.0);
        for ((effort, (link, step)), qd) in efforts.iter_mut().zip(links).zip(qd.iter()) {
            let p = step.translation.vector;
            let inward = step.rotation.inverse();
            let carried = acceleration + alpha.cross(&p) + omega.cross(&omega.cross(&p));
            acceleration = inward * carried;
            omega = inward * omega;
            alpha = inward * alpha;
            let rate = Vector3::z() * *qd;
            if link.is_prismatic {
                acceleration += 2.0 * omega.cross(&rate);
            } else {
                alpha += omega.cross(&rate);
                omega += rate;
            }
            *effort = link.body.effort(&acceleration, &alpha, &omega);
        }

        let mut tau = Joints::zeros();
        let mut outboard = Effort::NONE;
        let links = self.links.iter().zip(&posture.0);
        for ((tau, (link, step)), own) in tau.iter_mut().zip(links).zip(&efforts).rev() {
            let effort = outboard.plus(own);
            *tau = link.share(&effort);
            outboard = effort.carried_in(step);
        }
        tau
    }

    /// The mass matrix: each column is what a unit acceleration of one joint asks for. That joint moves
    /// all links from itself outward as one body, and the joints before it hold what that body needs.
    pub fn mass_matrix(&self, posture: &Posture) -> JointMatrix {
        let mut mass = JointMatrix::zeros();
        let mut outboard = Body::NONE;
        for (joint, (link, step)) in self.links.iter().zip(&posture.0).enumerate().rev() {
            let composite = link.body.plus(&outboard);
            let (linear, angular) = link.unit_motion();
            let mut effort = composite.effort(&linear, &angular, &Vector3::zeros());
            let mut column = mass.column_mut(joint);
            let inboard = self.links.iter().zip(&posture.0).zip(column.iter_mut());
            for ((link, step), entry) in inboard.take(joint + 1).rev() {
                *entry = link.share(&effort);
                effort = effort.carried_in(step);
            }
            outboard = composite.carried_in(step);
        }
        mass.fill_lower_triangle_with_upper_triangle();
        mass + self.rotors
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
        accelerations(self.mass_matrix(posture), &push, &[false; 6])
    }
}

/// The accelerations that `push` gives to `mass`, the joints that are `held` having none.
pub(super) fn accelerations(mut mass: JointMatrix, push: &Joints, held: &[bool; 6]) -> Joints {
    let mut push = *push;
    for (joint, _) in held.iter().enumerate().filter(|(_, held)| **held) {
        mass.fill_row(joint, 0.0);
        mass.fill_column(joint, 0.0);
        mass.view_mut((joint, joint), (1, 1)).fill(1.0);
        push.fill_row(joint, 0.0);
    }
    mass.cholesky().map_or_else(Joints::zeros, |mass| mass.solve(&push))
}

/// One link, with what does not change worked out once.
#[derive(Clone, Copy, Debug)]
struct Link {
    is_prismatic: bool,
    /// `Rx(α)`.
    about_x: Rotation3<f64>,
    a: f64,
    d: f64,
    theta: f64,
    body: Body,
}

impl Link {
    fn new(settings: LinkSettings) -> Self {
        let c = settings.centre_of_mass;
        let about_centre =
            Body { mass: settings.mass, first_moment: Vector3::zeros(), inertia: settings.inertia };
        let centre = IsometryMatrix3::from_parts(Translation3::from(c), Rotation3::identity());
        Self {
            is_prismatic: settings.is_prismatic,
            about_x: Rotation3::from_axis_angle(&Vector3::x_axis(), settings.alpha),
            a: settings.a,
            d: settings.d,
            theta: settings.theta,
            body: about_centre.carried_in(&centre),
        }
    }

    /// The pose of this link in the one before: `Rx(α) Tx(a) Rz(θ) Tz(d)`.
    fn step(&self, q: f64) -> IsometryMatrix3<f64> {
        let (d, theta) =
            if self.is_prismatic { (self.d + q, self.theta) } else { (self.d, self.theta + q) };
        let about_z = Rotation3::from_axis_angle(&Vector3::z_axis(), theta);
        let place = self.about_x * Vector3::new(self.a, 0.0, d);
        IsometryMatrix3::from_parts(Translation3::from(place), self.about_x * about_z)
    }

    /// The linear and angular acceleration of this link, in its own frame, that a unit acceleration of
    /// its joint is.
    fn unit_motion(&self) -> (Vector3<f64>, Vector3<f64>) {
        let (still, along) = (Vector3::zeros(), Vector3::z());
        if self.is_prismatic { (along, still) } else { (still, along) }
    }

    /// The part of `effort` on this link that its joint gives; the bearings give the rest.
    fn share(&self, effort: &Effort) -> f64 {
        if self.is_prismatic { effort.force.z } else { effort.moment.z }
    }
}

/// Mass that moves as one, about the origin of some frame and written in it.
#[derive(Clone, Copy, Debug)]
struct Body {
    /// In kg.
    mass: f64,
    /// Mass times centre of mass, in kg·m.
    first_moment: Vector3<f64>,
    /// About the origin, in kg·m².
    inertia: Matrix3<f64>,
}

impl Body {
    const NONE: Self = Self {
        mass: 0.0,
        first_moment: Vector3::new(0.0, 0.0, 0.0),
        inertia: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    fn plus(&self, other: &Self) -> Self {
        Self {
            mass: self.mass + other.mass,
            first_moment: self.first_moment + other.first_moment,
            inertia: self.inertia + other.inertia,
        }
    }

    /// The same body about the origin before `step`: the parallel axis theorem.
    fn carried_in(&self, step: &IsometryMatrix3<f64>) -> Self {
        let p = step.translation.vector;
        let turned = step.rotation * self.first_moment;
        let arm = 2.0 * turned + p * self.mass;
        let outer = arm * p.transpose();
        let shift = Matrix3::from_diagonal_element(arm.dot(&p)) - (outer + outer.transpose()) / 2.0;
        Self {
            mass: self.mass,
            first_moment: turned + p * self.mass,
            inertia: step.rotation * self.inertia * step.rotation.transpose() + shift,
        }
    }

    /// What moves it: the acceleration of the origin, angular acceleration and angular velocity given
    /// (Newton and Euler).
    fn effort(
        &self,
        acceleration: &Vector3<f64>,
        alpha: &Vector3<f64>,
        omega: &Vector3<f64>,
    ) -> Effort {
        let s = &self.first_moment;
        let swing = alpha.cross(s) + omega.cross(&omega.cross(s));
        let spin = self.inertia * alpha + omega.cross(&(self.inertia * omega));
        Effort { force: acceleration * self.mass + swing, moment: spin + s.cross(acceleration) }
    }
}

/// A force, and a moment about some origin, on a link from the one before.
#[derive(Clone, Copy, Debug)]
struct Effort {
    force: Vector3<f64>,
    moment: Vector3<f64>,
}

impl Effort {
    const NONE: Self =
        Self { force: Vector3::new(0.0, 0.0, 0.0), moment: Vector3::new(0.0, 0.0, 0.0) };

    fn plus(&self, other: &Self) -> Self {
        Self { force: self.force + other.force, moment: self.moment + other.moment }
    }

    /// The same about the origin before `step`.
    fn carried_in(&self, step: &IsometryMatrix3<f64>) -> Self {
        let force = step.rotation * self.force;
        let moment = step.rotation * self.moment + step.translation.vector.cross(&force);
        Self { force, moment }
    }
}

#[cfg(test)]
pub(in crate::sim) mod tests {
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
        let rotation = Rotation3::from_matrix_unchecked(rotation);
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

    fn model(text: &str) -> Arm {
        arm(&serde_json::from_str::<Value>(text).unwrap()["model"])
    }

    /// The arm of the default configuration.
    pub(in crate::sim) fn kraft_like() -> Arm {
        model(include_str!("../../tests/oracles/kraft_like.json"))
    }

    /// An arm with a sliding joint.
    pub(in crate::sim) fn jpl_like() -> Arm {
        model(include_str!("../../tests/oracles/jpl_like.json"))
    }

    /// An arm with a spherical wrist, and a grip apart from it.
    pub(in crate::sim) fn sixr_spherical() -> Arm {
        model(include_str!("../../tests/oracles/sixr_spherical.json"))
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
}
