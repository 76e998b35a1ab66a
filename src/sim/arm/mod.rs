//! Rigid-body kinematics and dynamics of a serial chain in Craig's modified DH parameters.
//!
//! Shares nothing with the controller, which computes the same arm by another method: the dynamics are those of
//! `dynamics`, the Jacobian is accumulated from the grip inward.

mod dynamics;
mod rigid;

pub(super) use dynamics::{Dynamics, accelerations};

use nalgebra::{
    Isometry3, IsometryMatrix3, Matrix3, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion,
    Vector3,
};

use crate::arm::rigid::Body;
use units::spatial::{Jacobian, Twist};

/// One value per joint, base first.
pub type Joints = SVector<f64, 6>;

/// Parameters of a link and the joint before it.
#[derive(Clone, Copy, Debug)]
pub struct LinkSettings {
    /// The joint is prismatic, not revolute.
    pub is_prismatic: bool,
    /// Angle α from the previous axis, in rad.
    pub alpha: f64,
    /// Distance a from the previous axis, in m.
    pub a: f64,
    /// Offset d, in m; the position of a prismatic joint is added.
    pub d: f64,
    /// Angle θ, in rad; the position of a revolute joint is added.
    pub theta: f64,
    /// Mass, in kg.
    pub mass: f64,
    /// Centre of mass in the link frame, in m.
    pub centre_of_mass: Vector3<f64>,
    /// Inertia about the centre of mass, in kg·m².
    pub inertia: Matrix3<f64>,
    /// Rotor inertia of the actuator after its gear, in kg·m² (kg for a prismatic joint).
    pub rotor_inertia: f64,
}

/// A matrix over pairs of joints.
pub type JointMatrix = SMatrix<f64, 6, 6>;

/// Parameters of an arm.
#[derive(Clone, Copy, Debug)]
pub struct ArmSettings {
    /// Links, base first.
    pub links: [LinkSettings; 6],
    /// Pose of the grip in the last link.
    pub x_6_g: Isometry3<f64>,
    /// Gravity in {0}, in m/s².
    pub gravity: Vector3<f64>,
}

/// A serial chain of six joints with a grip.
#[derive(Clone, Copy, Debug)]
pub struct Arm {
    links: [Link; 6],
    x_6_g: IsometryMatrix3<f64>,
    gravity: Vector3<f64>,
    /// Rotor inertia in the mass matrix.
    rotors: JointMatrix,
}

/// Poses of all links.
#[derive(Clone, Copy, Debug)]
pub struct Posture {
    /// Each link in the one before.
    steps: [IsometryMatrix3<f64>; 6],
    /// Each link in {0}.
    x_0_links: [IsometryMatrix3<f64>; 6],
}

impl Arm {
    /// Creates an arm.
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

    /// Maps the rotor inertia through a transmission, with `joint_inertia` from actuators to joints. Call it once.
    #[must_use]
    pub fn driven_through(self, joint_inertia: impl FnOnce(&JointMatrix) -> JointMatrix) -> Self {
        Self { rotors: joint_inertia(&self.rotors), ..self }
    }

    /// Returns the link poses at joint positions `q`, in rad or m.
    pub fn posture(&self, q: &Joints) -> Posture {
        let mut posture = Posture {
            steps: [IsometryMatrix3::identity(); 6],
            x_0_links: [IsometryMatrix3::identity(); 6],
        };
        let mut x_0_i = IsometryMatrix3::identity();
        let places = posture.steps.iter_mut().zip(&mut posture.x_0_links);
        for ((step, x_0_link), (link, q)) in places.zip(self.links.iter().zip(q.iter())) {
            *step = link.step(*q);
            x_0_i *= *step;
            *x_0_link = x_0_i;
        }
        posture
    }

    /// Returns the pose of the grip in {0}.
    pub fn pose(&self, posture: &Posture) -> Isometry3<f64> {
        let [.., x_0_6] = posture.x_0_links;
        let x_0_g = x_0_6 * self.x_6_g;
        let rotation = UnitQuaternion::from_rotation_matrix(&x_0_g.rotation);
        Isometry3::from_parts(x_0_g.translation, rotation)
    }

    /// Returns the body Jacobian of the grip, in {G}.
    pub fn jacobian(&self, posture: &Posture) -> Jacobian<6> {
        let mut columns = [Twist::ZERO; 6];
        // From the grip inward: pose of the grip in link i.
        let mut x_i_g = self.x_6_g;
        for ((column, link), step) in columns.iter_mut().zip(&self.links).zip(&posture.steps).rev()
        {
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
}

/// Precomputed parameters of a link.
#[derive(Clone, Copy, Debug)]
struct Link {
    is_prismatic: bool,
    /// Sine of α.
    sin: f64,
    cos: f64,
    a: f64,
    d: f64,
    theta: f64,
    body: Body,
}

impl Link {
    fn new(settings: LinkSettings) -> Self {
        let (sin, cos) = settings.alpha.sin_cos();
        Self {
            is_prismatic: settings.is_prismatic,
            sin,
            cos,
            a: settings.a,
            d: settings.d,
            theta: settings.theta,
            body: Body::new(settings.mass, &settings.centre_of_mass, settings.inertia),
        }
    }

    /// Returns the pose of this link in the one before: `Rx(α) Tx(a) Rz(θ) Tz(d)` (Craig 1989, Eq. 3.6).
    fn step(&self, q: f64) -> IsometryMatrix3<f64> {
        let (d, theta) =
            if self.is_prismatic { (self.d + q, self.theta) } else { (self.d, self.theta + q) };
        let ((s, c), (sa, ca)) = (theta.sin_cos(), (self.sin, self.cos));
        let rotation = Matrix3::new(c, -s, 0.0, s * ca, c * ca, -sa, s * sa, c * sa, ca);
        let place = Translation3::new(self.a, -sa * d, ca * d);
        IsometryMatrix3::from_parts(place, Rotation3::from_matrix_unchecked(rotation))
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use serde_json::Value;

    use super::*;
    use units::spatial::Wrench;

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

    /// Returns the arm of the default configuration.
    pub(crate) fn kraft_like() -> Arm {
        model(include_str!("../../../tests/oracles/kraft_like.json"))
    }

    /// Returns an arm with a prismatic joint.
    pub(crate) fn jpl_like() -> Arm {
        model(include_str!("../../../tests/oracles/jpl_like.json"))
    }

    /// Returns an arm with a spherical wrist and an offset grip.
    pub(crate) fn sixr_spherical() -> Arm {
        model(include_str!("../../../tests/oracles/sixr_spherical.json"))
    }

    #[test]
    fn arms_match_independent_programs() {
        for text in [
            include_str!("../../../tests/oracles/kraft_like.json"),
            include_str!("../../../tests/oracles/jpl_like.json"),
            include_str!("../../../tests/oracles/sixr_spherical.json"),
            include_str!("../../../tests/oracles/puma560_corke_mdh.json"),
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
                // And the inverse: these accelerations need the given torques.
                let needed = arm.mass_matrix(&posture) * qdd + arm.bias(&posture, &qd);
                let given = tau + j_g.torques(&f_g);
                assert!((needed - given).norm() < 1e-9 * (1.0 + given.norm()), "{needed}");
            }
        }
    }
}
