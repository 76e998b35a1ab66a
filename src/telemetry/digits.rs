//! Numbers with as many digits as they deserve.

/// The nearest number of so many significant decimal digits; written out, it has no more.
pub fn significant(value: f64, digits: usize) -> f64 {
    let after_the_first = digits.saturating_sub(1);
    format!("{value:.after_the_first$e}").parse().unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn written_out_a_number_has_no_more_digits() {
        let written = |value, digits| significant(value, digits).to_string();
        assert_eq!(written(133.144_067_3, 6), "133.144");
        assert_eq!(written(-0.019_672_649, 6), "-0.0196726");
        assert_eq!(written(99.999_99, 3), "100");
        assert_eq!(written(0.0, 3), "0");
    }
}
