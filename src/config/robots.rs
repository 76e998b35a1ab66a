//! Robot files, `config/robots/*.toml`: an arm of 6 to 9 joints on the commanded side.
//!
//! The crate `robot` commands the arm by its kinematics and limits. Only a simulation uses masses and friction.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use ::robot::chain::{Chain, Joints, Link, MAX_JOINTS, MIN_JOINTS};
use ::robot::damped_inverse::DampedInverse;
use ::robot::following_arm::FollowingArm;
use ::robot::joint_limits::{JointLimit, JointLimits};
use ::robot::resolved_rate::ResolvedRate;
use nalgebra::{Isometry3, Matrix3, Point3, Translation3, UnitQuaternion, Vector3};

use crate::bodies;
use crate::file_kind::FileKind;
use crate::files::Files;
use crate::problem::{self, Invalid, Problems};
use crate::raw_robot as raw;
use crate::section::{Section, Table};
use crate::trust::Trust;
use crate::value::{Optional, Value};
use ::remote::site::GRAVITY;
use toml_input::List;

/// Default gain of null-space centring, in 1/s.
const CENTRING: f64 = 0.5;

/// Range of dry friction, in N·m.
const COULOMB: RangeInclusive<f64> = 0.0..=1e4;

/// Range of the maximum torque behind the gear, in N·m.
const MAX_TORQUE: RangeInclusive<f64> = 1e-3..=1e6;

/// Robot arm of a robot file.
#[derive(Clone, Debug)]
pub struct RobotArm {
    /// Path by which the robot file was read.
    pub file: PathBuf,
    /// Displayed name.
    pub name: String,
    /// Pose of the arm's base in {b}.
    pub x_b_0: Isometry3<f64>,
    /// Pose of {MRF} in the last link.
    pub x_n_m: Isometry3<f64>,
    /// Joints with their links, base first: 6 to 9.
    pub joints: Vec<RobotJoint>,
    law: ResolvedRate,
}

/// Joint of a robot arm, with its link and motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RobotJoint {
    /// Denavit-Hartenberg parameters, modified (Craig).
    pub link: Link,
    /// Range, maximum rate and maximum acceleration.
    pub limit: JointLimit,
    /// Start position, in rad.
    pub start: f64,
    /// Mass of the link, in kg.
    pub mass: f64,
    /// Centre of mass in the link, in m.
    pub centre_of_mass: [f64; 3],
    /// Inertia about the centre of mass, xx, yy, zz, xy, xz, yz, in kg·m².
    pub inertia: [f64; 6],
    /// Inertia of the rotor at the joint, behind the gear, in kg·m².
    pub rotor_inertia: f64,
    /// Maximum torque at the joint, behind the gear, in N·m.
    pub max_torque: f64,
    /// Coulomb friction, in N·m.
    pub coulomb: f64,
    /// Viscous friction, in N·m·s/rad.
    pub viscous: f64,
}

impl RobotArm {
    /// Reads and checks a robot file. Shipped files of `config/robots/` need not be on disk.
    ///
    /// # Errors
    /// Returns every problem found, with file, line and key.
    pub fn load(file: &Path) -> Result<Self, Invalid> {
        Self::load_from(&Files::on_disk(Trust::Any), file)
    }

