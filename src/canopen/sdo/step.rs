//! What the parts of a transfer hand to the whole: they know the protocol, it knows the time.

use canopen_rs::sdo::SdoPayload;

use crate::abort::AbortCode;
use crate::sdo::content::Content;

/// What a reply leads to.
#[derive(Clone, Debug)]
pub(super) enum Step {
    /// It is no reply to what was asked.
    Pass,
    /// It belongs to the transfer; more follow by themselves.
    Wait,
    /// The next request.
    Send(SdoPayload),
    /// The same request again: nothing has been gained.
    Repeat(SdoPayload),
    /// Segments are to go out, each in its time.
    Stream,
    /// The server goes on by the other protocol, to which its reply belongs.
    Switch,
    /// It is over.
    Done(Content),
    /// It is over, and the server is told so.
    Confirm(SdoPayload, Content),
    /// It cannot go on.
    BreakOff(AbortCode),
}

impl From<Result<Self, AbortCode>> for Step {
    fn from(step: Result<Self, AbortCode>) -> Self {
        step.unwrap_or_else(Self::BreakOff)
    }
}
