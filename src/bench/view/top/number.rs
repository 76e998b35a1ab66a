//! Numbers of constant width: columns stay in place, and digits are never cut.

use units::wording::without_minus_zero;

/// Shown for a number that is absent.
const ABSENT: &str = "–";

/// Returns a number with these decimals, aligned on the right in at least `width` columns. One that does not fit has
/// fewer decimals, then a power of ten, then is shown as a bound.
pub(super) fn fixed(value: Option<f64>, width: usize, decimals: usize) -> String {
    let Some(value) = value.filter(|value| value.is_finite()) else {
        return format!("{ABSENT:>width$}");
    };
    let plain =
        (0..=decimals).rev().map(|decimals| without_minus_zero(format!("{value:.decimals$}")));
    let powers = [format!("{value:.1e}"), format!("{value:.0e}")];
    let fitting = plain.chain(powers).find(|text| text.len() <= width);
    let bound = || if value < 0.0 { "<".to_owned() } else { ">".to_owned() };
    format!("{:>width$}", fitting.unwrap_or_else(bound))
}

/// Returns a share, 0 to 1, in percent: 5 columns.
pub(super) fn percent(share: Option<f64>) -> String {
    format!("{} %", fixed(share.map(|share| share * 100.0), 3, 0))
}

/// Returns a bar of this number of columns.
pub(super) fn bar(share: Option<f64>, columns: usize) -> String {
    let Some(share) = share.filter(|share| share.is_finite()) else {
        return format!("{ABSENT:<columns$}");
    };
    let cells = u32::try_from(columns).unwrap_or(u32::MAX);
    let is_full = |cell: u32| f64::from(cell) + 0.5 <= share * f64::from(cells);
    (0..cells).map(|cell| if is_full(cell) { '█' } else { '░' }).collect()
}

/// Returns a time in µs as hours, minutes and seconds, and from 100 hours on as days and hours: 8 columns.
pub(super) fn clock(at_us: Option<f64>) -> String {
    let seconds = at_us.filter(|at_us| *at_us >= 0.0).map(|at_us| (at_us / 1e6).floor());
    let part = |seconds: f64, per: f64, of: f64| (seconds / per).floor() % of;
    let text = seconds.map(|seconds| match part(seconds, 3_600.0, f64::INFINITY) {
        hours if hours < 100.0 => {
            format!(
                "{hours:02.0}:{:02.0}:{:02.0}",
                part(seconds, 60.0, 60.0),
                part(seconds, 1.0, 60.0)
            )
        }
        hours => format!("{:.0}d {:02.0}h", (hours / 24.0).floor(), hours % 24.0),
    });
    format!("{:>8}", text.filter(|text| text.len() <= 8).as_deref().unwrap_or(ABSENT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn number_keeps_its_width() {
        for (value, text) in [
            (Some(1.236), "    1.24"),
            (Some(-0.001), "    0.00"),
            (Some(-12_345.678), "-12345.7"),
            (Some(1_234_567_890.0), "1.2e9"),
            (Some(-1e300), "-1.0e300"),
            (Some(f64::NAN), "       –"),
            (None, "       –"),
        ] {
            let found = fixed(value, 8, 2);
            assert_eq!(found.chars().count(), 8, "{value:?}");
            assert_eq!(found.trim_start(), text.trim_start());
        }
        assert_eq!(fixed(Some(1e9), 2, 0), " >");
        assert_eq!(fixed(Some(-1e9), 2, 0), " <");
    }

    #[test]
    fn percent_and_bar_show_the_same_share() {
        for (share, text, cells) in [
            (Some(0.0), "  0 %", "░░░░"),
            (Some(0.5), " 50 %", "██░░"),
            (Some(1.0), "100 %", "████"),
            (Some(12.0), "1e3 %", "████"),
            (None, "  – %", "–   "),
        ] {
            assert_eq!(percent(share), text);
            assert_eq!(bar(share, 4), cells);
        }
    }

    #[test]
    fn clock_counts_hours() {
        assert_eq!(clock(Some(59_999_999.0)), "00:00:59");
        assert_eq!(clock(Some(3_723_000_000.0)), "01:02:03");
        assert_eq!(clock(Some(359_999_000_000.0)), "99:59:59");
        assert_eq!(clock(Some(360_000_000_000.0)), "  4d 04h");
        assert_eq!(clock(Some(1e300)), "       –");
        assert_eq!(clock(Some(-1.0)), "       –");
        assert_eq!(clock(None), "       –");
    }
}
