//! Rigid-body kinematics and dynamics of a serial chain in Craig's modified DH parameters.
//!
//! Shares no code with the controller, which computes the same arm by another method. Here the dynamics are recursive
//! (`dynamics`), and the Jacobian is accumulated from the grip inward.
//!
//! The number of joints is a parameter of the types, six unless named. A chain of fewer joints is padded at its end by
//! fixed links: no motion, no mass, and a rotor inertia of 1 that keeps the mass matrix regular.

mod dynamics;
mod rigid;

pub(super) use dynamics::{Dynamics, accelerations};

use std::array;

use nalgebra::{
    Isometry3, IsometryMatrix3, Matrix3, Rotation3, SMatrix, SVector, Translation3, UnitQuaternion,
    Vector3,
};

use crate::arm::rigid::Body;
use units::spatial::{Jacobian, Twist};

/// One value per joint, base first.
pub type Joints<const N: usize = 6> = SVector<f64, N>;

/// Parameters of a link and the joint before it.
#[derive(Clone, Copy, Debug)]
pub struct LinkSettings {
    /// Set if the joint is prismatic, not revolute.
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

/// Matrix over pairs of joints.
pub type JointMatrix<const N: usize = 6> = SMatrix<f64, N, N>;

/// Parameters of an arm.
#[derive(Clone, Copy, Debug)]
pub struct ArmSettings<const N: usize = 6> {
    /// Links, base first.
    pub links: [LinkSettings; N],
    /// Pose of the grip in the last link.
    pub x_6_g: Isometry3<f64>,
    /// Gravity in {0}, in m/s².
    pub gravity: Vector3<f64>,
}

/// Number of links outside of the range of an arm.
#[derive(Clone, Copy, Debug, Eq, PartialEq, thiserror::Error)]
#[error("an arm must have 1 to {max} joints, got {got}")]
pub struct InvalidJointCount {
    /// Number of links.
    pub got: usize,
    /// Maximum number of joints.
    pub max: usize,
}

/// Rigid body fixed to a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Mass, in kg.
    pub mass: f64,
    /// Centre of mass, in m.
    pub centre_of_mass: Vector3<f64>,
    /// Inertia about the centre of mass, in kg·m².
    pub inertia: Matrix3<f64>,
}

/// Serial chain of up to `N` joints with a grip.
#[derive(Clone, Copy, Debug)]
pub struct Arm<const N: usize = 6> {
    links: [Link; N],
    /// Number of joints; links after them are fixed.
    count: usize,
    x_6_g: IsometryMatrix3<f64>,
    gravity: Vector3<f64>,
    /// Rotor inertia in the mass matrix.
    rotors: JointMatrix<N>,
}

/// Poses of all links.
#[derive(Clone, Copy, Debug)]
pub struct Posture<const N: usize = 6> {
    /// Pose of each link in the previous one.
    steps: [IsometryMatrix3<f64>; N],
    /// Pose of each link in {0}.
    x_0_links: [IsometryMatrix3<f64>; N],
}

impl<const N: usize> Arm<N> {
    /// Creates an arm of `N` joints.
    pub fn new(settings: ArmSettings<N>) -> Self {
        Self {
            links: settings.links.map(Link::new),
            count: N,
            x_6_g: nalgebra::convert(settings.x_6_g),
            gravity: settings.gravity,
            rotors: JointMatrix::from_diagonal(&Joints::from(
                settings.links.map(|link| link.rotor_inertia),
            )),
        }
    }

    /// Creates an arm of as many joints as `links`, padded with fixed links. `x_n_g` is the grip in the last of `links`.
    ///
    /// # Errors
    ///
    /// Returns an error if the number of links is zero, or above `N`.
    pub fn padded(
        links: &[LinkSettings],
        x_n_g: Isometry3<f64>,
        gravity: Vector3<f64>,
    ) -> Result<Self, InvalidJointCount> {
        if links.is_empty() || links.len() > N {
            return Err(InvalidJointCount { got: links.len(), max: N });
        }
        let mut padded = [Link::FIXED; N];
        let mut rotors = JointMatrix::<N>::identity();
        for (joint, (place, link)) in padded.iter_mut().zip(links).enumerate() {
            *place = Link::new(*link);
            rotors.view_mut((joint, joint), (1, 1)).fill(link.rotor_inertia);
        }
        let x_6_g = nalgebra::convert(x_n_g);
        Ok(Self { links: padded, count: links.len(), x_6_g, gravity, rotors })
    }

