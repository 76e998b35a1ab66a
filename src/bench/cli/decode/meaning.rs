//! Meaning of a line of a log, for text and JSON.

use ::replay::recorder_line::RecorderLine;
use canopen_tools::decode::Annotation;
use canopen_tools::decode::error_frame::ErrorFrame;

/// Meaning of a line.
pub(super) enum Meaning<'d> {
    /// CANopen frame.
    Frame(Annotation<'d>),
    /// Line of the session recorder.
    RecorderLine(RecorderLine),
    /// Error frame of the CAN controller.
    Error(ErrorFrame),
    /// Frame that is not CANopen, with the reason.
    Other(&'static str),
}
