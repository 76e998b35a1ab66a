//! Recorded inputs, returned one by one to the node.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::fmt;
use std::rc::Rc;

use crate::input_parts::{InputParts, PartError};
use inputs::intermediates::Digest;
use inputs::{Call, Input};

/// Maximum number of entries that are read on for digests: those of a hundred cycles.
const MAX_AHEAD: usize = 4_096;

/// Returns a function that picks the value of one kind of input.
macro_rules! answer {
    ($kind:pat $(if $is_one:expr)? => $value:expr) => {
        |input: &Input| if let $kind = input $(&& $is_one)? { Some($value) } else { None }
    };
}
pub(super) use answer;

/// Recorded inputs, shared by the bus, the commanded side and the owner of the node.
#[derive(Clone, Debug)]
pub(super) struct Source(Rc<RefCell<State>>);

#[derive(Debug)]
struct State {
    reader: InputParts,
    /// Next input, if already read.
    next: Option<Input>,
    /// Digests of cycles that were read between other inputs, in their order.
    digests: VecDeque<(u64, Digest)>,
    ended: Option<InputEnd>,
}

/// Reason for the end of the inputs.
#[derive(Debug)]
pub(super) enum InputEnd {
    /// All inputs were used.
    Complete,
    /// End of the recording inside of a call.
    Cut,
    /// Part whose rest cannot be read.
    Unreadable(PartError),
    /// Gap of this many inputs in the recording.
    Lost(u64),
    /// Request of the node for another input than the recorded one.
    Other(Misstep),
}

/// Step of a node that the recording does not answer.
#[derive(Debug)]
pub(super) struct Misstep {
    /// Step of the node.
    asked: &'static str,
    /// Step of the recorded one.
    recorded: &'static str,
}

impl fmt::Display for Misstep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the node {}, where the recorded one {}", self.asked, self.recorded)
    }
}

impl Source {
    pub(super) fn new(reader: InputParts) -> Self {
        Self(Rc::new(RefCell::new(State {
            reader,
            next: None,
            digests: VecDeque::new(),
            ended: None,
        })))
    }

    /// Returns the next call of the owner; `None` at the end.
    pub(super) fn call(&self) -> Option<Call> {
        let found = self.take("returns", answer!(Input::Call(call) => *call));
        let mut state = self.0.borrow_mut();
        if matches!(state.ended, Some(InputEnd::Cut)) {
            state.ended = Some(InputEnd::Complete);
        }
        found
    }

    /// Takes the next input if `pick` accepts it, and leaves it otherwise.
    pub(super) fn take_if_next<T>(&self, pick: impl Fn(&Input) -> Option<T>) -> Option<T> {
        let mut state = self.0.borrow_mut();
        state.look();
        let picked = state.next.as_ref().and_then(pick)?;
        state.next = None;
        Some(picked)
    }

    /// Takes the next input if `pick` accepts it; otherwise ends the inputs. `asked` describes the step of the node.
    pub(super) fn take<T>(
        &self,
        asked: &'static str,
        pick: impl Fn(&Input) -> Option<T>,
    ) -> Option<T> {
        let mut state = self.0.borrow_mut();
        state.look();
        let next = state.next.as_ref()?;
        let picked = pick(next);
        match picked {
            Some(_) => state.next = None,
            None => {
                let recorded = description(next);
                state.ended = Some(if let Input::Lost(inputs) = next {
                    InputEnd::Lost(*inputs)
                } else {
                    InputEnd::Other(Misstep { asked, recorded })
                });
                state.next = None;
            }
        }
        picked
    }

    /// Takes the digest of a cycle, if already read; drops those of earlier cycles.
    pub(super) fn take_digest(&self, cycle: u64) -> Option<Digest> {
        let mut state = self.0.borrow_mut();
        while let Some((of, digest)) = state.digests.front().copied().filter(|(of, _)| *of <= cycle)
        {
            state.digests.pop_front();
            if of == cycle {
                return Some(digest);
            }
        }
        None
    }

    /// Reads the digests that come behind the inputs of their cycles, at most `MAX_AHEAD` entries on.
    pub(super) fn read_digests(&self) {
        let mut state = self.0.borrow_mut();
        for _ in 0..MAX_AHEAD {
            match state.reader.read() {
                Ok(Some(Input::Intermediates(cycle, digest))) => {
                    state.digests.push_back((cycle, digest));
                }
                Ok(Some(_)) => {}
                Ok(None) | Err(_) => return,
            }
        }
    }

    /// Takes the reason of the end.
    pub(super) fn take_end(&self) -> Option<InputEnd> {
        self.0.borrow_mut().ended.take()
    }
}

impl State {
    /// Reads the next input, if none waits.
    fn look(&mut self) {
        while self.next.is_none() && self.ended.is_none() {
            match self.reader.read() {
                Ok(Some(Input::Intermediates(cycle, digest))) => {
                    self.digests.push_back((cycle, digest));
                }
                Ok(Some(input)) => self.next = Some(input),
                Ok(None) => self.ended = Some(InputEnd::Cut),
                Err(error) if self.reader.is_cut(&error) => self.ended = Some(InputEnd::Cut),
                Err(error) => self.ended = Some(InputEnd::Unreadable(error)),
            }
        }
    }
}

/// Returns what the recorded node did to get this input.
const fn description(input: &Input) -> &'static str {
    match input {
        Input::Call(_) => "was called",
        Input::Returned(_) => "returned",
        Input::Intermediates(..) => "has intermediates",
        Input::Now(_) => "read the clock",
        Input::Wall(_) => "read the wall clock",
        Input::Suspended(_) => "asked for the time of suspension",
        Input::Confirmed(..) => "asked for a transmit confirmation",
        Input::NotSent(..) => "sent a frame that was not accepted",
        Input::Woken(_) => "waited for a frame",
        Input::Reopened(_) => "opened its buses again",
        Input::Sensed(_) => "exchanged a command for a sample",
        Input::SideError(_) => "asked for a fault of the commanded side",
        Input::Misfits(_) => "asked whether the commanded side fits",
        Input::Polled(_) => "asked whether to end",
        Input::Lost(_) => "has a gap",
    }
}
