//! Findings of the stability check of the gains, as text.

use std::cmp::Reverse;

use config::Config;
use controller::stability::finding::{Finding, Verdict};

/// Maximum length of a line on a terminal, with its level and "gains: " in front.
const MAX_LINE: usize = 120;

/// Characters in front of a line of the log: its level and "gains: ".
const PREFIX: usize = 13;

/// Logs one short warning for all inequalities that refuse. `-v` logs each that does not hold; those that warn are accepted by
/// design.
pub fn log(config: &Config) {
    let findings = config.findings();
    if let Some(line) = summary(&findings) {
        tracing::warn!("gains: {line}");
    }
    for (verdict, line) in lines(&findings) {
        if verdict != Verdict::Holds {
            tracing::debug!("gains: {verdict} {line}");
        }
    }
}

/// Returns the names of the inequalities that refuse, each with its number of axes, as far as they fit one line.
fn summary(findings: &[Finding]) -> Option<String> {
    const ROOM: usize = MAX_LINE - PREFIX;
    let groups = groups(findings);
    let alike =
        groups.iter().filter(|group| group.iter().all(|one| one.verdict == Verdict::Refuses));
    let names: Vec<String> = alike.filter_map(|group| counted(group)).collect();
    let line = |shown: usize| {
        let listed = names.get(..shown).unwrap_or_default().join("; ");
        let more = names.len().saturating_sub(shown);
        let more = if more == 0 { String::new() } else { format!("; {more} more") };
        format!("frhc check refuses: {listed}{more}")
    };
    let fits = |shown: &usize| line(*shown).chars().count() <= ROOM;
    (1..=names.len()).rev().find(fits).map(line)
}

/// Returns the name of an inequality and the number of its axes.
fn counted(group: &[&Finding]) -> Option<String> {
    let axes = group.len();
    let plural = if axes == 1 { "axis" } else { "axes" };
    group.first().map(|first| format!("{} ({axes} {plural})", first.name))
}

/// Returns the findings as lines, the worst verdict first. An inequality with the same verdict on several axes gets one
/// line, for the axis with the smallest margin, which names the other axes.
pub(super) fn lines(findings: &[Finding]) -> Vec<(Verdict, String)> {
    let mut lines: Vec<_> = groups(findings).iter().filter_map(|group| line(group)).collect();
    lines.sort_by_key(|(verdict, _)| Reverse(*verdict));
    lines
}

/// Returns the findings in groups of one name and verdict.
fn groups(findings: &[Finding]) -> Vec<Vec<&Finding>> {
    let mut groups: Vec<Vec<&Finding>> = Vec::new();
    for finding in findings {
        let is_alike =
            |other: &&Finding| (other.name, other.verdict) == (finding.name, finding.verdict);
        match groups.iter_mut().find(|group| group.first().is_some_and(is_alike)) {
            Some(group) => group.push(finding),
            None => groups.push(vec![finding]),
        }
    }
    groups
}

fn line(group: &[&Finding]) -> Option<(Verdict, String)> {
    let tightest = group.iter().max_by(|a, b| a.share().total_cmp(&b.share()))?;
    let others = group.iter().map(|finding| finding.axis).filter(|axis| *axis != tightest.axis);
    let others: Vec<&str> = others.collect();
    let also =
        if others.is_empty() { String::new() } else { format!(" (also {})", others.join(", ")) };
    Some((tightest.verdict, format!("{tightest}{also}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use controller::stability::finding::{Culprit, Side};

    fn finding(axis: &'static str, left: f64, verdict: Verdict) -> Finding {
        let side = |symbols: &str, value| Side { symbols: symbols.to_owned(), value, unit: "N" };
        Finding {
            name: "damping",
            axis,
            left: side("l", left),
            right: side("r", 2.0),
            verdict,
            reason: "why".to_owned(),
            culprit: Culprit::Damping,
        }
    }

    #[test]
    fn equal_verdicts_share_a_line_and_the_worst_is_first() {
        let findings = [
            finding("x", 1.0, Verdict::Holds),
            finding("y", 3.0, Verdict::Warns),
            finding("z", 1.5, Verdict::Holds),
        ];
        let lines: Vec<String> = lines(&findings).into_iter().map(|(_, line)| line).collect();
        assert_eq!(
            lines,
            [
                "damping, y: l = 3.00 N must stay below r = 2.00 N; why",
                "damping, z: l = 1.50 N must stay below r = 2.00 N (also x)",
            ]
        );
    }

    #[test]
    fn warning_at_start_counts_axes_in_one_line() {
        let findings = [
            finding("x", 3.0, Verdict::Refuses),
            finding("y", 3.0, Verdict::Refuses),
            finding("z", 1.0, Verdict::Holds),
        ];
        let line = summary(&findings);
        assert_eq!(line.as_deref(), Some("frhc check refuses: damping (2 axes)"));
        assert_eq!(summary(&findings[2..]), None);
    }

    #[test]
    fn warning_at_start_never_exceeds_its_line() {
        let names = [
            "damping",
            "return to centre, plateau",
            "pose reflection, quantum",
            "rate reflection, held",
            "accommodation, servo",
        ];
        let findings = names.map(|name| Finding { name, ..finding("x", 3.0, Verdict::Refuses) });
        let line = summary(&findings).unwrap();
        assert!(line.ends_with("; 3 more"), "{line}");
        assert!(line.chars().count() + PREFIX <= MAX_LINE, "{line}");
    }

    #[test]
    fn json_has_every_axis_and_null_for_infinity() {
        let finding = finding("x", f64::INFINITY, Verdict::Refuses);
        let objects = serde_json::to_value([finding]).unwrap();
        let expected = serde_json::json!([{
            "name": "damping",
            "axis": "x",
            "verdict": "refuses",
            "left": { "symbols": "l", "value": null, "unit": "N" },
            "right": { "symbols": "r", "value": 2.0, "unit": "N" },
            "reason": "why",
        }]);
        assert_eq!(objects, expected);
    }
}
