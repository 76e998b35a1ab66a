//! Text of the result of a replay.

use signals::{Findings, ReplayVerdict};

/// Returns the result of a replay as a sentence.
pub(crate) fn sentence(findings: &Findings) -> String {
    match &findings.verdict {
        Some(ReplayVerdict::Equal) => "The replay has sent every frame as recorded.".to_owned(),
        Some(ReplayVerdict::EndsEarly(reason)) => {
            format!("The replay has sent every frame as recorded, but it ends early: {reason}.")
        }
        Some(ReplayVerdict::Differs { cycle, difference }) => {
            format!(
                "The replay differs from cycle {cycle} on: {difference}. What only a replay has is left out from there."
            )
        }
        Some(ReplayVerdict::Missing(reason)) => format!("There is no replay: {reason}."),
        None => "The replay did not come to an end.".to_owned(),
    }
}

/// Returns the result in a few words.
pub(crate) fn short(findings: &Findings) -> &'static str {
    match &findings.verdict {
        Some(ReplayVerdict::Equal) => "equal, every frame",
        Some(ReplayVerdict::EndsEarly(_)) => "equal, but ends early",
        Some(ReplayVerdict::Differs { .. }) => "differs",
        Some(ReplayVerdict::Missing(_)) => "none",
        None => "not complete",
    }
}

/// Returns the reason why there are no values of a replay.
pub(crate) fn reason(findings: &Findings) -> String {
    match &findings.verdict {
        Some(ReplayVerdict::Missing(reason)) => reason.clone(),
        Some(ReplayVerdict::Differs { cycle, .. }) => format!("it differs from cycle {cycle} on"),
        Some(ReplayVerdict::EndsEarly(reason)) => reason.clone(),
        Some(ReplayVerdict::Equal) | None => "it has none of them".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_result_is_a_sentence() {
        let verdicts = [
            Some(ReplayVerdict::Equal),
            Some(ReplayVerdict::EndsEarly("cut".to_owned())),
            Some(ReplayVerdict::Differs { cycle: 7, difference: "other frames".to_owned() }),
            Some(ReplayVerdict::Missing("no inputs.bin".to_owned())),
            None,
        ];
        for verdict in verdicts {
            let findings = Findings { remarks: Vec::new(), verdict };
            let text = sentence(&findings);
            assert!(text.ends_with('.') && !text.ends_with(".."), "{text}");
            assert!(!short(&findings).is_empty() && !reason(&findings).is_empty());
        }
    }
}