    /// Reads and checks `file` of `files`.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn load_from(files: &Files, file: &Path) -> Result<Self, Invalid> {
        Self::parse(file, &problem::text(files, file)?)
    }

    /// Checks `text` as the content of `file`.
    ///
    /// # Errors
    /// As [`load`](Self::load).
    pub fn parse(file: &Path, text: &str) -> Result<Self, Invalid> {
        let mut problems = Problems::new(file, text, &Files::on_disk(Trust::Any));
        let raw = problems.document(text, FileKind::Robot).map(|document| {
            let table = Table::root(&document, &problems);
            raw::RobotFile::from_table(&table, &mut problems)
        });
        let arm = raw.and_then(|raw| read(file, &raw, &mut problems));
        problems.finish()?;
        arm.ok_or_else(|| Invalid(Vec::new()))
    }

    /// Returns the resolved-rate law that commands the joints.
    pub const fn law(&self) -> &ResolvedRate {
        &self.law
    }

    /// Returns the start positions, in rad.
    pub fn start(&self) -> Joints {
        let mut q = Joints::zeros();
        for (q, joint) in q.iter_mut().zip(&self.joints) {
            *q = joint.start;
        }
        q
    }

    /// Returns the torques that hold the links against gravity at joint positions `q` in rad, in N·m. No payload.
    pub fn weight(&self, q: &Joints) -> Joints {
        let links = self.law.chain().links(q);
        let links: Vec<_> = links.iter().flatten().zip(&self.joints).collect();
        let mut torques = Joints::zeros();
        for (joint, (torque, (x_b_i, _))) in torques.iter_mut().zip(&links).enumerate() {
            let carried = links.iter().skip(joint).map(|(x_b_j, link)| {
                let centre = *x_b_j * Point3::from(link.centre_of_mass);
                let arm = centre.coords - x_b_i.translation.vector;
                arm.cross(&(link.mass * Vector3::from(GRAVITY)))
            });
            let axis = x_b_i.rotation * Vector3::z();
            *torque = -axis.dot(&carried.sum::<Vector3<f64>>());
        }
        torques
    }

    /// Returns the kinematic model of the arm at its start position.
    pub fn following(&self) -> FollowingArm {
        FollowingArm::new(self.law, self.start())
    }
}

/// Reads a robot file. Returns `None` after a problem.
fn read(file: &Path, raw: &raw::RobotFile, problems: &mut Problems<'_>) -> Option<RobotArm> {
    let before = problems.count();
    let count = raw.joint.all().len();
    if !raw.joint.is_noted() && !(MIN_JOINTS..=MAX_JOINTS).contains(&count) {
        let reason = format!(
            "an arm must have {MIN_JOINTS} to {MAX_JOINTS} joints, got {count}: add or remove [[joint]] tables"
        );
        problems.add(&raw.joint, reason);
    }
    let x_b_0 = pose(&raw.base_m, &raw.base_deg, problems);
    let x_n_m = pose(&raw.tool_m, &raw.tool_deg, problems);
    let joints: Vec<Option<RobotJoint>> =
        raw.joint.all().iter().map(|one| joint(one, problems)).collect();
    let joints = joints.into_iter().collect::<Option<Vec<_>>>()?;
    let inverse = inverse(&raw.resolved_rate, problems);
    let centring = problems.not_negative(&raw.resolved_rate.centring_per_s.or(CENTRING));
    let name = raw.name.as_ref()?.clone();
    let (x_b_0, x_n_m) = (x_b_0?, x_n_m?);

    let links: Vec<Link> = joints.iter().map(|joint| joint.link).collect();
    let chain = problems.take_unless_noted(before, &raw.joint, Chain::new(x_b_0, &links, x_n_m));
    let limits = JointLimits::new(joints.iter().map(|joint| joint.limit));
    let law = ResolvedRate::new(chain?, inverse?, limits, centring?);
    let law = problems.take(&raw.resolved_rate.centring_per_s, law)?;
    let arm = RobotArm { file: file.to_path_buf(), name, x_b_0, x_n_m, joints, law };
    for ((weight, joint), raw) in
        arm.weight(&arm.start()).iter().zip(&arm.joints).zip(raw.joint.all())
    {
        if weight.abs() > joint.max_torque {
            let reason = format!(
                "must hold the arm at its start: {:.2} N·m are needed, got {} N·m",
                weight.abs(),
                joint.max_torque
            );
            problems.add(&raw.max_torque_nm, reason);
        }
    }
    Some(arm)
}

fn inverse(raw: &raw::ResolvedRate, problems: &mut Problems<'_>) -> Option<DampedInverse> {
    let usual = DampedInverse::default();
    let threshold = problems.within(&raw.damped_below.or(usual.threshold()), 1e-3..=1.0);
    let length = problems.within(&raw.length_m.or(usual.length()), 1e-2..=1e2);
    DampedInverse::new(threshold?, length?).ok()
}

