//! Result of one gain check: an inequality with both sides, and its verdict.

use std::fmt;

use serde::Serialize;

/// Verdict on an inequality, in order of severity.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Inequality that holds.
    Holds,
    /// Inequality that does not hold, or holds within its margin; the hand or the passivity layer covers it.
    Warns,
    /// Inequality that does not hold, and that nothing covers: the gains are refused.
    Refuses,
}

/// Gain to change if an inequality does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Culprit {
    /// K_D.
    Damping,
    /// Share of friction compensation.
    Friction,
    /// K_T.
    Wrench,
    /// F0, plateau of the return to centre.
    Centring,
    /// K_FA.
    Accommodation,
    /// K_vc and B_vc of the virtual coupling.
    Coupling,
    /// Refill and maximum damping of the tank.
    Tank,
    /// Maximum damping of the passivity layer.
    PassivityDamper,
}

/// One side of an inequality.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Side {
    /// Expression, in the symbols of [`axis`](crate::stability::axis).
    pub symbols: String,
    /// Value, in `unit`.
    pub value: f64,
    /// Unit symbol; empty for a ratio.
    pub unit: &'static str,
}

/// Inequality `left < right` that the gains must satisfy on one axis. An infinite side serializes as null.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Subject of the inequality.
    pub name: &'static str,
    /// Name of the axis, as in [`AXES`](crate::gains::AXES).
    pub axis: &'static str,
    /// Severity.
    pub verdict: Verdict,
    /// Value of the gains.
    pub left: Side,
    /// Bound on `left`.
    pub right: Side,
    /// Consequence, and the layer that covers a violation, if any.
    pub reason: String,
    /// Gain to change.
    #[serde(skip)]
    pub culprit: Culprit,
}

impl Finding {
    /// Ratio of the left side to the right; above 1 if the inequality does not hold.
    pub fn share(&self) -> f64 {
        self.left.value / self.right.value
    }
}

/// Writes one line such as `pose reflection, x: K (T/2 + n T) = 1.50 N·s/m must stay below b = 0.31 N·s/m`, and the
/// reason unless the verdict is [`Verdict::Holds`].
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, axis, left, right, verdict, reason, .. } = self;
        if right.value.is_infinite() {
            write!(f, "{name}, {axis}: {left} has no upper bound")?;
        } else {
            write!(f, "{name}, {axis}: {left} must stay below {right}")?;
        }
        match verdict {
            Verdict::Holds => Ok(()),
            Verdict::Warns | Verdict::Refuses => write!(f, "; {reason}"),
        }
    }
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.symbols, Digits(self.value))?;
        if self.unit.is_empty() { Ok(()) } else { write!(f, " {}", self.unit) }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Holds => "holds",
            Self::Warns => "warns",
            Self::Refuses => "refuses",
        })
    }
}

/// Number with at least three significant digits.
pub(super) struct Digits(pub(super) f64);

impl fmt::Display for Digits {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_infinite() {
            return f.write_str("∞");
        }
        let mut decimals = 0;
        let mut scaled = self.0.abs();
        while scaled < 99.95 && scaled > 0.0 && decimals < 9 {
            scaled *= 10.0;
            decimals += 1;
        }
        write!(f, "{:.*}", decimals, self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn side(symbols: &str, value: f64) -> Side {
        Side { symbols: symbols.to_owned(), value, unit: "N·s/m" }
    }

    #[test]
    fn a_finding_is_one_line_with_both_sides() {
        let finding = Finding {
            name: "pose reflection",
            axis: "x",
            left: side("K T/2 + n K T", 1.5),
            right: side("b", 0.312),
            verdict: Verdict::Warns,
            reason: "the hand covers it".to_owned(),
            culprit: Culprit::Wrench,
        };
        assert_eq!(
            finding.to_string(),
            "pose reflection, x: K T/2 + n K T = 1.50 N·s/m must stay below b = 0.312 N·s/m; the \
             hand covers it"
        );
    }

    #[test]
    fn infinite_bound_is_said_in_words() {
        let finding = Finding {
            name: "damping, held",
            axis: "x",
            left: side("K_D", 8.0),
            right: side("K_D at ρ = 1", f64::INFINITY),
            verdict: Verdict::Holds,
            reason: String::new(),
            culprit: Culprit::Damping,
        };
        assert_eq!(finding.to_string(), "damping, held, x: K_D = 8.00 N·s/m has no upper bound");
    }

    #[test]
    fn numbers_have_three_digits_that_say_something() {
        for (value, text) in [
            (0.0, "0"),
            (1234.5, "1234"),
            (99.97, "100"),
            (12.34, "12.3"),
            (0.001_234_5, "0.00123"),
            (-1.5, "-1.50"),
            (f64::INFINITY, "∞"),
        ] {
            assert_eq!(Digits(value).to_string(), text);
        }
    }
}
