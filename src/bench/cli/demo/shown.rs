//! The telemetry of `frhc demo`: that of `frhc run`, from a node in this process.

use std::path::PathBuf;

use anyhow::Context;

use crate::args;
use canopen::frame::Telegram;
use config::Config;
use node::record::Record;
use run::exit::{Failure, Kind, OrFail};
use run::feed_socket::{self, Publisher};
use run::print;
use telemetry::feed::{Feed, Scarce, Source};
use telemetry::summary::Summary;
use telemetry::timing::Timing;
use units::time::Instant;

/// Where a demo is shown.
#[derive(Debug)]
pub(super) struct Shown {
    socket: PathBuf,
}

impl Shown {
    /// Finds the socket of a demo in real time, or of one whose telemetry is asked for; `None` for any other.
    ///
    /// # Errors
    /// The socket that is asked for cannot be created.
    pub(super) fn start(args: &args::Shown, config: &Config) -> Result<Option<Self>, Failure> {
        let is_default = args.telemetry.is_none();
        if is_default && args.speed().is_none() {
            return Ok(None);
        }
        let socket = args.telemetry.clone().unwrap_or_else(|| feed_socket::beside(None));
        let shown = Self { socket };
        match shown.publisher(config) {
            Ok(_) => Ok(Some(shown)),
            Err(refused) if is_default => {
                print::note(&format!("no telemetry: {refused}"));
                Ok(None)
            }
            Err(refused) => Err(refused),
        }
    }

    /// Offers the telemetry of a node.
    ///
    /// # Errors
    /// The socket cannot be created.
    pub(super) fn publisher(&self, config: &Config) -> Result<Telemetry, Failure> {
        let started = Publisher::start(&self.socket, Feed::new(config, Source::Demo, None));
        let publisher =
            started.with_context(|| format!("telemetry socket {}", self.socket.display()));
        Ok(Telemetry { publisher: publisher.or_fail(Kind::Bus)?, timing: Timing::default() })
    }
}

/// The telemetry of one run.
#[derive(Debug)]
pub(super) struct Telemetry {
    publisher: Publisher,
    timing: Timing,
}

impl Telemetry {
    /// Takes a frame that was sent or received `at` this time.
    pub(super) fn on_frame(&mut self, at: Instant, telegram: &Telegram) {
        self.publisher.on_frame(at, telegram);
    }

    /// Takes a cycle, and the summary with it.
    pub(super) fn on_record(&mut self, record: &Record, summary: &Summary) {
        let Self { publisher, timing } = self;
        timing.add(record);
        publisher.on_record(record, || Scarce {
            missing_samples: summary.missing_samples,
            timing: Some(timing.report()),
            ..Scarce::default()
        });
    }
}
