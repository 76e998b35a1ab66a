//! Log on standard error: lines of this program, and messages of zenoh that concern a user, one line each.

use std::collections::BTreeMap;
use std::fmt::{self, Write as _};
use std::io::{IsTerminal, Write as _, stderr};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt};
use tracing_subscriber::util::SubscriberInitExt;
use units::time::Instant;

use crate::clock;
use crate::network::innermost;

/// Time within which equal lines of zenoh, which retries several times a second, are printed once.
const REPEAT_AFTER: Duration = Duration::from_secs(30);

/// Maximum number of lines of zenoh within that time. Anyone who reaches the port can cause any number.
const MAX_LINES: usize = 20;

/// Starts the log; `verbose` adds all messages of zenoh.
pub(crate) fn start(quiet: bool, verbose: bool) {
    let level = if quiet { LevelFilter::WARN } else { LevelFilter::INFO };
    let shown = if verbose { LevelFilter::DEBUG } else { LevelFilter::OFF };
    let own = ["frhc_link", "far_socket", "unix_socket"].map(|target| (target, level));
    let ansi = std::env::var_os("NO_COLOR").is_none() && stderr().is_terminal();
    let lines = tracing_subscriber::fmt::layer()
        .with_writer(stderr)
        .with_target(verbose)
        .with_ansi(ansi)
        .without_time()
        .with_filter(Targets::new().with_targets(own).with_default(shown));
    // An end that connects says at debug why it could not.
    let said = Targets::new()
        .with_target("zenoh", LevelFilter::WARN)
        .with_target("zenoh_link_commons", LevelFilter::WARN)
        .with_target("zenoh::net::runtime::orchestrator", LevelFilter::DEBUG);
    let zenoh = (!verbose).then(|| Explainer::default().with_filter(said));
    tracing_subscriber::registry().with(lines).with(zenoh).init();
}

/// Layer that prints warnings of zenoh that require action, in words of this program.
#[derive(Debug, Default)]
struct Explainer {
    printed: Mutex<BTreeMap<String, Instant>>,
}

impl<S: Subscriber> Layer<S> for Explainer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut text = Message::default();
        event.record(&mut text);
        let Some(line) = explained(*event.metadata().level(), &text.0) else { return };
        let now = clock::now();
        let mut printed = self.printed.lock().unwrap_or_else(PoisonError::into_inner);
        printed.retain(|_, at| now.since(*at) < REPEAT_AFTER);
        if printed.contains_key(&line) || printed.len() >= MAX_LINES {
            return;
        }
        // Standard error may be closed.
        drop(writeln!(stderr(), " WARN {line}"));
        printed.insert(line, now);
    }
}

/// Message of an event.
#[derive(Debug, Default)]
struct Message(String);

impl Visit for Message {
    fn record_debug(&mut self, field: &Field, value: &dyn fmt::Debug) {
        if field.name() == "message" {
            // Writing to a string does not fail.
            write!(self.0, "{value:?}").unwrap_or_default();
        }
    }
}

/// Words of TLS about a certificate, and their meaning.
const REASONS: [(&str, &str); 7] = [
    ("certificate expired", "has expired"),
    ("certificate not valid yet", "is not valid yet"),
    ("UnknownIssuer", "is of another authority"),
    ("BadSignature", "is of another authority"),
    ("unknown CA", "is of another authority"),
    ("sent no certificates", "is missing"),
    ("certificate required", "is missing"),
];

/// Returns the line for a message of zenoh; `None` if no action is required.
fn explained(level: Level, message: &str) -> Option<String> {
    let reason = innermost(message);
    if USUAL.iter().any(|usual| reason.contains(usual)) {
        return None;
    }
    if reason.contains("certificate") {
        return Some(refusal(&reason));
    }
    let endpoint = reason.strip_prefix("Unable to connect to configured peer quic/");
    if let Some((address, _)) = endpoint.and_then(|rest| rest.split_once('?')) {
        return Some(format!("{address}: no answer, tries again"));
    }
    (level <= Level::WARN).then(|| format!("network: {reason}"))
}

/// Returns the line for a refused certificate. An end that is refused gets the reason of the other end.
fn refusal(reason: &str) -> String {
    let found = REASONS.iter().find(|(sign, _)| reason.contains(sign));
    let meaning = found.map_or("is invalid", |(_, meaning)| meaning);
    let is_ours = reason.contains("closed by peer") || reason.contains("ConnectionClosed");
    let (whose, clock) = if is_ours { ("this", "the other") } else { ("the other", "this") };
    let is_of_time = meaning.contains("expired") || meaning.contains("valid yet");
    let clock = if is_of_time {
        format!("; is the clock of {clock} machine right?")
    } else {
        String::new()
    };
    format!("connection refused: the certificate of {whose} end {meaning}{clock}")
}

/// Warnings of zenoh in every session.
const USUAL: [&str; 5] = [
    "Gossip is disabled",
    "Skipping name verification",
    "multiple network interfaces",
    "Route data with unknown scope",
    "Unable to open listener",
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refused_certificates_are_explained_and_habits_are_not() {
        let refused = explained(
            Level::WARN,
            "QUIC acceptor failed: \"invalid peer certificate: certificate expired: x\" at /a/b.rs:3.",
        );
        assert_eq!(
            refused.unwrap(),
            "connection refused: the certificate of the other end has expired; is the clock of this machine right?"
        );
        assert_eq!(explained(Level::WARN, "Skipping name verification of QUIC server"), None);
        assert_eq!(explained(Level::WARN, "odd at /a/b.rs:3.").unwrap(), "network: odd");
        assert_eq!(explained(Level::DEBUG, "odd at /a/b.rs:3."), None);
        let silent = "Unable to connect to configured peer quic/robot:7447?mixed_rel=1! Timeout. Retry in 1s";
        assert_eq!(explained(Level::DEBUG, silent).unwrap(), "robot:7447: no answer, tries again");
    }
}
