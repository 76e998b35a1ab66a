//! Configurations whose drives lose their zero with the power, from those of absolute drives: for campaigns and tests.

use std::f64::consts::TAU;

use toml::{Table, Value};

use units::numbering::Joint;

/// Maximum tolerance of a revolute joint with any zero, in degrees.
const ROTATION_TOLERANCE: f64 = 5.0;

/// Maximum tolerance of a prismatic joint with any zero, in m.
const TRANSLATION_TOLERANCE: f64 = 0.01;

/// Tolerance of a single-turn zero, in revolutions at the joint; a quarter is allowed.
const SHARE: f64 = 0.2;

/// Kind of zero that a power cycle takes away.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LostZero {
    /// Known but for whole revolutions of the motor.
    SingleTurn,
    /// Set by the rest posture.
    Rest,
    /// Set in the drive, by a homing in the rest posture.
    Homing,
}

impl LostZero {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::SingleTurn, Self::Rest, Self::Homing];

    /// Returns the value of the key `zero`.
    pub const fn key(self) -> &'static str {
        match self {
            Self::SingleTurn => "single-turn",
            Self::Rest => "rest",
            Self::Homing => "homing",
        }
    }

    /// Returns the text of a configuration with this zero in each joint that `is_of` selects by its section.
    ///
    /// # Errors
    /// When the text is not TOML.
    pub fn set_in(self, text: &str, is_of: fn(&Table) -> bool) -> Result<String, toml::de::Error> {
        in_joints(text, |_, joint| {
            if is_of(joint) {
                self.set(joint);
            }
        })
    }

    fn set(self, joint: &mut Table) {
        let counts = joint.remove("zero_counts").and_then(|counts| counts.as_integer());
        let per_revolution = joint.get("encoder_counts_per_rev").and_then(Value::as_integer);
        joint.insert("zero".to_owned(), self.key().into());
        match (self, counts.zip(per_revolution)) {
            (Self::SingleTurn, Some((counts, per_revolution))) => {
                let within = counts.checked_rem_euclid(per_revolution).unwrap_or_default();
                joint.insert("zero_counts".to_owned(), within.into());
                set_tolerance(joint);
            }
            (Self::Homing, Some((counts, _))) => {
                joint.insert("zero_counts".to_owned(), counts.into());
            }
            (Self::Rest, _) | (_, None) => {}
        }
    }
}

/// Returns the text of a configuration whose simulated arm lies beside its rest posture by this distance of one joint, in
/// rad or m.
///
/// # Errors
/// When the text is not TOML.
pub fn laid_beside(text: &str, (joint, by): (Joint, f64)) -> Result<String, toml::de::Error> {
    in_joints(text, |place, section| {
        if place != joint.index() {
            return;
        }
        let (unit, by) = if is_prismatic(section) { ("m", by) } else { ("deg", by.to_degrees()) };
        if let Some(rest) = number(section, &format!("rest_{unit}")) {
            section.insert(format!("start_{unit}"), (rest + by).into());
        }
    })
}

fn in_joints(text: &str, change: impl Fn(usize, &mut Table)) -> Result<String, toml::de::Error> {
    let mut file: Table = text.parse()?;
    let joints = file.get_mut("joint").and_then(Value::as_array_mut).into_iter().flatten();
    for (place, joint) in joints.filter_map(Value::as_table_mut).enumerate() {
        change(place, joint);
    }
    Ok(file.to_string())
}

fn set_tolerance(joint: &mut Table) {
    let (key, most) = match is_prismatic(joint) {
        true => ("rest_tolerance_m", TRANSLATION_TOLERANCE),
        false => ("rest_tolerance_deg", ROTATION_TOLERANCE),
    };
    let turn = if is_prismatic(joint) { TAU } else { 360.0 };
    if let Some(gear_ratio) = number(joint, "gear_ratio") {
        joint.insert(key.to_owned(), most.min(SHARE * turn / gear_ratio.abs()).into());
    }
}

/// Returns a number of a section, which may be written without a point.
fn number(joint: &Table, key: &str) -> Option<f64> {
    let value = joint.get(key)?;
    let whole = || Some(f64::from(i32::try_from(value.as_integer()?).ok()?));
    value.as_float().or_else(whole)
}

fn is_prismatic(joint: &Table) -> bool {
    joint.get("kind").and_then(Value::as_str) == Some("prismatic")
}
