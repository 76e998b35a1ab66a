//! Hand controller as a chain of `N` joints: forward kinematics (Eq. 1), Jacobian at the grip, gravity torques (3.3)
//! and mass matrix.
//!
//! Frames are Craig's modified Denavit-Hartenberg frames (Craig 1989, 3.4). Link `i` lies `Rx(α) Tx(a) Rz(θ) Tz(d)`
//! from link `i - 1`, with α and a of the axis before it. The Jacobian is always that at {G}, so a spherical wrist
//! needs no second wrench transformation (decisions 10, 11 and 31).

use nalgebra::{Isometry3, Matrix3, SMatrix, SVector, Translation3, UnitQuaternion, Vector3};
use thiserror::Error;

use units::math;
use units::spatial::{Jacobian, Twist, Wrench};

/// Maximum magnitude of a length, mass or position, so that their products stay finite.
const MAX_MAGNITUDE: f64 = 1e6;

/// Motion of a joint along or about its z axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Position in rad, torque in N·m.
    Revolute,
    /// Position in m; its "torque" is a force in N.
    Prismatic,
}

/// Description of one joint and the link that it moves; [`Arm::new`] checks it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// Revolute or prismatic.
    pub kind: JointKind,
    /// Link twist α of the preceding link (Craig), in rad.
    pub alpha: f64,
    /// Link length a of the preceding link (Craig), in m.
    pub a: f64,
    /// Offset d, in m; a prismatic joint adds its position.
    pub d: f64,
    /// Angle θ, in rad; a revolute joint adds its position.
    pub theta: f64,
    /// Mass of the link, in kg.
    pub mass: f64,
    /// Centre of mass in the link's own frame, in m.
    pub centre_of_mass: [f64; 3],
    /// Inertia about the centre of mass, in kg·m²: xx, yy, zz, xy, xz, yz.
    pub inertia: [f64; 6],
    /// Inertia of the rotor at the joint side of the gear, in kg·m², or kg of a prismatic joint.
    pub rotor_inertia: f64,
    /// Minimum and maximum position of the joint, in rad or m.
    pub range: [f64; 2],
}

/// Kinematic chain from {0} to {G}, with masses and gravity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arm<const N: usize> {
    links: [LinkModel; N],
    x_n_g: Isometry3<f64>,
    gravity: Vector3<f64>,
}

/// Link with its constant transforms precomputed.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LinkModel {
    kind: JointKind,
    /// `Rx(α) Tx(a)`.
    fixed: Isometry3<f64>,
    d: f64,
    theta: f64,
    mass: f64,
    centre_of_mass: Vector3<f64>,
    inertia: Matrix3<f64>,
    rotor_inertia: f64,
    range: [f64; 2],
}

/// Poses of all links: the result of one forward pass, from which Jacobian and gravity torques follow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Posture<const N: usize> {
    /// Poses of the links in {0}.
    pub x_0_links: [Isometry3<f64>; N],
    /// Pose of the grip in {0} (Eq. 1).
    pub x_0_g: Isometry3<f64>,
}

/// Reason why a description is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidArm {
    /// Invalid joint or link.
    #[error("joint {joint}: {link}")]
    Link {
        /// Joint number, from 1 to `N`.
        joint: usize,
        /// Invalid quantity.
        link: InvalidLink,
    },
    /// Pose of the grip in the last link.
    #[error("the pose of the grip in the last link is not finite")]
    Grip,
    /// Gravity vector.
    #[error("gravity is not a finite vector")]
    Gravity,
}

/// Reason why the description of a joint and its link is invalid.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum InvalidLink {
    /// Length, angle or position beyond ±1e6, or NaN.
    #[error("{quantity} = {value} is not within ±{MAX_MAGNITUDE}")]
    OutOfRange {
        /// Name of the quantity.
        quantity: &'static str,
        /// Rejected value, in rad, m or kg·m².
        value: f64,
    },
    /// Mass not within 0 and 1e6 kg.
    #[error("mass = {value} kg is not within 0 and {MAX_MAGNITUDE}")]
    Mass {
        /// Rejected mass, in kg.
        value: f64,
    },
    /// Minimum position not below the maximum.
    #[error("range from {low} to {high} is empty")]
    EmptyRange {
        /// Minimum position, in rad or m.
        low: f64,
        /// Maximum position, in rad or m.
        high: f64,
    },
}

