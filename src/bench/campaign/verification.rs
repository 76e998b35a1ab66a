//! Replay of a case, played from its own boot, from the recorded inputs of its node.
//!
//! Cases continue clones of warm benches (ADR 15). The verdict on a case from its own boot must be that on the clone. The
//! replayed node must send every frame again, and compute every intermediate of the control law.

use std::cell::RefCell;
use std::io::{self, Cursor};
use std::rc::Rc;

use serde::Serialize;

use crate::verdict::Verdict;
use config::Config;
use inputs::intermediates::Digest;
use inputs::{Input, InputSink, InputWriter};
use node::record::Record;
use replay::{End, Outcome, Replay};

/// Result of a replayed case.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Verification {
    /// Number of the case.
    pub case: u32,
    /// Number of cycles since the boot.
    pub cycles: u64,
    /// Number of frames sent by the node.
    pub frames: u64,
    /// First difference to the recording, in words.
    pub difference: Option<String>,
}

/// Recorded inputs of a node, in memory; the clones are one recording.
#[derive(Clone, Debug)]
pub(super) struct Recording(Rc<RefCell<io::Result<InputWriter<Vec<u8>>>>>);

impl Recording {
    pub(super) fn new() -> Self {
        Self(Rc::new(RefCell::new(InputWriter::begin(Vec::new()))))
    }

    /// Records the digest of a cycle's control law, which a replay compares.
    pub(super) fn on_cycle(&self, record: &Record) {
        self.on_input(Input::Intermediates(record.cycle, Digest::from_output(&record.output)));
    }

    /// Replays the recording, and compares the verdict of its case with that of the clone.
    pub(super) fn verify(
        &self,
        config: &Config,
        on_clone: &Verdict,
        from_boot: &Verdict,
    ) -> Verification {
        let number = on_clone.number;
        let mut result = Verification { case: number, cycles: 0, frames: 0, difference: None };
        if on_clone != from_boot {
            let [clone, boot] = [on_clone, from_boot].map(|of| (of.outcome, &of.observed));
            let reason = format!("from its own boot it is {boot:?}, on a clone it was {clone:?}");
            result.difference = Some(reason);
            return result;
        }
        match self.started(config) {
            Err(reason) => result.difference = Some(reason),
            Ok(mut replay) => {
                while replay.outcome().end.is_none() {
                    replay.step();
                }
                let outcome = replay.outcome();
                (result.cycles, result.frames) = (outcome.cycles, outcome.frames);
                result.difference = difference(outcome);
            }
        }
        result
    }

    fn started(&self, config: &Config) -> Result<Replay, String> {
        let written = self.0.replace(InputWriter::begin(Vec::new()));
        let inputs = written.map_err(|error| error.to_string())?.into_inner();
        let replay = Replay::of_inputs(config, Cursor::new(inputs));
        replay.map_err(|error| error.to_string())?.ok_or_else(|| "nothing recorded".to_owned())
    }
}

/// Returns the findings of the replay of a complete recording.
fn difference(outcome: &Outcome) -> Option<String> {
    let law = outcome.intermediate.map(|(cycle, name)| format!("{name} differs in cycle {cycle}"));
    let end = match &outcome.end {
        None | Some(End::Complete) => None,
        Some(end) => Some(end.to_string()),
    };
    end.or(law)
}

impl InputSink for Recording {
    fn is_recording(&self) -> bool {
        true
    }

    /// Ends the recording with the first failed write.
    fn on_input(&self, input: Input) {
        let mut written = self.0.borrow_mut();
        let failed = written.as_mut().ok().and_then(|to| to.write(&input).err());
        if let Some(error) = failed {
            *written = Err(error);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::case::Case;
    use crate::monitor::Monitor;
    use crate::play;
    use crate::stage::{self, Stage};

    #[test]
    fn case_replayed_with_another_configuration_is_a_difference() {
        let configs = ["config/kraft_like.toml", "config/kraft_like_500hz.toml"];
        let [config, other] = configs.map(|file| Config::load(Path::new(file)).unwrap());
        let case = Case::draw(7, 1, std::slice::from_ref(&config)).unwrap();
        let recorded = || {
            let recording = Recording::new();
            let (situation, quirk) = (case.situation, case.injection.quirk);
            let stage = Stage { config: &config, situation, seed: 7, quirk };
            let on_cycle = &mut |_: &mut _, record: &_| recording.on_cycle(record);
            let sink = recording.clone();
            let bench = stage::bring_to(stage, Monitor::new(&config), sink, on_cycle);
            let verdict = play::play(&mut bench.unwrap(), &config, &case, on_cycle).unwrap();
            (recording, verdict)
        };
        let (recording, verdict) = recorded();
        let verified = recording.verify(&config, &verdict, &verdict);
        assert_eq!(verified.difference, None);
        assert!(verified.frames > 1_000, "{verified:?}");
        let (recording, _) = recorded();
        assert!(recording.verify(&other, &verdict, &verdict).difference.is_some());
        let another = Verdict { hazard: verdict.hazard + 1, ..verdict.clone() };
        assert!(recording.verify(&config, &verdict, &another).difference.is_some());
    }
}
