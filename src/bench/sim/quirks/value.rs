//! Values that follow the colon in the name of a quirk, `slow-sdo:300`.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

use canopen::object::Object;

/// Reads a number within `bounds`; the error, here and below, names the values allowed.
pub(super) fn number<T: FromStr + PartialOrd + Display>(
    text: &str,
    bounds: RangeInclusive<T>,
    unit: &str,
) -> Result<T, String> {
    let number = text.parse().ok().filter(|number| bounds.contains(number));
    number.ok_or_else(|| format!("within {}..={}{unit}", bounds.start(), bounds.end()))
}

/// Reads a number of motor revolutions, which must not be 0.
pub(super) fn revolutions(text: &str, bounds: RangeInclusive<i8>) -> Result<i8, String> {
    let wanted = format!("within {}..={} revolutions, not 0", bounds.start(), bounds.end());
    number(text, bounds, "").ok().filter(|revolutions| *revolutions != 0).ok_or(wanted)
}

/// Reads a manufacturer-specific bit of the statusword (CiA 402-2, 6041h).
pub(super) fn manufacturer_bit(text: &str) -> Result<u8, String> {
    let bit = text.parse().ok().filter(|bit| matches!(bit, 8 | 14 | 15));
    bit.ok_or_else(|| "8, 14 or 15".to_owned())
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
    use crate::quirks::Quirk;

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
            "encoder-slipped:-12.25",
            "encoder-slipped:180",
            "wrong-revolution:-100",
            "referenced-bit:8",
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
                "encoder-slipped:180.1",
                "value of quirk `encoder-slipped` must be within -180..=180 ° (mm of a prismatic joint), got",
            ),
            ("encoder-slipped:nan", "value of quirk `encoder-slipped` must be within -180..=180 °"),
            (
                "wrong-revolution:0",
                "value of quirk `wrong-revolution` must be within -100..=100 revolutions, not 0, got `0`",
            ),
            ("wrong-revolution:101", "value of quirk `wrong-revolution` must be within -100..=100"),
            ("referenced-bit:10", "value of quirk `referenced-bit` must be 8, 14 or 15, got `10`"),
            ("homing-moves:1", "quirk `homing-moves` takes no value"),
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