impl<const N: usize> Arm<N> {
    /// Creates an arm from its links, the pose of the grip in the last link, and gravity in {0} in m/s².
    ///
    /// # Errors
    /// Returns the first invalid quantity.
    pub fn new(
        links: [Link; N],
        x_n_g: Isometry3<f64>,
        gravity: [f64; 3],
    ) -> Result<Self, InvalidArm> {
        for (joint, link) in (1..).zip(&links) {
            link.check().map_err(|link| InvalidArm::Link { joint, link })?;
        }
        if !is_pose(&x_n_g) {
            return Err(InvalidArm::Grip);
        }
        Self { links: links.map(LinkModel::from), x_n_g, gravity: Vector3::zeros() }
            .in_gravity(gravity)
    }

    /// Returns the arm balanced by springs or counterweights, whose gravity torques are zero (decision 32).
    #[must_use]
    pub fn balanced(self) -> Self {
        Self { gravity: Vector3::zeros(), ..self }
    }

    /// Returns the arm with another gravity vector in {0}, in m/s², as on a tilted base.
    ///
    /// # Errors
    /// Returns [`InvalidArm::Gravity`] if a component is beyond ±1e6 or NaN.
    pub fn in_gravity(self, gravity: [f64; 3]) -> Result<Self, InvalidArm> {
        if gravity.iter().all(|part| part.abs() <= MAX_MAGNITUDE) {
            Ok(Self { gravity: gravity.into(), ..self })
        } else {
            Err(InvalidArm::Gravity)
        }
    }

    /// Pose of the grip in the last link, {G} in {W}.
    pub const fn grip(&self) -> &Isometry3<f64> {
        &self.x_n_g
    }

    /// Computes the posture at joint positions `q`, in rad or m.
    pub fn posture(&self, q: &SVector<f64, N>) -> Posture<N> {
        let mut x_0_links = [Isometry3::identity(); N];
        let mut x_0_i = Isometry3::identity();
        for ((link, place), position) in self.links.iter().zip(&mut x_0_links).zip(q.iter()) {
            x_0_i *= link.moved(*position);
            *place = x_0_i;
        }
        Posture { x_0_links, x_0_g: x_0_i * self.x_n_g }
    }

    /// Computes the pose of the grip in {0} at joint positions `q` (Eq. 1).
    pub fn forward(&self, q: &SVector<f64, N>) -> Isometry3<f64> {
        self.posture(q).x_0_g
    }

    /// Computes the Jacobian from joint rates to the twist of {G}, written in {G} (Eq. 7).
    pub fn jacobian(&self, posture: &Posture<N>) -> Jacobian<N> {
        let r_g_0 = posture.x_0_g.rotation.inverse();
        let p_0_g = posture.x_0_g.translation.vector;
        let mut columns = [Twist::ZERO; N];
        for ((link, x_0_i), column) in self.links.iter().zip(&posture.x_0_links).zip(&mut columns) {
            let v_g_in_0 = link.kind.twist(x_0_i, &p_0_g);
            *column = Twist { linear: r_g_0 * v_g_in_0.linear, angular: r_g_0 * v_g_in_0.angular };
        }
        Jacobian::from_columns(&columns)
    }

