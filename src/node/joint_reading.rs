//! Position of a joint in a message: small, comparable, and with its unit.

use std::fmt;

use controller::arm::JointKind;

/// Position in 10⁻⁴ rad or m.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JointReading {
    /// `None` for a position that is not a number.
    ten_thousandths: Option<i32>,
    is_sliding: bool,
}

impl JointReading {
    /// Rounds a position in rad or m.
    #[expect(
        clippy::as_conversions,
        clippy::cast_possible_truncation,
        reason = "a float-to-integer cast saturates, and NaN is excluded"
    )]
    pub fn new(position: f64, kind: JointKind) -> Self {
        let ten_thousandths = position.is_finite().then_some((position * 1e4).round() as i32);
        Self { ten_thousandths, is_sliding: kind == JointKind::Prismatic }
    }

    /// Returns the keys of `[[joint]]` whose errors shift the range.
    pub(crate) const fn keys(self) -> &'static str {
        if self.is_sliding {
            "zero_counts, gear_ratio (and its sign) and limit_m"
        } else {
            "zero_counts, gear_ratio (and its sign) and limit_deg"
        }
    }
}

/// `131.2°`, `0.123 m`
impl fmt::Display for JointReading {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.ten_thousandths {
            None => f.write_str("an unknown position"),
            Some(position) if self.is_sliding => write!(f, "{:.3} m", f64::from(position) * 1e-4),
            Some(position) => write!(f, "{:.1}°", (f64::from(position) * 1e-4).to_degrees()),
        }
    }
}