    /// Returns which joints are prismatic.
    pub fn is_prismatic(&self) -> [bool; N] {
        self.links.each_ref().map(|link| link.kind == JointKind::Prismatic)
    }

    /// Returns the number of joints, without fixed links.
    pub const fn count(&self) -> usize {
        self.count
    }

    /// Adds a body to the last link, in which it has the pose `x_n_s`.
    #[must_use]
    pub fn carrying(mut self, load: &Load, x_n_s: &Isometry3<f64>) -> Self {
        let body = Body::new(load.mass, &load.centre_of_mass, load.inertia);
        if let Some(link) = self.links.iter_mut().take(self.count).last() {
            link.body = link.body.plus(&body.carried_in(&nalgebra::convert(*x_n_s)));
        }
        self
    }

    /// Maps the rotor inertia through a transmission, with `joint_inertia` from actuators to joints. Call it once.
    #[must_use]
    pub fn driven_through(
        self,
        joint_inertia: impl FnOnce(&JointMatrix<N>) -> JointMatrix<N>,
    ) -> Self {
        Self { rotors: joint_inertia(&self.rotors), ..self }
    }

    /// Returns the link poses at joint positions `q`, in rad or m.
    pub fn posture(&self, q: &Joints<N>) -> Posture<N> {
        let mut steps = self.links.iter().zip(q.iter()).map(|(link, q)| link.step(*q));
        let steps = array::from_fn(|_| steps.next().unwrap_or_else(IsometryMatrix3::identity));
        let mut x_0_i = IsometryMatrix3::identity();
        let x_0_links = steps.map(|step| {
            x_0_i *= step;
            x_0_i
        });
        Posture { steps, x_0_links }
    }

    /// Returns the pose of the grip in {0}.
    pub fn pose(&self, posture: &Posture<N>) -> Isometry3<f64> {
        let x_0_n = posture.x_0_links.last().copied().unwrap_or_else(IsometryMatrix3::identity);
        let x_0_g = x_0_n * self.x_6_g;
        let rotation = UnitQuaternion::from_rotation_matrix(&x_0_g.rotation);
        Isometry3::from_parts(x_0_g.translation, rotation)
    }

    /// Returns the body Jacobian of the grip, in {G}.
    pub fn jacobian(&self, posture: &Posture<N>) -> Jacobian<N> {
        let mut columns = [Twist::ZERO; N];
        // From the grip inward: pose of the grip in link i.
        let mut x_i_g = self.x_6_g;
        for ((column, link), step) in columns.iter_mut().zip(&self.links).zip(&posture.steps).rev()
        {
            let axis = x_i_g.rotation.inverse() * Vector3::z();
            let turned = x_i_g.rotation.inverse() * Vector3::z().cross(&x_i_g.translation.vector);
            *column = match link.kind {
                JointKind::Revolute => Twist { linear: turned, angular: axis },
                JointKind::Prismatic => Twist { linear: axis, angular: Vector3::zeros() },
                JointKind::Fixed => Twist::ZERO,
            };
            x_i_g = step * x_i_g;
        }
        Jacobian::from_columns(&columns)
    }
}

/// Motion of a joint.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum JointKind {
    Revolute,
    Prismatic,
    /// Padding at the end of the chain.
    Fixed,
}

/// Precomputed parameters of a link.
#[derive(Clone, Copy, Debug)]
struct Link {
    kind: JointKind,
    /// Sine of α.
    sin: f64,
    cos: f64,
    a: f64,
    d: f64,
    theta: f64,
    body: Body,
}

