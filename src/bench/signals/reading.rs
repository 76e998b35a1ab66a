//! Reading of a quantity from a cycle: a number, or one for each joint, bus or component.

use nalgebra::Isometry3;

use crate::cycles::Cycle;
use controller::arm::JointKind;
use controller::reference::Displacement;
use units::spatial::{Twist, Wrench};

/// Reading of a quantity, with its unit unless the kind defines it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Reading {
    /// Single number.
    Number(&'static str, fn(&Cycle<'_>) -> Option<f64>),
    /// Number for each joint, base first.
    Joints(JointUnit, fn(&Cycle<'_>) -> Option<[f64; 6]>),
    /// Number for each bus.
    Buses(&'static str, fn(&Cycle<'_>, usize) -> Option<f64>),
    /// Force and moment.
    Wrench(fn(&Cycle<'_>) -> Option<Wrench>),
    /// Linear and angular velocity.
    Twist(fn(&Cycle<'_>) -> Option<Twist>),
    /// Position and quaternion.
    Pose(fn(&Cycle<'_>) -> Option<Isometry3<f64>>),
    /// Translation, and the angles of Eq. 4.
    Displacement(fn(&Cycle<'_>) -> Option<Displacement>),
}

/// Unit of a joint's number.
#[derive(Clone, Copy, Debug)]
pub(crate) enum JointUnit {
    /// rad, or m of a prismatic joint.
    Position,
    /// N·m, or N of a prismatic joint.
    Torque,
    /// Same unit for all joints.
    Fixed(&'static str),
}

impl JointUnit {
    const fn unit(self, kind: JointKind) -> &'static str {
        match (self, kind) {
            (Self::Position, JointKind::Revolute) => "rad",
            (Self::Position, JointKind::Prismatic) => "m",
            (Self::Torque, JointKind::Revolute) => "N·m",
            (Self::Torque, JointKind::Prismatic) => "N",
            (Self::Fixed(unit), _) => unit,
        }
    }
}

impl Reading {
    /// Returns name and unit of each component; the name of a single number is empty.
    pub(crate) fn components(
        &self,
        joints: &[(String, JointKind)],
        buses: &[String],
    ) -> Vec<(String, &'static str)> {
        let named = |[unit, turned]: [&'static str; 2], names: [&[&str]; 2]| {
            let [straight, rotary] = names;
            let straight = straight.iter().map(|name| ((*name).to_owned(), unit));
            straight.chain(rotary.iter().map(|name| ((*name).to_owned(), turned))).collect()
        };
        match self {
            Self::Number(unit, _) => vec![(String::new(), *unit)],
            Self::Joints(unit, _) => {
                joints.iter().map(|(name, kind)| (name.clone(), unit.unit(*kind))).collect()
            }
            Self::Buses(unit, _) => buses.iter().map(|name| (name.clone(), *unit)).collect(),
            Self::Wrench(_) => named(["N", "N·m"], [&["fx", "fy", "fz"], &["mx", "my", "mz"]]),
            Self::Twist(_) => named(["m/s", "rad/s"], [&["vx", "vy", "vz"], &["wx", "wy", "wz"]]),
            Self::Pose(_) => named(["m", ""], [&["px", "py", "pz"], &["qi", "qj", "qk", "qw"]]),
            Self::Displacement(_) => {
                named(["m", "rad"], [&["x", "y", "z"], &["gamma", "beta", "alpha"]])
            }
        }
    }

    /// Returns the component of this index.
    pub(crate) fn value(&self, cycle: &Cycle<'_>, place: usize) -> Option<f64> {
        match self {
            Self::Number(_, read) => read(cycle),
            Self::Joints(_, read) => read(cycle)?.get(place).copied(),
            Self::Buses(_, read) => read(cycle, place),
            Self::Wrench(read) => read(cycle)?.components().get(place).copied(),
            Self::Twist(read) => read(cycle)?.components().get(place).copied(),
            Self::Displacement(read) => read(cycle)?.components().get(place).copied(),
            Self::Pose(read) => {
                let pose = read(cycle)?;
                let numbers = pose.translation.vector.iter().chain(pose.rotation.coords.iter());
                numbers.copied().nth(place)
            }
        }
    }
}
