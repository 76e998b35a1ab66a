//! Telemetry of `frhc demo`, equal to that of `frhc run`, and the page that shows it.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use anyhow::Context;
use tempfile::TempDir;

use crate::args::TelemetryArgs;
use canopen::frame::Telegram;
use config::Config;
use node::record::Record;
use run::exit::{Failure, Kind, OrFail};
use run::feed_socket::{self, NAME, Publisher};
use run::print;
use telemetry::feed::{Feed, Scarce, Source};
use telemetry::summary::Summary;
use telemetry::timing::Timing;
use units::time::Instant;
#[cfg(feature = "view")]
use view::{command, server::Running};

/// Socket of a demo's telemetry, and its page.
#[derive(Debug)]
pub(crate) struct DemoTelemetry {
    socket: PathBuf,
    /// Publisher of the first run, created with the socket.
    first: RefCell<Option<Publisher>>,
    /// Temporary folder of a private socket; removed at the end.
    _private: Option<TempDir>,
    #[cfg(feature = "view")]
    _page: Option<Running>,
}

impl DemoTelemetry {
    /// Offers the telemetry of a demo in real time or with `--telemetry`, and serves its page with `--view`. Returns `None` for
    /// any other demo.
    ///
    /// # Errors
    /// Returns an error if the socket of `--telemetry`, or the address of the page, cannot be used.
    pub(crate) fn start(args: &TelemetryArgs, config: &Config) -> Result<Option<Self>, Failure> {
        if args.socket.is_none() && args.speed().is_none() {
            return Ok(None);
        }
        let Some((socket, private, first)) = socket(args, config)? else { return Ok(None) };
        Ok(Some(Self {
            #[cfg(feature = "view")]
            _page: args.page.view.then(|| serve(args, socket.clone())).transpose()?,
            socket,
            first: RefCell::new(Some(first)),
            _private: private,
        }))
    }

    /// Offers the telemetry of the next run.
    ///
    /// # Errors
    /// Returns an error if the socket cannot be created.
    pub(crate) fn of_run(&self, config: &Config) -> Result<RunTelemetry, Failure> {
        let publisher = self.first.take().map_or_else(|| publisher(&self.socket, config), Ok)?;
        Ok(RunTelemetry { publisher, timing: Timing::default() })
    }
}

/// Listens at the socket of `--telemetry`, or at the default one. If another node uses the latter, a page gets a socket in a
/// temporary folder, and a demo without a page runs without telemetry.
fn socket(
    args: &TelemetryArgs,
    config: &Config,
) -> Result<Option<(PathBuf, Option<TempDir>, Publisher)>, Failure> {
    let path = args.socket.clone().unwrap_or_else(|| feed_socket::beside(None));
    match publisher(&path, config) {
        Ok(first) => Ok(Some((path, None, first))),
        Err(refused) if args.socket.is_some() => Err(refused),
        Err(refused) if args.has_page() => {
            print::note(&format!("frhc top cannot see this demo: {refused}"));
            let folder = tempfile::tempdir().context("no temporary folder").or_fail(Kind::File)?;
            let path = folder.path().join(NAME);
            let first = publisher(&path, config)?;
            Ok(Some((path, Some(folder), first)))
        }
        Err(refused) => {
            print::note(&format!("no telemetry: {refused}"));
            Ok(None)
        }
    }
}

fn publisher(socket: &Path, config: &Config) -> Result<Publisher, Failure> {
    let started = Publisher::start(socket, Feed::new(config, Source::Demo, None));
    started.with_context(|| format!("telemetry socket {}", socket.display())).or_fail(Kind::Bus)
}

#[cfg(feature = "view")]
/// Serves the page of the node at this socket, and prints its address.
fn serve(args: &TelemetryArgs, socket: PathBuf) -> Result<Running, Failure> {
    let server = command::bind(args.page.listen, vec![socket])?;
    print::note(&format!("look at http://{}/", server.address()));
    server.start().or_fail(Kind::System)
}

/// Publisher of one run's telemetry, and the timing in it.
#[derive(Debug)]
pub(crate) struct RunTelemetry {
    publisher: Publisher,
    timing: Timing,
}

impl RunTelemetry {
    /// Takes a frame that was sent or received `at` this time.
    pub(crate) fn on_frame(&mut self, at: Instant, telegram: &Telegram) {
        self.publisher.on_frame(at, telegram);
    }

    /// Takes a cycle, and the summary with it.
    pub(crate) fn on_record(&mut self, record: &Record, summary: &Summary) {
        let Self { publisher, timing } = self;
        timing.add(record);
        publisher.on_record(record, || Scarce {
            missing_samples: summary.missing_samples,
            timing: Some(timing.report()),
            ..Scarce::default()
        });
    }
}
