//! Node whose inputs are recorded.

use crate::input::{Call, Input, InputSink};
use crate::recorded_bus::RecordedBus;
use crate::recorded_remote::RecordedRemote;
use bus::Bus;
use canopen::master::event::Event;
use config::Config;
use config::facts::Facts;
use node::cause::{Cause, ResetReason};
use node::proof_test::ProofTestReport;
use node::record::{Mode, Record};
use node::{BringUpError, Node, PowerOffError, Request, RequestError};
use remote::Remote;
use units::time::Instant;

/// Wrapped node.
type Inner<B, R, S> = Node<RecordedBus<B, S>, RecordedRemote<R, S>>;

/// [`Node`] whose inputs are sent to `S`. Every call that changes the node passes through here.
#[derive(Clone, Debug)]
pub struct RecordedNode<B, R, S = ()> {
    node: Inner<B, R, S>,
    sink: S,
}

impl<B: Bus, R: Remote, S: InputSink + Clone> RecordedNode<B, R, S> {
    /// As [`Node::new`].
    pub fn new(config: &Config, bus: B, remote: R, sink: S) -> Self {
        sink.on_input(Input::Call(Call::New));
        let bus = RecordedBus::new(bus, sink.clone());
        let node = Node::new(config, bus, RecordedRemote::new(remote, sink.clone()));
        let mut node = Self { node, sink };
        node.returned();
        node
    }

    /// As [`Node::bring_up`].
    ///
    /// # Errors
    /// As [`Node::bring_up`].
    pub fn bring_up(&mut self, give_up: &mut dyn FnMut() -> bool) -> Result<(), BringUpError> {
        self.recorded(Call::BringUp, give_up, |node, give_up| node.bring_up(give_up))
    }

    /// As [`Node::bring_up_unpowered`], with the cause that awaits a reset.
    ///
    /// # Errors
    /// As [`Node::bring_up_unpowered`].
    pub fn bring_up_unpowered(
        &mut self,
        reason: ResetReason,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<(), BringUpError> {
        let cause = Cause::AwaitsReset { reason };
        let call = Call::BringUpUnpowered(reason);
        self.recorded(call, give_up, |node, give_up| node.bring_up_unpowered(cause, give_up))
    }

    /// As [`Node::request`].
    ///
    /// # Errors
    /// As [`Node::request`].
    pub fn request(
        &mut self,
        request: Request,
        give_up: &mut dyn FnMut() -> bool,
    ) -> Result<Mode, RequestError> {
        let call = Call::Request(request);
        self.recorded(call, give_up, |node, give_up| node.request(request, give_up))
    }

    /// As [`Node::cycle`].
    pub fn cycle(&mut self) -> Record {
        self.called(Call::Cycle);
        let record = self.node.cycle();
        self.returned();
        record
    }

    /// As [`Node::shut_down`].
    ///
    /// # Errors
    /// As [`Node::shut_down`].
    pub fn shut_down(&mut self, is_urgent: &mut dyn FnMut() -> bool) -> Result<(), PowerOffError> {
        self.recorded(Call::Stop, is_urgent, |node, is_urgent| node.shut_down(is_urgent))
    }

    /// Records a call of the node, its return, and the answers of its owner.
    fn recorded<T>(
        &mut self,
        call: Call,
        answer: &mut dyn FnMut() -> bool,
        of_node: impl FnOnce(&mut Inner<B, R, S>, &mut dyn FnMut() -> bool) -> T,
    ) -> T {
        self.called(call);
        let sink = self.sink.clone();
        let result = of_node(&mut self.node, &mut || {
            let answer = answer();
            sink.on_input(Input::Polled(answer));
            answer
        });
        self.returned();
        result
    }

    /// Records that a call has begun.
    fn called(&self, call: Call) {
        if self.sink.is_recording() {
            self.sink.on_input(Input::Call(call));
        }
    }

    /// Records that a call has returned, with the checksum of its frames.
    fn returned(&mut self) {
        if self.sink.is_recording() {
            let sent = self.node.bus_mut().take_sent();
            self.sink.on_input(Input::Returned(sent.value()));
        }
    }

    /// As [`Node::next_event`].
    pub fn next_event(&mut self) -> Option<Event> {
        self.node.next_event()
    }

    /// As [`Node::mode`].
    pub const fn mode(&self) -> Mode {
        self.node.mode()
    }

    /// As [`Node::cause`].
    pub const fn cause(&self) -> Option<Cause> {
        self.node.cause()
    }

    /// As [`Node::with_names`].
    pub fn with_names(&self, error: &impl ToString) -> String {
        self.node.with_names(error)
    }

    /// As [`Node::in_words`].
    pub fn in_words(&self, cause: Cause) -> String {
        self.node.in_words(cause)
    }

    /// As [`Node::is_off`].
    pub fn is_off(&self) -> bool {
        self.node.is_off()
    }

    /// As [`Node::proof_test_report`].
    pub const fn proof_test_report(&self) -> &ProofTestReport {
        self.node.proof_test_report()
    }

    /// As [`Node::facts`].
    pub fn facts(&self) -> &[Facts] {
        self.node.facts()
    }

    /// As [`Node::unverified_posture`].
    pub fn unverified_posture(&self) -> Vec<String> {
        self.node.unverified_posture()
    }

    /// Returns the bus. Its answers to callers other than the node are not recorded.
    pub const fn bus(&self) -> &B {
        &self.node.bus().bus
    }

    /// Returns the bus, for changes that no replay sees.
    pub const fn bus_mut(&mut self) -> &mut B {
        &mut self.node.bus_mut().bus
    }

    /// Returns the commanded side itself.
    pub const fn remote(&self) -> &R {
        &self.node.remote().remote
    }

    /// Returns the commanded side itself, for changes that no replay sees.
    pub const fn remote_mut(&mut self) -> &mut R {
        &mut self.node.remote_mut().remote
    }
}

impl<B: Bus, R: Remote, S: InputSink> RecordedNode<B, R, S> {
    /// Reads the clock of the bus for the owner, without recording it.
    pub fn now(&self) -> Instant {
        self.node.bus().bus.now()
    }
}