impl Link {
    const FIXED: Self = Self {
        kind: JointKind::Fixed,
        sin: 0.0,
        cos: 1.0,
        a: 0.0,
        d: 0.0,
        theta: 0.0,
        body: Body::NONE,
    };

    fn new(settings: LinkSettings) -> Self {
        let (sin, cos) = settings.alpha.sin_cos();
        Self {
            kind: if settings.is_prismatic { JointKind::Prismatic } else { JointKind::Revolute },
            sin,
            cos,
            a: settings.a,
            d: settings.d,
            theta: settings.theta,
            body: Body::new(settings.mass, &settings.centre_of_mass, settings.inertia),
        }
    }

    /// Returns the pose of this link in the previous one: `Rx(α) Tx(a) Rz(θ) Tz(d)` (Craig 1989, Eq. 3.6).
    fn step(&self, q: f64) -> IsometryMatrix3<f64> {
        let (d, theta) = match self.kind {
            JointKind::Revolute => (self.d, self.theta + q),
            JointKind::Prismatic => (self.d + q, self.theta),
            JointKind::Fixed => return IsometryMatrix3::identity(),
        };
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
        array::from_fn(|place| value[place].as_f64().unwrap())
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

    pub(crate) fn links(model: &Value) -> [LinkSettings; 6] {
        array::from_fn(|place| {
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
        })
    }

    fn arm(model: &Value) -> Arm {
        let links = links(model);
        let gravity = Vector3::from(numbers(&model["g0"]));
        Arm::new(ArmSettings { links, x_6_g: pose(&model["T_6G"]), gravity })
    }

    fn model(text: &str) -> Arm {
        arm(&serde_json::from_str::<Value>(text).unwrap()["model"])
    }

    /// Returns the arm of the default configuration.
    pub(crate) fn kraft_like() -> Arm {
        model(include_str!("../../../../tests/oracles/kraft_like.json"))
    }

    /// Returns an arm with a prismatic joint.
    pub(crate) fn jpl_like() -> Arm {
        model(include_str!("../../../../tests/oracles/jpl_like.json"))
    }

    /// Returns an arm with a spherical wrist and an offset grip.
    pub(crate) fn sixr_spherical() -> Arm {
        model(include_str!("../../../../tests/oracles/sixr_spherical.json"))
    }

    #[test]
    fn arms_match_independent_programs() {
        for text in [
            include_str!("../../../../tests/oracles/kraft_like.json"),
            include_str!("../../../../tests/oracles/jpl_like.json"),
            include_str!("../../../../tests/oracles/sixr_spherical.json"),
            include_str!("../../../../tests/oracles/puma560_corke_mdh.json"),
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
                // The inverse dynamics return the torques for these accelerations.
                let needed = arm.mass_matrix(&posture) * qdd + arm.bias(&posture, &qd);
                let given = tau + j_g.torques(&f_g);
                assert!((needed - given).norm() < 1e-9 * (1.0 + given.norm()), "{needed}");
            }
        }
    }

    #[test]
    fn gravity_is_the_bias_at_rest_to_the_last_bit() {
        for arm in [kraft_like(), jpl_like(), sixr_spherical()] {
            for turn in 0..20 {
                let q = Joints::from_fn(|row, _| {
                    (0.7 * f64::from(turn) * f64::from(u32::try_from(1 + row).unwrap())).sin()
                });
                let posture = arm.posture(&q);
                assert_eq!(arm.gravity(&posture), arm.bias(&posture, &Joints::zeros()));
            }
        }
    }

    #[test]
    fn dynamics_at_positions_are_those_of_their_posture() {
        let arm = jpl_like();
        let (q, qd) = (Joints::repeat(0.3), Joints::repeat(-0.7));
        let (at, of) = (arm.dynamics_at(&q, &qd), arm.dynamics(&arm.posture(&q), &qd));
        assert_eq!((at.mass, at.bias), (of.mass, of.bias));
    }

