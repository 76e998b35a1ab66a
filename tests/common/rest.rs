//! Rest postures in the text of a configuration.

/// Rest posture of the arm of `kraft_like`, in degrees.
pub(crate) const KRAFT_LIKE: [f64; 6] = [25.0, -50.0, 95.0, -45.0, -25.0, 25.0];

/// Returns the text with this rest posture, in degrees and metres, in place of that of each joint.
pub(crate) fn at_rest(text: &str, rest: [f64; 6]) -> String {
    let mut parts: Vec<String> = text.split("\n[[joint]]\n").map(str::to_owned).collect();
    for (part, rest) in parts.iter_mut().skip(1).zip(rest) {
        let line = part.lines().find(|line| line.starts_with("rest_")).unwrap().to_owned();
        let key = if line.starts_with("rest_deg") { "rest_deg" } else { "rest_m" };
        *part = part.replacen(&line, &format!("{key} = {rest}"), 1);
    }
    parts.join("\n[[joint]]\n")
}
