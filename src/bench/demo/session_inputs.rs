//! Inputs of a simulated node, recorded in its session.

use std::cell::RefCell;

use inputs::{Input, InputSink};
use run::run_recorder::RunRecorder;

/// Sink that records the inputs of the node in its session, if recorded.
#[derive(Clone, Copy, Debug)]
pub struct SessionInputs<'a, 'r>(pub &'a RefCell<&'r mut RunRecorder>);

impl InputSink for SessionInputs<'_, '_> {
    fn is_recording(&self) -> bool {
        self.0.borrow().has_session()
    }

    fn on_input(&self, input: Input) {
        self.0.borrow_mut().on_input(&input);
    }
}
