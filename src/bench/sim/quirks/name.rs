//! Names of quirks, `slow-sdo`, or `slow-sdo:300` with a value: errors, and the values that follow the colon.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

use thiserror::Error;

use crate::quirks::Quirk;
use canopen::object::Object;

/// Reasons to refuse the name of a quirk.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum UnknownQuirk {
    /// No quirk has this name.
    #[error("unknown quirk `{0}`; expected one of {list}", list = Quirk::NAMES.join(", "))]
    Name(String),
    /// Value of a quirk that has no parameter.
    #[error("quirk `{0}` takes no value")]
    NoValue(&'static str),
    /// Invalid value.
    #[error("value of quirk `{name}` must be {wanted}, got `{value}`")]
    Value {
        /// Name without the value: `slow-sdo`.
        name: &'static str,
        /// Values allowed.
        wanted: String,
        /// Value given.
        value: String,
    },
}

/// Reads a number within `bounds`; the error, here and below, names the values allowed.
pub(super) fn number<T: FromStr + PartialOrd + Display>(
    text: &str,
    bounds: RangeInclusive<T>,
    unit: &str,
) -> Result<T, String> {
    let number = text.parse().ok().filter(|number| bounds.contains(number));
    number.ok_or_else(|| format!("within {}..={}{unit}", bounds.start(), bounds.end()))
}

/// Reads a time in ms, an integer.
pub(super) fn millis(text: &str, bounds: RangeInclusive<u64>) -> Result<Duration, String> {
    number(text, bounds, " ms").map(Duration::from_millis)
}

/// Reads an object in the form that [`Object`] displays.
pub(super) fn object(text: &str) -> Result<Object, String> {
    parse_object(text).ok_or_else(|| "an object such as 6072h or 1016h:1".to_owned())
}

/// Reads an object and its value: decimal, with `0x`, or hexadecimal with the suffix `h` of CiA 301.
pub(super) fn stored(text: &str) -> Result<(Object, u32), String> {
    let wanted = || "an object and a number such as 6091h:1=2 or 607Eh=0x80".to_owned();
    parse_stored(text).ok_or_else(wanted)
}

fn parse_object(text: &str) -> Option<Object> {
    let (index, sub) = text.split_once(':').unwrap_or((text, "0"));
    let digits = index.strip_suffix('h').filter(|digits| digits.len() == 4)?;
    Some(Object { index: u16::try_from(hexadecimal(digits)?).ok()?, sub: sub.parse().ok()? })
}

fn parse_stored(text: &str) -> Option<(Object, u32)> {
    let (object, value) = text.split_once('=')?;
    let value = match value.strip_prefix("0x").or_else(|| value.strip_suffix('h')) {
        Some(digits) => hexadecimal(digits)?,
        None => value.parse().ok()?,
    };
    Some((parse_object(object)?, value))
}

/// Parses digits without a sign.
fn hexadecimal(digits: &str) -> Option<u32> {
    let is_hexadecimal = digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    is_hexadecimal.then(|| u32::from_str_radix(digits, 16).ok())?
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quirks_survive_display_and_parse() {
        for name in Quirk::NAMES {
            let quirk: Quirk = name.parse().unwrap();
            assert_eq!(quirk.name(), name);
            assert_eq!(quirk.to_string().parse(), Ok(quirk));
        }
        for text in [
            "slow-sdo:1",
            "late-boot:60000",
            "running-at-start:-250",
            "forgetful:1016h:1",
            "lost-sdo-reply:7",
            "slow-first-answer:4000",
            "filtered-torque:-5",
            "mode-when-enabled:8",
            "lost-write-reply:7",
            "stored:6076h=176000",
            "stored:60A8h=4282449920",
        ] {
            assert_eq!(text.parse::<Quirk>().unwrap().to_string(), text);
        }
        assert_eq!("stored:607Eh=0x80".parse(), Ok(Quirk::Stored(Object::POLARITY, 0x80)));
        let unit = Quirk::Stored(Object::POSITION_UNIT, 0xFF41_0000);
        assert_eq!("stored:60A8h=FF410000h".parse(), Ok(unit));
        assert_eq!("forgetful:6007h".parse(), Ok(Quirk::Forgetful(Object::ABORT_CONNECTION)));
    }

    #[test]
    fn unknown_or_invalid_quirks_are_refused_in_one_line() {
        for (text, words) in [
            ("evil", "unknown quirk `evil`; expected one of deaf-to-master, keeps-torque, "),
            ("", "unknown quirk ``"),
            ("Slow-SDO", "unknown quirk `Slow-SDO`"),
            ("open-rpdos:3", "quirk `open-rpdos` takes no value"),
            ("slow-sdo:0", "value of quirk `slow-sdo` must be within 1..=10000 ms, got `0`"),
            (
                "slow-sdo:150ms",
                "value of quirk `slow-sdo` must be within 1..=10000 ms, got `150ms`",
            ),
            (
                "running-at-start:1001",
                "value of quirk `running-at-start` must be within -1000..=1000 ‰ of rated torque, got",
            ),
            (
                "forgetful:6072",
                "value of quirk `forgetful` must be an object such as 6072h or 1016h:1, got `6072`",
            ),
            ("forgetful:+072h", "value of quirk `forgetful` must be an object"),
            ("forgetful:1016h:256", "value of quirk `forgetful` must be an object"),
            ("lost-sdo-reply:0", "value of quirk `lost-sdo-reply` must be within 1..=1000000, got"),
            ("no-rtr:1", "quirk `no-rtr` takes no value"),
            (
                "stored:6091h:1",
                "value of quirk `stored` must be an object and a number such as 6091h:1=2 or",
            ),
            ("stored:6091=2", "value of quirk `stored` must be an object and a number"),
            ("stored:6091h:1=0x+2", "value of quirk `stored` must be an object and a number"),
            ("stored:6091h:1=5000000000", "value of quirk `stored` must be an object and a num"),
        ] {
            let error = text.parse::<Quirk>().unwrap_err().to_string();
            assert!(error.starts_with(words), "{error}");
            assert_eq!(error.lines().count(), 1);
        }
    }
}
