//! Steps of a transfer: a protocol returns them, [`Transfer`](crate::sdo::Transfer) adds the timing.

use canopen_rs::sdo::SdoPayload;

use crate::abort::AbortCode;
use crate::sdo::content::Content;

/// Consequence of a reply.
#[derive(Clone, Debug)]
pub(super) enum Step {
    /// Ignores the frame, which does not answer the request.
    Pass,
    /// Waits: more segments follow.
    Wait,
    /// Sends the next request.
    Send(SdoPayload),
    /// Repeats a request without extending the deadline.
    Repeat(SdoPayload),
    /// Sends segments at their interval.
    Stream,
    /// Switches to the segmented protocol, to which the reply belongs.
    Switch,
    /// Ends the transfer.
    Done(Content),
    /// Ends the transfer with a last frame to the server.
    Confirm(SdoPayload, Content),
    /// Aborts the transfer.
    Abort(AbortCode),
}

impl From<Result<Self, AbortCode>> for Step {
    fn from(step: Result<Self, AbortCode>) -> Self {
        step.unwrap_or_else(Self::Abort)
    }
}