    /// Computes the torques that hold the weight of the arm, `Σ J_ciᵀ (-m_i g)`, in N·m or N. Each joint carries only
    /// the links beyond it (decision 12).
    pub fn gravity(&self, posture: &Posture<N>) -> SVector<f64, N> {
        let mut tau = SVector::<f64, N>::zeros();
        let mut mass = 0.0;
        let mut mass_moment = Vector3::zeros(); // of this link and those beyond it, about {0}
        let outwards = self.links.iter().zip(&posture.x_0_links).zip(tau.iter_mut());
        for ((link, x_0_i), torque) in outwards.rev() {
            let axis = x_0_i.rotation * Vector3::z();
            let p_0_i = x_0_i.translation.vector;
            mass += link.mass;
            mass_moment += (x_0_i.rotation * link.centre_of_mass + p_0_i) * link.mass;
            *torque = match link.kind {
                JointKind::Revolute => {
                    -axis.dot(&(mass_moment - p_0_i * mass).cross(&self.gravity))
                }
                JointKind::Prismatic => -axis.dot(&self.gravity) * mass,
            };
        }
        tau
    }

    /// Computes the torques by which weight may differ, in N·m, where all centres of mass are off by `distance`, in m; zero for a
    /// prismatic joint.
    pub fn gravity_of_offsets(&self, posture: &Posture<N>, distance: f64) -> SVector<f64, N> {
        let mut tau = SVector::<f64, N>::zeros();
        let mut mass = 0.0;
        let outwards = self.links.iter().zip(&posture.x_0_links).zip(tau.iter_mut());
        for ((link, x_0_i), torque) in outwards.rev() {
            mass += link.mass;
            let axis = x_0_i.rotation * Vector3::z();
            *torque = match link.kind {
                JointKind::Revolute => axis.cross(&self.gravity).norm() * mass * distance,
                JointKind::Prismatic => 0.0,
            };
        }
        tau
    }

    /// Computes the wrench at the grip, in {G}, that would hold all links as one rigid body (decision 12, read literally).
    /// Its torque is correct for the first joint only; every other joint also carries the links before it.
    pub fn gravity_at_grip(&self, posture: &Posture<N>) -> Wrench {
        let p_0_g = posture.x_0_g.translation.vector;
        let r_g_0 = posture.x_0_g.rotation.inverse();
        let mut holding = Wrench::ZERO;
        for (link, x_0_i) in self.links.iter().zip(&posture.x_0_links) {
            let p_0_c = x_0_i.rotation * link.centre_of_mass + x_0_i.translation.vector;
            let force_in_0 = -self.gravity * link.mass;
            let moment = r_g_0 * (p_0_c - p_0_g).cross(&force_in_0);
            holding = holding + Wrench { force: r_g_0 * force_in_0, moment };
        }
        holding
    }

    /// Returns the kind of each joint.
    pub fn kinds(&self) -> [JointKind; N] {
        self.links.map(|link| link.kind)
    }

    /// Minimum and maximum position of each joint, in rad or m.
    pub fn ranges(&self) -> [[f64; 2]; N] {
        self.links.map(|link| link.range)
    }

    /// Computes the mass matrix, `Σ m_i J_ciᵀ J_ci + J_ωiᵀ I_i J_ωi` plus the rotors, in kg·m², kg·m and kg.
    pub fn mass_matrix(&self, posture: &Posture<N>) -> SMatrix<f64, N, N> {
        let rotors = SVector::from_iterator(self.links.iter().map(|link| link.rotor_inertia));
        let mut mass = SMatrix::from_diagonal(&rotors);
        for (outermost, (link, x_0_i)) in self.links.iter().zip(&posture.x_0_links).enumerate() {
            let p_0_c = x_0_i.rotation * link.centre_of_mass + x_0_i.translation.vector;
            let j_c_in_0 = self.columns(posture, &p_0_c, outermost);
            let r_0_i = x_0_i.rotation.to_rotation_matrix().into_inner();
            let inertia_in_0 = r_0_i * link.inertia * r_0_i.transpose();
            mass += j_c_in_0.linear.tr_mul(&j_c_in_0.linear) * link.mass;
            mass += j_c_in_0.angular.tr_mul(&(inertia_in_0 * j_c_in_0.angular));
        }
        mass
    }

