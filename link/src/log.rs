//! The log on standard error: lines of this program, and what zenoh says that a user must know, in one line each.

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

/// Time in which the same line of zenoh is printed once: it tries again several times a second.
const REPEAT_AFTER: Duration = Duration::from_secs(30);

/// Starts the log; `verbose` adds all that zenoh says.
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
    let zenoh = (!verbose).then(Explainer::default);
    tracing_subscriber::registry().with(lines).with(zenoh).init();
}

/// Prints the warnings of zenoh that need somebody, in words of this program.
#[derive(Debug, Default)]
struct Explainer {
    printed: Mutex<BTreeMap<String, Instant>>,
}

impl<S: Subscriber> Layer<S> for Explainer {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let metadata = event.metadata();
        if !metadata.target().starts_with("zenoh") || *metadata.level() > Level::WARN {
            return;
        }
        let mut text = Message::default();
        event.record(&mut text);
        let Some(line) = explained(&text.0) else { return };
        let now = clock::now();
        let mut printed = self.printed.lock().unwrap_or_else(PoisonError::into_inner);
        if printed.get(&line).is_some_and(|at| now.since(*at) < REPEAT_AFTER) {
            return;
        }
        // Standard error may be closed.
        drop(writeln!(stderr(), " WARN {line}"));
        printed.retain(|_, at| now.since(*at) < REPEAT_AFTER);
        printed.insert(line, now);
    }
}

/// The message of an event.
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

/// What TLS says of a certificate, and what that means: of the other end's own, then of this one's as the other end sees it.
const REASONS: [(&str, &str); 12] = [
    ("invalid peer certificate: Expired", "the certificate of the other end has expired"),
    ("invalid peer certificate: NotValidYet", "the certificate of the other end is not valid yet"),
    (
        "invalid peer certificate: UnknownIssuer",
        "the certificate of the other end is of another authority",
    ),
    (
        "invalid peer certificate: BadSignature",
        "the certificate of the other end is of another authority",
    ),
    ("peer sent no certificates", "the other end has no certificate"),
    (
        "CertificateExpired",
        "the other end says that a certificate has expired: this one, or by its clock",
    ),
    (
        "certificate expired",
        "the other end says that a certificate has expired: this one, or by its clock",
    ),
    ("UnknownCA", "the other end has another authority"),
    ("unknown CA", "the other end has another authority"),
    ("BadCertificate", "the other end refuses the certificate of this one"),
    ("CertificateUnknown", "the other end refuses the certificate of this one"),
    ("invalid peer certificate", "the certificate of the other end is invalid"),
];

/// Returns the line for a message of zenoh; `None` where nobody has to do anything.
fn explained(message: &str) -> Option<String> {
    let reason = innermost(message);
    if let Some((_, meaning)) = REASONS.iter().find(|(sign, _)| reason.contains(sign)) {
        return Some(format!("connection refused: {meaning}"));
    }
    let is_usual = ["Gossip is disabled", "Skipping name verification", "Unable to open listener"]
        .iter()
        .any(|usual| reason.contains(usual));
    (!is_usual).then(|| format!("network: {reason}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refused_certificates_are_explained_and_habits_are_not() {
        let refused = explained("QUIC acceptor: invalid peer certificate: Expired at /a/b.rs:3.");
        assert_eq!(
            refused.unwrap(),
            "connection refused: the certificate of the other end has expired"
        );
        assert_eq!(explained("Skipping name verification of QUIC server"), None);
        assert_eq!(explained("odd at /a/b.rs:3.").unwrap(), "network: odd");
    }
}
