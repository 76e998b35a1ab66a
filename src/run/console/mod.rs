//! The control socket of a running node: one JSON object a line in, one a line out.
//!
//! `{"ask":"status"}`, `{"ask":"arm"}`, `{"ask":"disarm"}`, `{"ask":"reset"}`, `{"ask":"mode rate"}`,
//! `{"ask":"mode pose"}`; answered by `{"ok":true,…}` or `{"ok":false,"error":"…"}`.
//!
//! | file       | what                                                              |
//! |------------|-------------------------------------------------------------------|
//! | `mod`      | the protocol                                                      |
//! | `socket`   | the socket's place, rights, and what it may replace               |
//! | `clients`  | a task for each client, their number, and their limits of time    |
//! | `desk`     | what a client asks for, answered and logged                       |
//! | `requests` | requests on their way to the cycle; disarm before all others      |

mod clients;
mod desk;
mod requests;
mod socket;

pub(super) use desk::Desk;
pub(super) use requests::Due;
pub(super) use requests::Inbox;
#[cfg(test)]
pub(super) use requests::Phase;
#[cfg(test)]
pub(super) use requests::Requests;
pub(super) use requests::channel;
pub(super) use socket::Socket;
pub(super) use socket::default_socket;
pub(super) use socket::usual_sockets;

use serde::Deserialize;
use serde::Serialize;

use node::record::Mode;
use telemetry::status::Status;

/// Requests, in the words of the protocol.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Ask {
    #[serde(rename = "status")]
    Status,
    #[serde(rename = "arm")]
    Arm,
    #[serde(rename = "disarm")]
    Disarm,
    #[serde(rename = "reset")]
    Reset,
    #[serde(rename = "mode rate")]
    Rate,
    #[serde(rename = "mode pose")]
    Pose,
}

/// One line in.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Question {
    pub(super) ask: Ask,
}

/// One line out.
#[derive(Debug, Serialize)]
struct Answer {
    ok: bool,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    mode: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    status: Option<Status>,
    /// Remark on the status, such as why the last reset failed.
    #[serde(skip_serializing_if = "Option::is_none")]
    note: Option<String>,
}

impl Answer {
    fn refused(reason: &impl ToString) -> Self {
        Self { ok: false, error: Some(reason.to_string()), mode: None, status: None, note: None }
    }

    fn granted(mode: Mode) -> Self {
        Self { ok: true, error: None, mode: Some(mode.name()), status: None, note: None }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn questions_are_the_words_of_the_protocol_and_no_others() {
        let words = ["status", "arm", "disarm", "reset", "mode rate", "mode pose"];
        let asks = [Ask::Status, Ask::Arm, Ask::Disarm, Ask::Reset, Ask::Rate, Ask::Pose];
        for (word, ask) in words.into_iter().zip(asks) {
            let line = format!("{{\"ask\":\"{word}\"}}");
            assert_eq!(serde_json::from_str::<Question>(&line).unwrap().ask, ask);
            assert_eq!(serde_json::to_string(&Question { ask }).unwrap(), line);
        }
        for line in ["{\"ask\":\"Arm\"}", "{\"ask\":\"arm\",\"force\":true}", "{}", "\"arm\""] {
            assert!(serde_json::from_str::<Question>(line).is_err(), "{line}");
        }
    }

    #[test]
    fn answers_say_what_was_granted_or_why_not() {
        let text = |answer: &Answer| serde_json::to_string(answer).unwrap();
        assert_eq!(text(&Answer::granted(Mode::Armed)), r#"{"ok":true,"mode":"armed"}"#);
        assert_eq!(text(&Answer::refused(&"no")), r#"{"ok":false,"error":"no"}"#);
    }
}