    /// Computes the Jacobian, in {0}, of the point `p_0_c` of link `outermost`, from 0. Joints beyond that link have zero
    /// columns.
    fn columns(&self, posture: &Posture<N>, p_0_c: &Vector3<f64>, outermost: usize) -> Jacobian<N> {
        let mut columns = [Twist::ZERO; N];
        let joints = self.links.iter().zip(&posture.x_0_links).zip(&mut columns);
        for ((link, x_0_i), column) in joints.take(outermost + 1) {
            *column = link.kind.twist(x_0_i, p_0_c);
        }
        Jacobian::from_columns(&columns)
    }

    /// Returns the first joint outside its range, from 0. NaN is outside.
    pub fn out_of_range(&self, q: &SVector<f64, N>) -> Option<usize> {
        let inside = |(link, position): (&LinkModel, &f64)| {
            let [low, high] = link.range;
            (low..=high).contains(position)
        };
        self.links.iter().zip(q.iter()).position(|joint| !inside(joint))
    }
}

impl JointKind {
    /// Returns the first of two values for a revolute joint, the second for a prismatic one.
    pub fn pick<T>(self, [revolute, prismatic]: [T; 2]) -> T {
        match self {
            Self::Revolute => revolute,
            Self::Prismatic => prismatic,
        }
    }

    /// Returns the twist, in {0}, of the point `p_0_c` at unit rate of the joint with frame `x_0_i`.
    fn twist(self, x_0_i: &Isometry3<f64>, p_0_c: &Vector3<f64>) -> Twist {
        let axis = x_0_i.rotation * Vector3::z();
        match self {
            Self::Revolute => {
                Twist { linear: axis.cross(&(p_0_c - x_0_i.translation.vector)), angular: axis }
            }
            Self::Prismatic => Twist { linear: axis, angular: Vector3::zeros() },
        }
    }
}

impl Link {
    /// Revolute joint about z with a link of no length or mass: a template for descriptions.
    pub const TURNING: Self = Self {
        kind: JointKind::Revolute,
        alpha: 0.0,
        a: 0.0,
        d: 0.0,
        theta: 0.0,
        mass: 0.0,
        centre_of_mass: [0.0; 3],
        inertia: [0.0; 6],
        rotor_inertia: 0.0,
        range: [-3.0, 3.0],
    };

    /// Returns the first invalid quantity.
    fn check(&self) -> Result<(), InvalidLink> {
        let [x, y, z] = self.centre_of_mass;
        let [xx, yy, zz, xy, xz, yz] = self.inertia;
        let [low, high] = self.range;
        for (quantity, value) in [
            ("alpha", self.alpha),
            ("a", self.a),
            ("d", self.d),
            ("theta", self.theta),
            ("x of the centre of mass", x),
            ("y of the centre of mass", y),
            ("z of the centre of mass", z),
            ("inertia xx", xx),
            ("inertia yy", yy),
            ("inertia zz", zz),
            ("inertia xy", xy),
            ("inertia xz", xz),
            ("inertia yz", yz),
            ("inertia of the rotor", self.rotor_inertia),
            ("lowest position", low),
            ("highest position", high),
        ] {
            if !(-MAX_MAGNITUDE..=MAX_MAGNITUDE).contains(&value) {
                return Err(InvalidLink::OutOfRange { quantity, value });
            }
        }
        if !(0.0..=MAX_MAGNITUDE).contains(&self.mass) {
            return Err(InvalidLink::Mass { value: self.mass });
        }
        if low >= high {
            return Err(InvalidLink::EmptyRange { low, high });
        }
        Ok(())
    }
}

impl LinkModel {
    /// Returns the pose of this link in the preceding one, with its joint at `position` in rad or m.
    fn moved(&self, position: f64) -> Isometry3<f64> {
        let (theta, d) = match self.kind {
            JointKind::Revolute => (self.theta + position, self.d),
            JointKind::Prismatic => (self.theta, self.d + position),
        };
        let (sin, cos) = math::sin_cos(theta / 2.0);
        let about_z = nalgebra::Quaternion::new(cos, 0.0, 0.0, sin);
        self.fixed
            * Isometry3::from_parts(
                Translation3::new(0.0, 0.0, d),
                UnitQuaternion::new_unchecked(about_z), // sin² + cos² = 1
            )
    }
}

