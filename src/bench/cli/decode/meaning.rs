//! Meaning of a line of a log, for text and JSON.

use ::replay::recorder_line::RecorderLine;
use canopen_tools::decode::Annotation;
use canopen_tools::decode::error_frame::ErrorFrame;

/// Meaning of a line.
pub(super) enum Meaning<'d> {
    /// A CANopen frame.
    Frame(Annotation<'d>),
    /// A line of the session recorder.
    RecorderLine(RecorderLine),
    /// An error frame of the CAN controller.
    Error(ErrorFrame),
    /// A frame that is not CANopen, with the reason.
    Other(&'static str),
}
