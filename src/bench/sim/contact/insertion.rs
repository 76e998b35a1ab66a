//! Pose of the pegs relative to their holes.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};

use crate::contact::peg::Pegs;
use crate::contact::plate::Plate;
use crate::contact::{Contact, Shape};

/// One peg relative to the nearest hole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Insertion {
    /// Depth of the centre of its end below the face, in m; negative above it.
    pub depth: f64,
    /// Distance of the centre of its end from the axis of the hole, in m.
    pub offset: f64,
    /// Angle between the axes, in rad.
    pub tilt: f64,
}

/// All pegs relative to the plate, in {P}.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Misalignment {
    /// Centre of the ends, with z above the face, in m.
    pub offset: Vector3<f64>,
    /// Rotation vector from the aligned orientation, in rad. One peg has none about its axis; two may be exchanged.
    pub rotation: Vector3<f64>,
}

impl Contact {
    /// Returns the pose of the ends of the pegs in {P}; `None` without pegs or plate.
    pub fn x_p_e(&self, x_b_m: &Isometry3<f64>) -> Option<Isometry3<f64>> {
        let (pegs, plate) = self.pegs_and_plate()?;
        Some(plate.x_b_p.inverse() * x_b_m * pegs.x_m_e())
    }

    /// Returns the pose `x_b_m` with the pegs aligned to their holes, their ends `height` m above the face.
    pub fn aligned(&self, height: f64) -> Option<Isometry3<f64>> {
        let (pegs, plate) = self.pegs_and_plate()?;
        let x_p_e = Isometry3::translation(0.0, 0.0, height) * facing();
        Some(plate.x_b_p * x_p_e * pegs.x_m_e().inverse())
    }

    /// Returns each peg relative to its nearest hole.
    pub fn insertions(&self, x_b_m: &Isometry3<f64>) -> [Option<Insertion>; 2] {
        let mut insertions = [None; 2];
        let Some(((pegs, plate), x_p_e)) = self.pegs_and_plate().zip(self.x_p_e(x_b_m)) else {
            return insertions;
        };
        for (insertion, axis) in insertions.iter_mut().zip(pegs.axes()) {
            let end = x_p_e * nalgebra::Point3::new(axis, 0.0, 0.0);
            let distance = |hole: f64| (end.x - hole).hypot(end.y);
            let offset = plate.holes.axes().map(distance).fold(f64::INFINITY, f64::min);
            let along = x_p_e.rotation * Vector3::z();
            let tilt = along.xy().norm().atan2(-along.z);
            *insertion = Some(Insertion { depth: -end.z, offset, tilt });
        }
        insertions
    }

    /// Returns the pose of the pegs relative to the aligned one; `None` without pegs or plate.
    pub fn misalignment(&self, x_b_m: &Isometry3<f64>) -> Option<Misalignment> {
        let (pegs, _) = self.pegs_and_plate()?;
        let x_p_e = self.x_p_e(x_b_m)?;
        let rotation = if pegs.count > 1 {
            let exchanged =
                facing() * UnitQuaternion::from_scaled_axis(Vector3::z() * std::f64::consts::PI);
            let turns = [facing(), exchanged].map(|aligned| x_p_e.rotation * aligned.inverse());
            let [first, second] = turns.map(|turn| turn.scaled_axis());
            if second.norm() < first.norm() { second } else { first }
        } else {
            let along = x_p_e.rotation * Vector3::z();
            UnitQuaternion::rotation_between(&-Vector3::z(), &along)
                .map_or_else(|| Vector3::x() * std::f64::consts::PI, |turn| turn.scaled_axis())
        };
        Some(Misalignment { offset: x_p_e.translation.vector, rotation })
    }

    fn pegs_and_plate(&self) -> Option<(&Pegs, &Plate)> {
        match (self.shape(), &self.scene().plate) {
            (Shape::Pegs(pegs), Some(plate)) => Some((pegs, plate)),
            (Shape::Pegs(_), None) | (Shape::Cube { .. }, _) => None,
        }
    }
}

/// Returns the orientation of {E} in {P} when aligned: pegs into the face, x along x.
fn facing() -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(Vector3::x() * std::f64::consts::PI)
}
