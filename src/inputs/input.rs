//! Inputs of a node, and the interface of their destination.

use std::rc::Rc;
use std::time::Duration;

use crate::intermediates::Digest;
use bus::{ReopenError, SendError, Wake};
use canopen::frame::Channel;
use node::Request;
use node::cause::ResetReason;
use remote::{RemoteSample, SideError};
use units::time::Instant;

/// Call of a node by its owner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Call {
    /// [`Node::new`](node::Node::new).
    New,
    /// [`Node::bring_up`](node::Node::bring_up).
    BringUp,
    /// [`Node::bring_up_unpowered`](node::Node::bring_up_unpowered), which awaits a reset for this reason.
    BringUpUnpowered(ResetReason),
    /// [`Node::request`](node::Node::request).
    Request(Request),
    /// [`Node::cycle`](node::Node::cycle).
    Cycle,
    /// [`Node::shut_down`](node::Node::shut_down).
    Stop,
}

/// Input of a node: a call of its owner, or an answer to the node.
#[derive(Clone, Debug, PartialEq)]
pub enum Input {
    /// Start of a call.
    Call(Call),
    /// Return of the call, with the [checksum](crate::Checksum) of the frames that it has sent.
    Returned(u32),
    /// Digest of the control law in the cycle of this number. A replay is compared with the digest, which does not
    /// affect the node. It precedes or follows the inputs of its cycle by some cycles.
    Intermediates(u64, Digest),
    /// Clock of the bus.
    Now(Instant),
    /// Wall clock: UTC since 1970.
    Wall(Duration),
    /// Total time of host suspension.
    Suspended(Duration),
    /// Time of the last SYNC confirmed on the wire.
    Confirmed(Channel, Option<Instant>),
    /// Frame that the bus has not accepted, by its number within the call, from 1. All others were accepted.
    NotSent(u32, SendError),
    /// End of a wait.
    Woken(Wake),
    /// Answer of the buses to a reopening.
    Reopened(Result<(), ReopenError>),
    /// Answer of the commanded side to a command.
    Sensed(Option<RemoteSample>),
    /// Error of the commanded side.
    SideError(Option<SideError>),
    /// Reasons against arming with this commanded side, or the one against a change of the command mode, as text.
    Misfits(Vec<String>),
    /// Answer of the owner whether to end: in a boot, a reset's boot, or a stop.
    Polled(bool),
    /// Number of inputs lost because the recording was too slow.
    Lost(u64),
}

/// Destination of recorded inputs. Never waits.
pub trait InputSink {
    /// Returns whether inputs are recorded.
    fn is_recording(&self) -> bool;

    /// Records an input.
    fn on_input(&self, input: Input);

    /// Records an answer, if any are recorded, as the input that `input` makes of it, and returns the answer.
    fn record<T: Clone>(&self, answer: T, input: impl FnOnce(T) -> Input) -> T
    where
        Self: Sized,
    {
        if self.is_recording() {
            self.on_input(input(answer.clone()));
        }
        answer
    }
}

/// Records nothing.
impl InputSink for () {
    fn is_recording(&self) -> bool {
        false
    }

    fn on_input(&self, _: Input) {}
}

impl<S: InputSink> InputSink for Rc<S> {
    fn is_recording(&self) -> bool {
        S::is_recording(self)
    }

    fn on_input(&self, input: Input) {
        S::on_input(self, input);
    }
}
