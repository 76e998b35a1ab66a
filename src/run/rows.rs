//! Rows about joints: those of which the same is said share a row.

use units::wording::grouped;

/// Returns a line for each text, in their order: the label, the names of the joints that have it, and the text.
pub(crate) fn folded<'a>(
    label: &str,
    rows: impl IntoIterator<Item = (&'a str, String)>,
) -> Vec<String> {
    let groups = grouped(rows);
    let is_common = groups.len() == 1;
    let line = |(names, text): (Vec<&str>, String)| {
        let is_all = is_common && names.len() > 1;
        let names = if is_all { "all joints".to_owned() } else { names.join(", ") };
        format!("{label} {names:16} {text}")
    };
    groups.into_iter().map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::folded;

    fn lines(texts: [&str; 3]) -> Vec<String> {
        let rows = ["azimuth", "elbow", "roll"].into_iter().zip(texts);
        folded("stops", rows.map(|(name, text)| (name, text.to_owned())))
    }

    #[test]
    fn joints_of_which_the_same_is_said_share_a_row() {
        assert_eq!(lines(["5 ms"; 3]), ["stops all joints       5 ms"]);
        let expected = ["stops azimuth, roll    5 ms", "stops elbow            8 ms"];
        assert_eq!(lines(["5 ms", "8 ms", "5 ms"]), expected);
        assert_eq!(lines(["1", "2", "3"]).len(), 3);
    }

    #[test]
    fn only_joint_has_its_name() {
        let one = folded("stops", [("elbow", "5 ms".to_owned())]);
        assert_eq!(one, ["stops elbow            5 ms"]);
    }
}
