//! Runs the node of a session with its recorded inputs, and compares what it sends.

use std::collections::VecDeque;
use std::fmt;

use crate::reader::ReadError;
use crate::replayed_bus::ReplayedBus;
use crate::replayed_remote::ReplayedRemote;
use crate::source::{Ended, Source, answer};
use canopen::frame::Telegram;
use config::Config;
use controller::Output;
use inputs::{Call, Input};
use node::Node;
use node::cause::Cause;
use node::record::Record;
use units::time::Instant;

/// A node that is run with recorded inputs, call by call.
#[derive(Debug)]
pub struct Replay {
    node: Node<ReplayedBus, ReplayedRemote>,
    source: Source,
    outcome: Outcome,
    /// Frames sent in the last call, and the clock then.
    sent: Vec<(Instant, Telegram)>,
    /// Cycles whose digests were not read yet, and their intermediates.
    outputs: VecDeque<(u64, Output)>,
    is_compared: bool,
    /// Number of the last cycle, as the node counts them: with those of its boots.
    cycle: u64,
}

/// Maximum number of cycles by which a digest comes behind its cycle.
const MAX_OUTPUTS: usize = 4_096;

/// Result of a replay so far.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Cycles whose frames were compared.
    pub cycles: u64,
    /// Frames that were compared.
    pub frames: u64,
    /// First cycle with another intermediate of the control law, and the name of the first that differs. The frames may
    /// be equal all the same.
    pub intermediate: Option<(u64, &'static str)>,
    /// Why the replay has ended; `None` while it goes on.
    pub end: Option<End>,
}

/// Reason why a replay has ended.
#[derive(Debug)]
pub enum End {
    /// All recorded calls were replayed.
    Complete,
    /// The recording ends inside of a call: what was recorded until then is equal.
    Cut,
    /// The recording has a gap of this many inputs.
    Lost(u64),
    /// The rest of the recording cannot be read.
    Unreadable(ReadError),
    /// The node sends other frames than the recorded one.
    Differs(Difference),
}

/// First call with other frames.
#[derive(Debug)]
pub struct Difference {
    /// The call.
    pub call: Call,
    /// Cycle before or in which it is, from 1; zero before the first.
    pub cycle: u64,
    /// Step of the node that the recorded one did not take; `None` if only frames differ.
    pub misstep: Option<String>,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let after = if self.call == Call::Cycle { "" } else { " after cycle" };
        write!(f, "{}{after} {}", name(self.call), self.cycle)?;
        match &self.misstep {
            Some(misstep) => write!(f, ": {misstep}"),
            None => f.write_str(": other frames are sent"),
        }
    }
}

/// Returns a call in words.
const fn name(call: Call) -> &'static str {
    match call {
        Call::New => "start",
        Call::BringUp | Call::BringUpUnpowered(_) => "boot",
        Call::Request(_) => "request",
        Call::Cycle => "cycle",
        Call::Stop => "stop",
    }
}

impl Replay {
    /// Starts the node of a session; `None` if not even its start was recorded.
    pub(super) fn new(config: &Config, source: Source, is_compared: bool) -> Option<Self> {
        let Some(Call::New) = source.call() else { return None };
        let bus = ReplayedBus::new(source.clone());
        let node = Node::new(config, bus, ReplayedRemote(source.clone()));
        let mut replay = Self {
            node,
            source,
            outcome: Outcome::default(),
            sent: Vec::new(),
            outputs: VecDeque::new(),
            is_compared,
            cycle: 0,
        };
        replay.compare(Call::New, None);
        Some(replay)
    }

    /// Replays the next call. Returns the record of a cycle; `None` for any other call, and at the end.
    pub fn step(&mut self) -> Option<Record> {
        self.sent.clear();
        if self.outcome.end.is_some() {
            return None;
        }
        let Some(call) = self.source.call() else {
            self.end(Call::Cycle);
            return None;
        };
        let source = self.source.clone();
        let mut answer = || {
            let answer =
                source.take("asks whether to end", answer!(Input::Polled(answer) => *answer));
            // Without an answer the call comes to its end.
            answer.unwrap_or(true)
        };
        // Results are not compared: what follows from them is.
        let record = match call {
            Call::New => None,
            Call::BringUp => self.node.bring_up(&mut answer).map_or(None, |()| None),
            Call::BringUpUnpowered(reason) => {
                let cause = Cause::AwaitsReset { reason };
                self.node.bring_up_unpowered(cause, &mut answer).map_or(None, |()| None)
            }
            Call::Request(request) => {
                self.node.request(request, &mut answer).map_or(None, |_| None)
            }
            Call::Cycle => Some(self.node.cycle()),
            Call::Stop => self.node.stop(&mut answer).map_or(None, |()| None),
        };
        while self.node.notice().is_some() {}
        self.cycle = record.as_ref().map_or(self.cycle, |record| record.cycle);
        self.compare(call, record.as_ref());
        record.filter(|_| self.outcome.end.is_none())
    }

    /// Returns the frames that the last call has sent, and the clock then.
    pub fn sent(&self) -> &[(Instant, Telegram)] {
        &self.sent
    }

    /// Returns the sample time of the newest sample of the commanded side, which the next cycle acts on.
    pub fn sampled_at(&self) -> Option<Instant> {
        self.source.sampled_at()
    }

    /// Returns the result so far.
    pub const fn outcome(&self) -> &Outcome {
        &self.outcome
    }

    /// Compares the frames of a call that has returned, and the intermediates of a cycle.
    fn compare(&mut self, call: Call, record: Option<&Record>) {
        let (sent, checksum) = self.node.bus_mut().take_sent();
        self.sent = sent;
        self.outputs.extend(record.map(|record| (record.cycle, record.output)));
        let returned = self.source.take("returns", answer!(Input::Returned(sent) => *sent));
        let Some(recorded) = returned else { return self.end(call) };
        self.compare_intermediates();
        if self.is_compared && recorded != checksum.value() {
            return self.differs(call, None);
        }
        self.outcome.cycles += u64::from(call == Call::Cycle);
        self.outcome.frames += u64::try_from(self.sent.len()).unwrap_or(u64::MAX);
    }

    /// Compares the cycles whose digests were read by now.
    fn compare_intermediates(&mut self) {
        while let Some((cycle, output)) = self.outputs.front() {
            let digest = self.source.take_digest(*cycle);
            let name = digest.and_then(|digest| digest.first_difference(output));
            if let (None, Some(name)) = (self.outcome.intermediate, name) {
                self.outcome.intermediate = Some((*cycle, name));
            }
            if digest.is_none() && self.outputs.len() < MAX_OUTPUTS {
                return;
            }
            self.outputs.pop_front();
        }
    }

    fn differs(&mut self, call: Call, misstep: Option<String>) {
        self.source.read_digests();
        self.compare_intermediates();
        let cycle = self.cycle;
        self.outcome.end = Some(End::Differs(Difference { call, cycle, misstep }));
    }

    /// Ends in a call, because there are no more inputs for it.
    fn end(&mut self, call: Call) {
        self.outcome.end = Some(match self.source.take_end() {
            None | Some(Ended::Complete) => End::Complete,
            Some(Ended::Cut) => End::Cut,
            Some(Ended::Lost(inputs)) => End::Lost(inputs),
            Some(Ended::Unreadable(error)) => End::Unreadable(error),
            Some(Ended::Other(misstep)) => return self.differs(call, Some(misstep.to_string())),
        });
    }
}
