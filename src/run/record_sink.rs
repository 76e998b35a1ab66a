//! Interface of recordings on disk, implemented by session and fault records.

use canopen::frame::Telegram;
use inputs::Input;
use node::record::Record;
use units::time::Instant;

/// Recording on disk.
pub(super) trait RecordSink: Send + 'static {
    /// Records a frame that was sent or received `at` this time.
    fn on_frame(&mut self, at: Instant, telegram: &Telegram);
    /// Records the end of a cycle.
    fn on_cycle(&mut self, record: &Record);
    /// Records an input of the node.
    fn on_input(&mut self, _input: &Input) {}
    /// Returns the next message to log: the path of a recording, or the reason of a failure.
    fn next_message(&mut self) -> Option<String>;
}