fn joint(raw: &raw::RobotJoint, problems: &mut Problems<'_>) -> Option<RobotJoint> {
    let alpha = problems.finite(&raw.alpha_deg);
    let theta = problems.finite(&raw.theta_deg.or(0.0));
    let a = problems.within(&raw.a_m, -10.0..=10.0);
    let d = problems.within(&raw.d_m, -10.0..=10.0);
    let range = range(raw, problems);
    let max_rate = problems.positive(&raw.max_rate_deg_per_s);
    let max_acceleration = problems.positive(&raw.max_acceleration_deg_per_s2);
    let mass = problems.within(&raw.mass_kg, 0.0..=1_000.0);
    let centre_of_mass = problems.all_finite(&raw.centre_of_mass_m);
    let inertia = inertia(&raw.inertia_kg_m2, problems);
    let rotor_inertia = problems.within(&raw.rotor_inertia_kg_m2, bodies::ROTOR);
    let max_torque = problems.within(&raw.max_torque_nm, MAX_TORQUE);
    let coulomb = problems.within(&raw.coulomb_friction_nm.or(0.0), COULOMB);
    let viscous = problems.within(&raw.viscous_friction_nms_per_rad.or(0.0), bodies::VISCOUS);
    let (range, start) = range?;
    Some(RobotJoint {
        link: Link { alpha: alpha?.to_radians(), a: a?, d: d?, theta: theta?.to_radians() },
        limit: JointLimit {
            range,
            max_rate: max_rate?.to_radians(),
            max_acceleration: max_acceleration?.to_radians(),
        },
        start,
        mass: mass?,
        centre_of_mass: centre_of_mass?,
        inertia: inertia?,
        rotor_inertia: rotor_inertia?,
        max_torque: max_torque?,
        coulomb: coulomb?,
        viscous: viscous?,
    })
}

/// Reads lowest and highest position, and the start position between them, in rad.
fn range(raw: &raw::RobotJoint, problems: &mut Problems<'_>) -> Option<([f64; 2], f64)> {
    let [low, high] = problems.all_finite(&raw.limit_deg)?;
    if low >= high {
        let reason = format!("must rise from lower to upper limit, got {low} to {high}");
        problems.add(&raw.limit_deg, reason);
        return None;
    }
    let start = problems.finite(&raw.start_deg)?;
    if !(low..=high).contains(&start) {
        let reason = format!("must be within limit_deg, {low} to {high}, got {start}");
        problems.add(&raw.start_deg, reason);
    }
    Some(([low.to_radians(), high.to_radians()], start.to_radians()))
}

/// Reads an inertia. Published parameter sets omit small terms, so a principal moment may be zero, but not negative.
fn inertia(value: &Value<List<f64, 6>>, problems: &mut Problems<'_>) -> Option<[f64; 6]> {
    let inertia = problems.all_finite(value)?;
    let [xx, yy, zz, xy, xz, yz] = inertia;
    let least = Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz).symmetric_eigenvalues().min();
    if least < -1e-9 {
        let reason = format!(
            "must not be negative about any axis, got a principal moment of {least:.3e} kg·m²"
        );
        problems.add(value, reason);
    }
    Some(inertia)
}

/// Reads a pose from a position in m and rotations about x, y, z in degrees.
pub(super) fn pose<const NEEDED: bool>(
    place: &Value<List<f64, 3>, NEEDED>,
    turned: &Optional<List<f64, 3>>,
    problems: &mut Problems<'_>,
) -> Option<Isometry3<f64>> {
    let place = problems.all_finite(place);
    let turned = problems.all_finite(&turned.or(List::default()));
    let [about_x, about_y, about_z] = turned?.map(f64::to_radians);
    Some(Isometry3::from_parts(
        Translation3::from(place?),
        UnitQuaternion::from_euler_angles(about_x, about_y, about_z),
    ))
}
