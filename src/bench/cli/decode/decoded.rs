//! A decoded line of a log, from which text and JSON are written.

use ::replay::recorder_line::RecorderLine;
use canopen_tools::decode::Annotation;
use canopen_tools::decode::error_frame::ErrorFrame;

/// Meaning of a line.
pub(super) enum Decoded<'d> {
    /// A CANopen frame.
    Frame(Annotation<'d>),
    /// A line of the session recorder.
    RecorderLine(RecorderLine),
    /// An error frame of the CAN controller.
    Error(ErrorFrame),
    /// A frame that is not CANopen: the reason.
    Other(&'static str),
}
