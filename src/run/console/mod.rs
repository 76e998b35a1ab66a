//! Control socket of a running node. Requests and responses are JSON objects, one per line.
//!
//! Requests are `{"ask":"status"}`, `{"ask":"arm"}`, `{"ask":"disarm"}`, `{"ask":"reset"}`, `{"ask":"mode rate"}`,
//! `{"ask":"mode pose"}`, `{"ask":"scale motion 0.5"}`, `{"ask":"lock rz on"}`, `{"ask":"align"}`, `{"ask":"park"}`,
//! `{"ask":"zero"}`, `{"ask":"zero 3"}` for joint 3, and `{"ask":"try 3 250"}` for a trial of its drive within 250 ‰ of its
//! capacity. Responses are `{"ok":true,…}` or `{"ok":false,"error":"…"}`. A disarm is answered with `ok` once no drive may push.
//!
//! | file              | content                                                         |
//! |-------------------|-----------------------------------------------------------------|
//! | `mod`             | the protocol                                                    |
//! | `socket`          | path and permissions of the socket, replacement of a stale one  |
//! | `clients`         | one task per client, their maximum number and their timeouts    |
//! | `request_handler` | execution of a client's request                                 |
//! | `journal`         | log of requests, and the remark on the status                   |
//! | `disarm_response` | response to a disarm, by the drives' torques                    |
//! | `request_queue`   | queue of requests to the cycle; disarm precedes all others      |

mod clients;
mod disarm_response;
mod journal;
mod request_handler;
pub mod request_queue;
mod socket;

pub(super) use request_handler::RequestHandler;
pub(super) use socket::{Socket, default_socket, default_sockets};

use derive_more::Display;
use serde::{Deserialize, Serialize};

use node::record::Mode;
use node::trial::TrialRequest;
use telemetry::status::Status;
use units::adjustment::Adjustment;
use units::numbering::Joint;

/// Requests of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Display, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub(super) enum ConsoleCommand {
    #[display("status")]
    Status,
    #[display("arm")]
    Arm,
    #[display("disarm")]
    Disarm,
    #[display("reset")]
    Reset,
    #[display("mode rate")]
    Rate,
    #[display("mode pose")]
    Pose,
    #[display("zero{}", _0.map(|joint| format!(" {joint}")).unwrap_or_default())]
    Zero(Option<Joint>),
    #[display("park")]
    Park,
    /// Trial of a drive within a bound, in ‰ of its capacity.
    #[display("try {} {}", _0.joint, _0.share)]
    Try(TrialRequest),
    #[display("{_0}")]
    Adjust(Adjustment),
}

impl TryFrom<String> for ConsoleCommand {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let zeros = [None].into_iter().chain(Joint::ALL.map(Some)).map(Self::Zero);
        if let Some(command) = zeros.into_iter().find(|command| command.to_string() == text) {
            return Ok(command);
        }
        if let Some(trial) = trial(&text) {
            return Ok(Self::Try(trial));
        }
        let known = [
            Self::Status,
            Self::Arm,
            Self::Disarm,
            Self::Reset,
            Self::Rate,
            Self::Pose,
            Self::Zero(None),
            Self::Park,
        ];
        if let Some(command) = known.into_iter().find(|command| command.to_string() == text) {
            return Ok(command);
        }
        let adjustment = text.parse().map(Self::Adjust);
        adjustment.map_err(|invalid| {
            let known = known.map(|command| format!("{:?}", command.to_string())).join(", ");
            format!("unknown request; expected {known}, or else: {invalid}")
        })
    }
}

/// Returns the trial of `try 3 250`.
fn trial(text: &str) -> Option<TrialRequest> {
    let (joint, share) = text.strip_prefix("try ")?.split_once(' ')?;
    let joint = Joint::new(joint.parse::<u8>().ok()?)?;
    Some(TrialRequest { joint, share: share.parse().ok()? })
}

impl From<ConsoleCommand> for String {
    fn from(command: ConsoleCommand) -> Self {
        command.to_string()
    }
}

/// Line from a client.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object such as {\"ask\":\"status\"}")]
pub(super) struct RequestLine {
    pub(super) ask: ConsoleCommand,
}

/// Line to a client.
#[derive(Debug, Default, Serialize)]
struct Response {
    ok: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mode: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    status: Option<Status>,
    /// Joints that may push at zero target torque, after a disarm.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    may_push: Vec<u8>,
    /// Remark on the status, such as the reason why the last reset failed; cause of a stop, after a disarm.
    #[serde(skip_serializing_if = "Option::is_none")]
    note: Option<String>,
}

impl Response {
    fn refused(reason: &impl ToString) -> Self {
        Self { ok: false, error: Some(reason.to_string()), ..Self::default() }
    }

    fn granted(mode: Mode) -> Self {
        Self { ok: true, mode: Some(mode.name()), ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn request_lines_are_those_of_the_protocol_only() {
        let names = [
            "status",
            "arm",
            "disarm",
            "reset",
            "mode rate",
            "mode pose",
            "zero",
            "zero 3",
            "park",
            "try 3 250",
        ];
        let asks = [
            ConsoleCommand::Status,
            ConsoleCommand::Arm,
            ConsoleCommand::Disarm,
            ConsoleCommand::Reset,
            ConsoleCommand::Rate,
            ConsoleCommand::Pose,
            ConsoleCommand::Zero(None),
            ConsoleCommand::Zero(Some(Joint::of::<3>())),
            ConsoleCommand::Park,
            ConsoleCommand::Try(TrialRequest { joint: Joint::of::<3>(), share: 250 }),
        ];
        for (name, ask) in names.into_iter().zip(asks) {
            let line = format!("{{\"ask\":\"{name}\"}}");
            assert_eq!(serde_json::from_str::<RequestLine>(&line).unwrap().ask, ask);
            assert_eq!(serde_json::to_string(&RequestLine { ask }).unwrap(), line);
        }
        for line in [
            "{\"ask\":\"Arm\"}",
            "{\"ask\":\"zero 7\"}",
            "{\"ask\":\"try 7 250\"}",
            "{\"ask\":\"try 3 -1\"}",
            "{\"ask\":\"try 3\"}",
            "{\"ask\":\"arm\",\"force\":true}",
            "{}",
            "\"arm\"",
        ] {
            assert!(serde_json::from_str::<RequestLine>(line).is_err(), "{line}");
        }
    }

    #[test]
    fn responses_have_the_mode_or_the_reason_of_a_refusal() {
        let text = |answer: &Response| serde_json::to_string(answer).unwrap();
        assert_eq!(text(&Response::granted(Mode::Armed)), r#"{"ok":true,"mode":"armed"}"#);
        assert_eq!(text(&Response::refused(&"no")), r#"{"ok":false,"error":"no"}"#);
    }
}
