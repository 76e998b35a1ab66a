//! Spatial motions, forces and inertias at the origin of one frame (Featherstone 2008), which can be added directly.

use nalgebra::{IsometryMatrix3, Matrix3, Vector3};

/// Spatial motion: angular, and linear at the origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    pub(super) angular: Vector3<f64>,
    pub(super) linear: Vector3<f64>,
}

impl Motion {
    pub(super) const NONE: Self =
        Self { angular: Vector3::new(0.0, 0.0, 0.0), linear: Vector3::new(0.0, 0.0, 0.0) };

    pub(super) fn plus(&self, other: &Self) -> Self {
        Self { angular: self.angular + other.angular, linear: self.linear + other.linear }
    }

    pub(super) fn scaled(&self, rate: f64) -> Self {
        Self { angular: self.angular * rate, linear: self.linear * rate }
    }

    /// Returns the spatial cross product of motions.
    pub(super) fn cross(&self, other: &Self) -> Self {
        Self {
            angular: self.angular.cross(&other.angular),
            linear: self.angular.cross(&other.linear) + self.linear.cross(&other.angular),
        }
    }

    /// Returns the spatial cross product with a force.
    pub(super) fn cross_effort(&self, effort: &Effort) -> Effort {
        Effort {
            moment: self.angular.cross(&effort.moment) + self.linear.cross(&effort.force),
            force: self.angular.cross(&effort.force),
        }
    }

    /// Returns the power of `effort` at this motion.
    pub(super) fn dot(&self, effort: &Effort) -> f64 {
        self.angular.dot(&effort.moment) + self.linear.dot(&effort.force)
    }
}

/// Spatial force or momentum: moment about the origin, and force.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    pub(super) moment: Vector3<f64>,
    pub(super) force: Vector3<f64>,
}

impl Effort {
    pub(super) const NONE: Self =
        Self { moment: Vector3::new(0.0, 0.0, 0.0), force: Vector3::new(0.0, 0.0, 0.0) };

    pub(super) fn plus(&self, other: &Self) -> Self {
        Self { moment: self.moment + other.moment, force: self.force + other.force }
    }
}

/// Spatial inertia about the origin of a frame, in its axes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    /// Mass, in kg.
    pub(super) mass: f64,
    /// Mass times centre of mass, in kg·m.
    pub(super) first_moment: Vector3<f64>,
    /// Inertia about the origin, in kg·m².
    pub(super) inertia: Matrix3<f64>,
}

impl Body {
    pub(super) const NONE: Self = Self {
        mass: 0.0,
        first_moment: Vector3::new(0.0, 0.0, 0.0),
        inertia: Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    };

    /// Creates a body of `mass` in kg, centre of mass `centre` in m, and `inertia` about that in kg·m².
    pub(super) fn new(mass: f64, centre: &Vector3<f64>, inertia: Matrix3<f64>) -> Self {
        let about_centre = Self { mass, first_moment: Vector3::zeros(), inertia };
        about_centre.carried_in(&IsometryMatrix3::translation(centre.x, centre.y, centre.z))
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        Self {
            mass: self.mass + other.mass,
            first_moment: self.first_moment + other.first_moment,
            inertia: self.inertia + other.inertia,
        }
    }

    /// Transforms the body by `step`: parallel axis theorem.
    pub(super) fn carried_in(&self, step: &IsometryMatrix3<f64>) -> Self {
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

    /// Returns the force that gives the body, transformed by `step`, the linear acceleration `up` and no other.
    pub(super) fn support_in(&self, step: &IsometryMatrix3<f64>, up: &Vector3<f64>) -> Effort {
        let first_moment = step.rotation * self.first_moment + step.translation.vector * self.mass;
        Effort { moment: first_moment.cross(up), force: up * self.mass }
    }

    /// Returns the momentum at a velocity, or the force for an acceleration.
    pub(super) fn times(&self, motion: &Motion) -> Effort {
        Effort {
            moment: self.inertia * motion.angular + self.first_moment.cross(&motion.linear),
            force: motion.linear * self.mass + motion.angular.cross(&self.first_moment),
        }
    }
}
