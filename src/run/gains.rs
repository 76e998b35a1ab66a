//! Findings of the stability check of the gains, as text and JSON.

use std::cmp::Reverse;

use config::Config;
use controller::stability::finding::{Finding, Side, Verdict};

/// Logs a warning for each inequality that does not hold.
pub fn warn(config: &Config) {
    for (verdict, line) in lines(&config.findings()) {
        match verdict {
            Verdict::Holds => {}
            Verdict::Warns | Verdict::Refuses => tracing::warn!("gains: {line}"),
        }
    }
}

/// Returns the findings as lines, the worst verdict first. An inequality with the same verdict on several axes is one
/// line, for the axis with the least margin, which names the others.
pub(super) fn lines(findings: &[Finding]) -> Vec<(Verdict, String)> {
    let mut groups: Vec<Vec<&Finding>> = Vec::new();
    for finding in findings {
        let is_alike =
            |other: &&Finding| (other.name, other.verdict) == (finding.name, finding.verdict);
        match groups.iter_mut().find(|group| group.first().is_some_and(is_alike)) {
            Some(group) => group.push(finding),
            None => groups.push(vec![finding]),
        }
    }
    let mut lines: Vec<_> = groups.iter().filter_map(|group| line(group)).collect();
    lines.sort_by_key(|(verdict, _)| Reverse(*verdict));
    lines
}

fn line(group: &[&Finding]) -> Option<(Verdict, String)> {
    let tightest = group.iter().max_by(|a, b| a.share().total_cmp(&b.share()))?;
    let others = group.iter().map(|finding| finding.axis).filter(|axis| *axis != tightest.axis);
    let others: Vec<&str> = others.collect();
    let also =
        if others.is_empty() { String::new() } else { format!(" (also {})", others.join(", ")) };
    Some((tightest.verdict, format!("{tightest}{also}")))
}

/// Returns every finding as an object; an infinite side is null.
pub(super) fn json(findings: &[Finding]) -> serde_json::Value {
    findings.iter().map(object).collect()
}

fn object(finding: &Finding) -> serde_json::Value {
    let side = |side: &Side| serde_json::json!({ "symbols": side.symbols, "value": side.value, "unit": side.unit });
    serde_json::json!({
        "name": finding.name,
        "axis": finding.axis,
        "verdict": finding.verdict.to_string(),
        "left": side(&finding.left),
        "right": side(&finding.right),
        "reason": finding.reason,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use controller::stability::finding::Culprit;

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
    fn json_has_every_axis_and_null_for_infinity() {
        let objects = json(&[finding("x", f64::INFINITY, Verdict::Refuses)]);
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