impl From<Link> for LinkModel {
    fn from(link: Link) -> Self {
        let about_x = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), link.alpha);
        let [xx, yy, zz, xy, xz, yz] = link.inertia;
        Self {
            kind: link.kind,
            fixed: Isometry3::from_parts(
                Translation3::from(about_x * Vector3::new(link.a, 0.0, 0.0)),
                about_x,
            ),
            d: link.d,
            theta: link.theta,
            mass: link.mass,
            centre_of_mass: link.centre_of_mass.into(),
            inertia: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
            rotor_inertia: link.rotor_inertia,
            range: link.range,
        }
    }
}

/// Returns whether a pose is finite and within ±1e6 m, with a unit quaternion.
pub(crate) fn is_pose(x: &Isometry3<f64>) -> bool {
    let near = x.translation.vector.iter().all(|part| part.abs() <= MAX_MAGNITUDE);
    near && (x.rotation.norm() - 1.0).abs() < 1e-6
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const REVOLUTE: Link = Link {
        mass: 2.0,
        centre_of_mass: [0.5, 0.0, 0.0],
        inertia: [0.01, 0.02, 0.03, 0.0, 0.0, 0.0],
        rotor_inertia: 0.1,
        ..Link::TURNING
    };

    fn link() -> impl Strategy<Value = Link> {
        let numbers = prop::array::uniform4(-1.5..1.5_f64);
        let weight = (0.0..3.0_f64, prop::array::uniform3(-0.3..0.3_f64));
        (any::<bool>(), numbers, weight).prop_map(
            |(turns, [alpha, a, d, theta], (mass, centre_of_mass))| Link {
                kind: if turns { JointKind::Revolute } else { JointKind::Prismatic },
                alpha,
                a,
                d,
                theta,
                mass,
                centre_of_mass,
                inertia: [0.01, 0.02, 0.025, 0.001, -0.002, 0.003],
                rotor_inertia: 0.004,
                range: [-2.0, 2.0],
            },
        )
    }

    fn arm() -> impl Strategy<Value = Arm<5>> {
        (prop::array::uniform5(link()), prop::array::uniform3(-0.5..0.5_f64)).prop_map(
            |(links, [x, y, z])| {
                let x_n_g = Isometry3::new(Vector3::new(x, y, z), Vector3::new(y, z, x));
                Arm::new(links, x_n_g, [0.3, -0.5, -9.81]).unwrap()
            },
        )
    }

    fn joints() -> impl Strategy<Value = SVector<f64, 5>> {
        prop::array::uniform5(-2.0..2.0_f64).prop_map(SVector::from)
    }

    /// Returns the potential energy of the links, in J.
    fn energy(arm: &Arm<5>, q: &SVector<f64, 5>) -> f64 {
        let weighed = |(link, x_0_i): (&LinkModel, &Isometry3<f64>)| {
            let p_0_c = x_0_i.rotation * link.centre_of_mass + x_0_i.translation.vector;
            -link.mass * p_0_c.dot(&arm.gravity)
        };
        arm.links.iter().zip(&arm.posture(q).x_0_links).map(weighed).sum()
    }

    proptest! {
        #[test]
        fn property_01_the_jacobian_is_the_derivative_of_eq_1(arm in arm(), q in joints(), qd in joints()) {
            let step = 1e-6;
            let x_before_after = arm.forward(&(q - qd * step)).inverse() * arm.forward(&(q + qd * step));
            let moved = Twist::reaching(&x_before_after, 2.0 * step);
            let said = arm.jacobian(&arm.posture(&q)).twist(&qd);
            for (moved, said) in moved.components().iter().zip(said.components()) {
                prop_assert!((moved - said).abs() < 1e-7, "moved {moved}, said {said}");
            }
        }

        #[test]
        fn gravity_torques_are_the_slope_of_the_energy(arm in arm(), q in joints(), qd in joints()) {
            let step = 1e-6;
            let slope = (energy(&arm, &(q + qd * step)) - energy(&arm, &(q - qd * step))) / (2.0 * step);
            let power = arm.gravity(&arm.posture(&q)).dot(&qd);
            prop_assert!((slope - power).abs() < 1e-6);
        }

        #[test]
        fn the_mass_matrix_is_the_kinetic_energy(arm in arm(), q in joints(), qd in joints()) {
            let step = 1e-6;
            let (before, after) = (arm.posture(&(q - qd * step)), arm.posture(&(q + qd * step)));
            let posture = arm.posture(&q);
            let links = arm.links.iter().zip(before.x_0_links.iter().zip(&after.x_0_links));
            let energy: f64 = links.map(|(link, (before, after))| {
                let c = Isometry3::from_parts(link.centre_of_mass.into(), UnitQuaternion::identity());
                let moved = Twist::reaching(&((before * c).inverse() * (after * c)), 2.0 * step);
                let turning = moved.angular.dot(&(link.inertia * moved.angular));
                (link.mass * moved.linear.norm_squared() + turning) / 2.0
            }).sum();
            let rotors = 0.004 * qd.norm_squared() / 2.0;
            let said = qd.dot(&(arm.mass_matrix(&posture) * qd)) / 2.0;
            prop_assert!((said - energy - rotors).abs() < 1e-6 * (1.0 + energy));
        }

        #[test]
        fn a_balanced_arm_asks_for_nothing(arm in arm(), q in joints()) {
            prop_assert!(arm.balanced().gravity(&arm.posture(&q)).norm() == 0.0);
        }
    }

    #[test]
    fn level_link_loads_its_joint_with_weight_times_lever() {
        let level = Link { alpha: std::f64::consts::FRAC_PI_2, ..REVOLUTE };
        let arm = Arm::new([level], Isometry3::identity(), [0.0, 0.0, -10.0]).unwrap();
        let tau = arm.gravity(&arm.posture(&SVector::from([0.0])));
        assert!((tau.x - 2.0 * 10.0 * 0.5).abs() < 1e-12);
    }

    #[test]
    fn a_joint_beyond_its_range_is_named() {
        let arm = Arm::new([REVOLUTE; 3], Isometry3::identity(), [0.0; 3]).unwrap();
        assert_eq!(arm.out_of_range(&SVector::from([0.0, 3.0, -3.0])), None);
        assert_eq!(arm.out_of_range(&SVector::from([0.0, 0.0, -3.1])), Some(2));
        assert_eq!(arm.out_of_range(&SVector::from([f64::NAN, 0.0, 0.0])), Some(0));
    }

    #[test]
    fn invalid_description_names_joint_and_quantity() {
        let build = |link| Arm::new([REVOLUTE, link], Isometry3::identity(), [0.0; 3]);
        let error = build(Link { d: f64::NAN, ..REVOLUTE }).unwrap_err();
        assert_eq!(error.to_string(), "joint 2: d = NaN is not within ±1000000");
        let error = build(Link { mass: -1.0, ..REVOLUTE }).unwrap_err();
        assert_eq!(error.to_string(), "joint 2: mass = -1 kg is not within 0 and 1000000");
        let link = InvalidLink::EmptyRange { low: 1.0, high: 1.0 };
        let error = build(Link { range: [1.0, 1.0], ..REVOLUTE }).unwrap_err();
        assert_eq!(error, InvalidArm::Link { joint: 2, link });
        assert_eq!(error.to_string(), "joint 2: range from 1 to 1 is empty");
        let far = Isometry3::translation(f64::INFINITY, 0.0, 0.0);
        assert_eq!(Arm::new([REVOLUTE], far, [0.0; 3]).unwrap_err(), InvalidArm::Grip);
        let down = [0.0, 0.0, f64::NAN];
        let error = Arm::new([REVOLUTE], Isometry3::identity(), down).unwrap_err();
        assert_eq!(error, InvalidArm::Gravity);
    }
}
