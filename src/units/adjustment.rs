//! Adjustments by the operator while the arm runs, as text: `scale motion 0.5`, `lock rz on`, `align`. Console, switch box
//! and scenarios share them.

use std::str::FromStr;

use derive_more::Display;
use thiserror::Error;

/// Change of the command or of the reflection.
#[derive(Clone, Copy, Debug, PartialEq, Display)]
pub enum Adjustment {
    /// Scales a quantity by a factor.
    #[display("scale {_0} {_1}")]
    Scale(Quantity, f64),
    /// Locks (`true`) or releases an axis of the command.
    #[display("lock {_0} {}", if *_1 { "on" } else { "off" })]
    Lock(LockAxis, bool),
    /// Turns the object to the orientation of the grip.
    #[display("align")]
    Align,
}

/// Quantity with a scale.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Display)]
pub enum Quantity {
    /// Commanded translation.
    #[display("motion")]
    Motion,
    /// Commanded rotation.
    #[display("rotation")]
    Rotation,
    /// Reflected wrench.
    #[display("force")]
    Force,
}

/// Axis of {MRF} that can be locked.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Display)]
pub enum LockAxis {
    /// Translation along x.
    #[display("x")]
    X,
    /// Translation along y.
    #[display("y")]
    Y,
    /// Translation along z.
    #[display("z")]
    Z,
    /// Rotation about x.
    #[display("rx")]
    Rx,
    /// Rotation about y.
    #[display("ry")]
    Ry,
    /// Rotation about z.
    #[display("rz")]
    Rz,
}

/// Text that is not an adjustment.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "expected \"scale motion|rotation|force FACTOR\", \"lock x|y|z|rx|ry|rz on|off\" or \"align\", got {0:?}"
)]
pub struct InvalidAdjustment(pub String);

impl Quantity {
    /// All quantities.
    pub const ALL: [Self; 3] = [Self::Motion, Self::Rotation, Self::Force];
}

impl LockAxis {
    /// All axes, in the order of every six-vector.
    pub const ALL: [Self; 6] = [Self::X, Self::Y, Self::Z, Self::Rx, Self::Ry, Self::Rz];

    /// Returns the entry of this axis in a six-vector.
    pub const fn entry<T: Copy>(self, [x, y, z, rx, ry, rz]: &[T; 6]) -> T {
        match self {
            Self::X => *x,
            Self::Y => *y,
            Self::Z => *z,
            Self::Rx => *rx,
            Self::Ry => *ry,
            Self::Rz => *rz,
        }
    }

    /// Returns whether the axis is `Rx`, `Ry` or `Rz`.
    pub const fn is_rotation(self) -> bool {
        matches!(self, Self::Rx | Self::Ry | Self::Rz)
    }
}

impl FromStr for Adjustment {
    type Err = InvalidAdjustment;

    fn from_str(text: &str) -> Result<Self, InvalidAdjustment> {
        let mut words = text.split(' ');
        let parsed = match (words.next(), words.next(), words.next(), words.next()) {
            (Some("scale"), Some(quantity), Some(factor), None) => {
                let named = |named: &Quantity| named.to_string() == quantity;
                let factor = factor.parse().ok().filter(|factor: &f64| factor.is_finite());
                Quantity::ALL
                    .into_iter()
                    .find(named)
                    .zip(factor)
                    .map(|(quantity, factor)| Self::Scale(quantity, factor))
            }
            (Some("lock"), Some(axis), Some(state @ ("on" | "off")), None) => {
                let named = |named: &LockAxis| named.to_string() == axis;
                LockAxis::ALL.into_iter().find(named).map(|axis| Self::Lock(axis, state == "on"))
            }
            (Some("align"), None, None, None) => Some(Self::Align),
            _ => None,
        };
        parsed.ok_or_else(|| InvalidAdjustment(text.to_owned()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn adjustments_are_read_as_they_are_written() {
        let scales = Quantity::ALL.map(|quantity| Adjustment::Scale(quantity, 0.5));
        let locks = LockAxis::ALL.map(|axis| Adjustment::Lock(axis, axis.is_rotation()));
        for adjustment in scales.into_iter().chain(locks).chain([Adjustment::Align]) {
            assert_eq!(adjustment.to_string().parse(), Ok(adjustment));
        }
        assert_eq!(Adjustment::Lock(LockAxis::Rz, true).to_string(), "lock rz on");
    }

    #[test]
    fn other_texts_are_refused() {
        for text in [
            "",
            "scale",
            "scale motion",
            "scale motion NaN",
            "scale motion inf",
            "scale x 1",
            "scale motion 1 1",
            "lock x",
            "lock w on",
            "lock x maybe",
            "align now",
            " align",
            "align ",
        ] {
            assert_eq!(text.parse::<Adjustment>(), Err(InvalidAdjustment(text.to_owned())));
        }
    }
}
