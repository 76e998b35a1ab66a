//! Formatting of numbers.

/// Rounds to `digits` significant decimal digits.
pub fn significant(value: f64, digits: usize) -> f64 {
    let after_the_first = digits.saturating_sub(1);
    format!("{value:.after_the_first$e}").parse().unwrap_or(value)
}

/// Formats with `decimals` in a column of `width`; with an exponent if it does not fit.
pub fn column(value: f64, width: usize, decimals: usize) -> String {
    let plain = format!("{value:width$.decimals$}");
    if plain.len() <= width { plain } else { format!("{value:width$.3e}") }
}

/// Maximum digits of a number in a message.
const MAX_DIGITS: usize = 20;

/// Rounds the long numbers of a text: `1e300` instead of a one and three hundred zeros.
pub fn shortened(text: &str) -> String {
    let is_inside = |c: char| c.is_alphanumeric() || c == '.' || c == '_';
    let mut short = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find(is_inside) {
        let (before, word) = rest.split_at(start);
        let (word, after) = word.split_at(word.find(|c| !is_inside(c)).unwrap_or(word.len()));
        let digits = word.bytes().filter(u8::is_ascii_digit).count();
        let is_number = digits > MAX_DIGITS && digits + word.matches('.').count() == word.len();
        short.push_str(before);
        match word.parse::<f64>().ok().filter(|_| is_number) {
            Some(number) => short.push_str(&format!("{number:e}")),
            None => short.push_str(word),
        }
        rest = after;
    }
    short.push_str(rest);
    short
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_numbers_in_messages_get_an_exponent() {
        for (value, is) in
            [(1e300, "1e300"), (-1.5e-9, "-1.5e-9"), (f64::MAX, "1.7976931348623157e308")]
        {
            let message =
                format!("a.toml:3: gain = {value} N/m, at most 5; 0123456789ABCDEF0123456789");
            let short = format!("a.toml:3: gain = {is} N/m, at most 5; 0123456789ABCDEF0123456789");
            let plain = value.abs() < 1.0 && value.abs() > 1e-17;
            assert_eq!(shortened(&message), if plain { message } else { short });
        }
    }

    #[test]
    fn other_text_is_unchanged() {
        for text in
            ["", "without digits", "µs ‰ 12345678901234567890.", "a12345678901234567890123 1.5.5"]
        {
            assert_eq!(shortened(text), text);
        }
    }

    #[test]
    fn columns_keep_their_width() {
        assert_eq!(column(-1.5, 10, 5), "  -1.50000");
        assert_eq!(column(1e300, 10, 5), " 1.000e300");
        assert_eq!(column(123_456.0, 10, 5), "   1.235e5");
        assert_eq!(column(f64::NAN, 10, 5), "       NaN");
    }

    #[test]
    fn rounded_numbers_print_without_more_digits() {
        let written = |value, digits| significant(value, digits).to_string();
        assert_eq!(written(133.144_067_3, 6), "133.144");
        assert_eq!(written(-0.019_672_649, 6), "-0.0196726");
        assert_eq!(written(99.999_99, 3), "100");
        assert_eq!(written(0.0, 3), "0");
    }
}
