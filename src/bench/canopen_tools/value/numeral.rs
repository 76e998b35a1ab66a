//! Integers as text: `31`, `-5`, `0x1F`, `1Fh`. Leading zeros have no meaning.

/// Parses an integer: `31`, `-5`, `0x1F`, `1Fh`.
pub fn whole(text: &str) -> Option<i128> {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text), |digits| (-1, digits));
    let number = if bare(digits) == digits { decimal(digits) } else { hexadecimal(bare(digits)) };
    number.map(|number| sign * number)
}

/// Removes the prefix or suffix of a hexadecimal number.
pub(super) fn bare(text: &str) -> &str {
    let prefixed = text.strip_prefix("0x").or_else(|| text.strip_prefix("0X"));
    let suffixed = || text.strip_suffix(['h', 'H']);
    prefixed.or_else(suffixed).unwrap_or(text)
}

/// Parses decimal digits without a sign.
pub(super) fn decimal(digits: &str) -> Option<i128> {
    let is_digits = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_digit());
    is_digits.then(|| digits.parse().ok()).flatten()
}

/// Parses hexadecimal digits without sign, prefix or suffix.
pub fn hexadecimal(digits: &str) -> Option<i128> {
    let is_digits = !digits.is_empty() && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
    is_digits.then(|| i128::from_str_radix(digits, 16).ok()).flatten()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn integer_has_four_notations() {
        let cases = [
            ("31", 31),
            ("-5", -5),
            ("0x1F", 31),
            ("0X1f", 31),
            ("1Fh", 31),
            ("037", 37),
            ("-0x5", -5),
        ];
        for (text, number) in cases {
            assert_eq!(whole(text), Some(number), "{text}");
        }
        for text in ["", "-", "h", "0x", "1F", "+5", "--5", "0x1Fh", "5 ", "1_000", "0x-5", "٣"] {
            assert_eq!(whole(text), None, "{text}");
        }
    }

    proptest! {
        #[test]
        fn formatted_integers_parse_to_themselves(number in -(1_i128 << 100)..(1 << 100)) {
            prop_assert_eq!(whole(&number.to_string()), Some(number));
            let (sign, size) = if number < 0 { ("-", -number) } else { ("", number) };
            prop_assert_eq!(whole(&format!("{sign}0x{size:x}")), Some(number));
            prop_assert_eq!(whole(&format!("{sign}{size:X}h")), Some(number));
        }
    }
}
