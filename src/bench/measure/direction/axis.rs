//! Signed axes of {0}, the frame of the arm's base.

use derive_more::Display;
use nalgebra::Vector3;

/// Axis of {0}, with its direction.
#[derive(Clone, Copy, Debug, Display, PartialEq, Eq)]
#[display("{}{}", if *is_negative { '-' } else { '+' }, ["x", "y", "z"].get(*index).unwrap_or(&"?"))]
pub struct Axis {
    index: usize,
    is_negative: bool,
}

impl Axis {
    /// +x
    pub const X: Self = Self { index: 0, is_negative: false };
    /// +y
    pub const Y: Self = Self { index: 1, is_negative: false };
    /// +z
    pub const Z: Self = Self { index: 2, is_negative: false };

    /// Returns the axis nearest to a direction.
    pub(crate) fn nearest(direction: &Vector3<f64>) -> Self {
        let index = direction.iamax();
        let is_negative = direction.get(index).is_some_and(|part| *part < 0.0);
        Self { index, is_negative }
    }

    /// Returns the unit vector.
    pub(crate) fn unit(self) -> Vector3<f64> {
        let sign = if self.is_negative { -1.0 } else { 1.0 };
        Vector3::from_fn(|index, _| if index == self.index { sign } else { 0.0 })
    }

    /// Returns it in words, with up and down by gravity: "up (+z of {0})".
    pub(crate) fn in_words(self, gravity: &Vector3<f64>) -> String {
        let down = self.unit().dot(gravity) / gravity.norm();
        if down > 0.98 {
            format!("down ({self} of {{0}})")
        } else if down < -0.98 {
            format!("up ({self} of {{0}})")
        } else {
            format!("towards {self} of {{0}}")
        }
    }
}
