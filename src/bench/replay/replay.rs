//! Replay of a session: runs its node with the recorded inputs, and compares the frames.

use std::collections::VecDeque;
use std::io::BufRead;

use crate::input_parts::InputParts;
use crate::outcome::{Difference, End, Outcome, Place};
use crate::reader::ReadError;
use crate::replayed_bus::ReplayedBus;
use crate::replayed_remote::ReplayedRemote;
use crate::source::{InputEnd, Source, answer};
use canopen::frame::Telegram;
use config::Config;
use controller::Output;
use inputs::{Call, Input};
use node::Node;
use node::cause::Cause;
use node::record::Record;
use units::time::Instant;

/// Node that runs with recorded inputs, call by call.
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
}

/// Maximum number of cycles by which a digest comes behind its cycle.
const MAX_OUTPUTS: usize = 4_096;

impl Replay {
    /// Starts a node with this configuration on recorded inputs; `None` if its start was not recorded.
    ///
    /// # Errors
    /// Returns an error if the data are no inputs, or those of another version.
    pub fn of_inputs(
        config: &Config,
        inputs: impl BufRead + 'static,
    ) -> Result<Option<Self>, ReadError> {
        Ok(Self::new(config, Source::new(InputParts::of_one(inputs)?), true))
    }

    /// Starts the node of a session; `None` if its start was not recorded.
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
        };
        replay.compare(Place { call: Some(Call::New), cycle: 0 }, None);
        Some(replay)
    }

    /// Replays the next call. Returns the record of a cycle; `None` for any other call, and at the end.
    pub fn step(&mut self) -> Option<Record> {
        self.sent.clear();
        if self.outcome.end.is_some() {
            return None;
        }
        let Some(call) = self.source.call() else {
            self.end(Place { call: None, cycle: self.outcome.last_cycle });
            return None;
        };
        let source = self.source.clone();
        let mut answer = || {
            let answer =
                source.take("asks whether to end", answer!(Input::Polled(answer) => *answer));
            // Without an answer the call comes to its end.
            answer.unwrap_or(true)
        };
        // Only the frames and intermediates that follow from results are compared.
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
            Call::Stop => self.node.shut_down(&mut answer).map_or(None, |()| None),
        };
        while self.node.next_event().is_some() {}
        let cycle = record.as_ref().map_or(self.outcome.last_cycle, |record| record.cycle);
        self.compare(Place { call: Some(call), cycle }, record.as_ref());
        record.filter(|_| self.outcome.end.is_none())
    }

    /// Returns the frames that the last call has sent, and the clock then.
    pub fn sent(&self) -> &[(Instant, Telegram)] {
        &self.sent
    }

    /// Returns the result so far.
    pub const fn outcome(&self) -> &Outcome {
        &self.outcome
    }

    /// Compares the frames of a call that has returned, and the intermediates of a cycle.
    fn compare(&mut self, place: Place, record: Option<&Record>) {
        let (sent, checksum) = self.node.bus_mut().take_sent();
        self.sent = sent;
        self.outputs.extend(record.map(|record| (record.cycle, record.output)));
        let returned = self.source.take("returns", answer!(Input::Returned(sent) => *sent));
        let Some(recorded) = returned else { return self.end(place) };
        self.compare_intermediates();
        if self.is_compared && recorded != checksum.value() {
            return self.differs(place, None);
        }
        self.outcome.last_cycle = place.cycle;
        self.outcome.cycles += u64::from(place.call == Some(Call::Cycle));
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

    fn differs(&mut self, place: Place, misstep: Option<String>) {
        self.source.read_digests();
        self.compare_intermediates();
        self.outcome.end = Some(End::Differs(Difference { place, misstep }));
    }

    /// Ends because there are no more inputs.
    fn end(&mut self, place: Place) {
        self.outcome.end = Some(match self.source.take_end() {
            None | Some(InputEnd::Complete) => End::Complete,
            Some(InputEnd::Cut) => End::Cut(place),
            Some(InputEnd::Lost(inputs)) => End::Lost(place, inputs),
            Some(InputEnd::Unreadable(error)) => End::Unreadable(place, error),
            Some(InputEnd::Other(misstep)) => {
                return self.differs(place, Some(misstep.to_string()));
            }
        });
    }
}
