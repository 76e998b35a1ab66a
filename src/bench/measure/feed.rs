//! Positions of a running node, from its telemetry: this room sends the node nothing.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::Duration;

use serde::Deserialize;
use serde_json::Value;

use config::Config;
use controller::JointVector;
use run::exit::{Failure, Kind, OrFail};
use view::feed::{FeedReader, Kind as LineKind, News};

/// Time without a line after which the node is gone.
const SILENCE: Duration = Duration::from_secs(3);

/// Interval between two looks at the signals.
const LOOK: Duration = Duration::from_millis(100);

/// Modes without torque.
const WITHOUT_TORQUE: [&str; 4] = ["boot", "ready", "zero-torque", "drives-off"];

/// Positions of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Reading {
    /// Time, in s.
    pub at: f64,
    /// In rad or m.
    pub q: JointVector,
}

/// Reader of a node's positions.
#[derive(Debug)]
pub(crate) struct Feed {
    news: Receiver<News>,
    _reader: FeedReader,
    silent: Duration,
}

/// Snapshot, as far as it is needed.
#[derive(Debug, Deserialize)]
struct Snapshot {
    at_us: u64,
    mode: String,
    q: [Option<f64>; 6],
}

impl Feed {
    /// Connects to the first of these sockets on which a node listens.
    ///
    /// # Errors
    /// When the reader cannot be started (exit 4).
    pub(crate) fn connect(sockets: Vec<PathBuf>) -> Result<Self, Failure> {
        let (sender, news) = channel();
        let pass_on = move |one| _ = sender.send(one);
        let reader = FeedReader::start(sockets, pass_on).or_fail(Kind::System)?;
        Ok(Self { news, _reader: reader, silent: Duration::ZERO })
    }

    /// Waits a moment for the next positions; `None` without some.
    ///
    /// # Errors
    /// When there is no node (exit 4), it runs another configuration (exit 3), or it may exert torque or does not know a
    /// position (exit 1).
    pub(crate) fn next(&mut self, config: &Config) -> Result<Option<Reading>, Failure> {
        match self.news.recv_timeout(LOOK) {
            Ok(News::Line(line)) => {
                self.silent = Duration::ZERO;
                match line.kind {
                    LineKind::Description => described(&line.text, config).map(|()| None),
                    LineKind::Snapshot => reading(&line.text, config).map(Some),
                    LineKind::Mode | LineKind::Other => Ok(None),
                }
            }
            Ok(News::Absent(reason)) => Err(Failure::new(Kind::Bus, reason)),
            Err(RecvTimeoutError::Timeout) if self.silent < SILENCE => {
                self.silent += LOOK;
                Ok(None)
            }
            Err(_) => {
                Err(Failure::new(Kind::Bus, "the node sends no positions: is it hung, or booting?"))
            }
        }
    }
}

/// Checks that a description is that of the arm of this configuration.
fn described(text: &str, config: &Config) -> Result<(), Failure> {
    let line: Value = serde_json::from_str(text).or_fail(Kind::Bus)?;
    let joints = line.pointer("/hand/joints").and_then(Value::as_array).into_iter().flatten();
    let names: Vec<_> = joints.filter_map(|joint| joint.get("name")?.as_str()).collect();
    if names.iter().eq(config.joints.iter().map(|joint| &joint.name)) {
        return Ok(());
    }
    let reason = format!(
        "{}: the node runs another configuration, with the joints {}",
        config.file.display(),
        names.join(", ")
    );
    Err(Failure::new(Kind::Configuration, reason))
}

fn reading(text: &str, config: &Config) -> Result<Reading, Failure> {
    let Snapshot { at_us, mode, q } = serde_json::from_str(text).or_fail(Kind::Bus)?;
    if !WITHOUT_TORQUE.contains(&mode.as_str()) {
        let reason =
            format!("the node is {mode}: a hand turns the joints, so run `frhc ctl disarm` first");
        return Err(Failure::new(Kind::Negative, reason));
    }
    let known: Vec<_> = q.into_iter().flatten().collect();
    if known.len() < q.len() {
        let joints = config.joints.iter().zip(q).filter(|(_, position)| position.is_none());
        let names: Vec<_> = joints.map(|(joint, _)| joint.name.as_str()).collect();
        let reason =
            format!("zero unknown: {}; run `frhc ctl zero` first (docs/zero.md)", names.join(", "));
        return Err(Failure::new(Kind::Negative, reason));
    }
    let at = Duration::from_micros(at_us).as_secs_f64();
    Ok(Reading { at, q: JointVector::from_iterator(known) })
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;

    /// The lines that a node sends, as the tests of its telemetry hold them.
    #[test]
    fn lines_of_a_node_are_read() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).ancestors().nth(3).unwrap();
        let config = Config::load(&root.join("config/kraft_like.toml")).unwrap();
        let lines = fs::read_to_string(root.join("tests/golden/telemetry.jsonl")).unwrap();
        let of = |kind: &str| {
            lines.lines().find(|line| line.contains(&format!("\"kind\":\"{kind}\""))).unwrap()
        };
        described(of("description"), &config).unwrap();
        let engaged = of("snapshot");
        let refused = reading(engaged, &config).unwrap_err().to_string();
        assert!(refused.starts_with("the node is engaged: "), "{refused}");
        let ready = engaged.replace("\"mode\":\"engaged\"", "\"mode\":\"ready\"");
        let Reading { at, q } = reading(&ready, &config).unwrap();
        assert!((at - 7.419).abs() < 1e-9 && q.iter().all(|q| q.is_finite()), "{at} {q}");
    }
}