    /// Returns the PUMA 560 of Corke and Armstrong-Helouvry 1994, and its model.
    fn puma() -> (Value, Arm<9>) {
        let text = include_str!("../../../../tests/oracles/puma560_corke_mdh.json");
        let oracle: Value = serde_json::from_str(text).unwrap();
        let model = &oracle["model"];
        let gravity = Vector3::from(numbers(&model["g0"]));
        let arm = Arm::padded(&links(model), pose(&model["T_6G"]), gravity).unwrap();
        (oracle, arm)
    }

    #[test]
    fn padded_arm_matches_an_independent_program() {
        let (oracle, arm) = puma();
        assert_eq!(arm.count(), 6);
        for config in oracle["configs"].as_array().unwrap() {
            let padded = |key: &str| {
                let mut padded = Joints::<9>::zeros();
                padded.fixed_rows_mut::<6>(0).copy_from(&joints(&config[key]));
                padded
            };
            let posture = arm.posture(&padded("q"));
            let x_0_g = arm.pose(&posture).to_homogeneous();
            assert!((x_0_g - pose(&config["T_0G"]).to_homogeneous()).norm() < 1e-9);
            let mut j_g = SMatrix::<f64, 6, 9>::zeros();
            j_g.fixed_columns_mut::<6>(0).copy_from(&matrix(&config["J_body_G"]));
            assert!((arm.jacobian(&posture).matrix() - j_g).norm() < 1e-9);
            assert!((arm.gravity(&posture) - padded("gravity")).norm() < 1e-9);
            let bias = padded("gravity") + padded("Cqd");
            assert!((arm.bias(&posture, &padded("qd")) - bias).norm() < 1e-9);
            let mut mass = JointMatrix::<9>::identity();
            mass.fixed_view_mut::<6, 6>(0, 0).copy_from(&matrix(&config["M"]));
            assert!((arm.mass_matrix(&posture) - mass).norm() < 1e-9);
        }
    }

    #[test]
    fn number_of_links_is_checked() {
        let (oracle, _) = puma();
        let links = links(&oracle["model"]);
        let arm = |links: &[LinkSettings]| {
            Arm::<5>::padded(links, Isometry3::identity(), Vector3::zeros()).map(|arm| arm.count())
        };
        assert_eq!(arm(&links), Err(InvalidJointCount { got: 6, max: 5 }));
        assert_eq!(arm(&[]), Err(InvalidJointCount { got: 0, max: 5 }));
        assert_eq!(arm(&links[..4]), Ok(4));
    }

    #[test]
    fn load_adds_its_weight_and_inertia_to_the_last_link() {
        let (_, arm) = puma();
        let load = Load {
            mass: 2.0,
            centre_of_mass: Vector3::new(0.01, -0.02, 0.1),
            inertia: Matrix3::from_diagonal(&Vector3::new(0.01, 0.02, 0.005)),
        };
        let x_n_s = Isometry3::new(Vector3::new(0.0, 0.03, 0.05), Vector3::new(0.2, 0.0, 0.5));
        let loaded = arm.carrying(&load, &x_n_s);
        let q = Joints::<9>::from_fn(|row, _| [0.3, 0.7, -1.2, 0.4, 0.6, -0.8, 0.0, 0.0, 0.0][row]);
        let posture = arm.posture(&q);
        // {S} is where the grip would be; the load acts at its centre of mass.
        let at_centre = Isometry3::translation(0.01, -0.02, 0.1);
        let x_n_c = x_n_s * at_centre;
        let at_load = Arm { x_6_g: nalgebra::convert(x_n_c), ..arm };
        let j_c = at_load.jacobian(&posture);
        let weight = at_load.pose(&posture).rotation.inverse() * (arm.gravity * load.mass);
        let added = loaded.gravity(&posture) - arm.gravity(&posture);
        let f_c = Wrench { force: weight, moment: Vector3::zeros() };
        assert!((added + j_c.torques(&f_c)).norm() < 1e-12);
        let inertia = j_c.linear.tr_mul(&j_c.linear) * load.mass
            + j_c.angular.tr_mul(&(load.inertia * j_c.angular));
        let added = loaded.mass_matrix(&posture) - arm.mass_matrix(&posture);
        assert!((added - inertia).norm() < 1e-12, "{}", (added - inertia).norm());
    }
}
