//! Quasi-static motion of a peg without mass: springs and friction alone determine its equilibrium.
//!
//! Each step moves the peg by its wrench over a stiffness above that of its contact; at rest the wrench is zero. Forces
//! depend on positions alone, and points of contact keep their anchors, so a peg that friction holds does not move.

use nalgebra::{Isometry3, Vector3};

use sim::contact::{Contact, Features};
use units::spatial::{Twist, Wrench};

/// Part of the distance to equilibrium that one step covers in the stiffest direction.
const SHARE: f64 = 0.4;

/// Minimum number of points whose stiffness limits a step.
const MIN_POINTS: u16 = 8;

/// Peg, and the plate at {b}.
#[derive(Clone, Debug)]
pub(super) struct Body {
    contact: Contact,
    /// Pose of the end of the peg in the plate, which is also {M}.
    x_p_e: Isometry3<f64>,
    /// Stiffness of one point of contact, in N/m.
    point_stiffness: f64,
    /// Length that relates the effect of moments to that of forces, in m.
    lever: f64,
}

impl Body {
    /// Creates a peg at `x_p_e`. The {M} of `contact` is at the end of the peg, its plate at {b}.
    pub(super) const fn new(
        contact: Contact,
        x_p_e: Isometry3<f64>,
        point_stiffness: f64,
        lever: f64,
    ) -> Self {
        Self { contact, x_p_e, point_stiffness, lever }
    }

    /// Returns the pose of the end of the peg in the plate.
    pub(super) const fn x_p_e(&self) -> &Isometry3<f64> {
        &self.x_p_e
    }

    /// Returns the points in contact.
    pub(super) const fn features(&self) -> &Features {
        self.contact.features()
    }

    /// Returns the sum of the normal forces of all points, in N.
    pub(super) const fn pressure(&self) -> f64 {
        self.contact.pressure()
    }

    /// Returns the depth of the end below the face, in m.
    pub(super) fn depth(&self) -> f64 {
        -self.x_p_e.translation.z
    }

    /// Moves by one step under `load`, at the end of the peg in the axes of the plate, with its depth kept if
    /// it `is_held`. Returns the length of the motion, in m.
    pub(super) fn yield_to(&mut self, load: &Wrench, is_held: bool) -> f64 {
        let to_end = self.x_p_e.rotation.inverse();
        let f_e = self.contact.wrench(&self.x_p_e, &Twist::ZERO) + load.turned(&to_end);
        let scale = self.scale();
        let mut linear = f_e.force * scale;
        if is_held {
            let along = to_end * Vector3::z();
            linear -= along * linear.dot(&along);
        }
        let angular = f_e.moment * (scale / (self.lever * self.lever));
        self.x_p_e *= Twist { linear, angular }.over(1.0);
        linear.norm() + self.lever * angular.norm()
    }

    /// Returns the motion of a step per force, in m/N.
    pub(super) fn scale(&self) -> f64 {
        SHARE / (self.point_stiffness * f64::from(self.features().total().max(MIN_POINTS)))
    }
}
