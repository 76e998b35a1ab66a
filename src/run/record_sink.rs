//! The interface of recordings on disk: the session and the fault records implement it.

use canopen::frame::Telegram;
use inputs::Input;
use node::record::Record;
use units::time::Instant;

/// A recording on disk.
pub(super) trait RecordSink: Send + 'static {
    /// Records a frame that was sent or received `at` this time.
    fn on_frame(&mut self, at: Instant, telegram: &Telegram);
    /// Records a cycle.
    fn on_cycle(&mut self, record: &Record);
    /// Records an input of the node.
    fn on_input(&mut self, _input: &Input) {}
    /// Returns the next message to log: the place of a recording, or why one has failed.
    fn next_message(&mut self) -> Option<String>;
}
