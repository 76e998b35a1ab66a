//! Kinds of zero in the text of a configuration.

use testbench::lost_zero::LostZero;

/// Returns the text with this kind of zero in each joint, and what the kind needs.
pub(crate) fn with_zero(text: &str, kind: &str) -> String {
    let kind = LostZero::ALL.into_iter().find(|one| one.key() == kind).unwrap();
    kind.set_in(text, |_| true).unwrap()
}

/// Returns the text with a second rest position in each joint, in degrees or metres.
pub(crate) fn with_second_rest(text: &str, second: [f64; 6]) -> String {
    let mut parts: Vec<String> = text.split("\n[[joint]]\n").map(str::to_owned).collect();
    for (part, second) in parts.iter_mut().skip(1).zip(second) {
        let unit = if part.contains("\nrest_m = ") { "m" } else { "deg" };
        *part = format!("second_rest_{unit} = {second}\n{part}");
    }
    parts.join("\n[[joint]]\n")
}
