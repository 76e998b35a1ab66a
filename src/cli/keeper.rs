//! What is kept of a run, off the cycle's thread: the session, if one is recorded, and every trip.

use std::path::Path;
use std::path::PathBuf;

use crate::canopen::frame::Telegram;
use crate::cli::fault_records;
use crate::cli::fault_records::Faults;
use crate::cli::session::Session;
use crate::telemetry::record::Record;
use crate::telemetry::session::Brief;
use crate::telemetry::summary::Summary;
use crate::time::Instant;

/// Nothing, a session, fault records, or both.
#[derive(Debug, Default)]
pub(super) struct Keeper {
    session: Option<Session>,
    faults: Option<Faults>,
    news: Option<String>,
}

impl Keeper {
    /// A session in `folder`, with its fault records in `faults` there.
    pub(super) fn of_session(
        folder: &Path,
        interfaces: &[String],
        epoch_micros: u64,
    ) -> anyhow::Result<Self> {
        let session = Session::create(folder, interfaces, epoch_micros)?;
        let faults = Some(folder.join("faults"));
        Ok(Self { session: Some(session), ..Self::of_faults(faults, interfaces, epoch_micros) })
    }

    /// Fault records alone, where they belong.
    pub(super) fn of_faults_alone(interfaces: &[String], epoch_micros: u64) -> Self {
        Self::of_faults(fault_records::default_folder(), interfaces, epoch_micros)
    }

    fn of_faults(folder: Option<PathBuf>, interfaces: &[String], epoch_micros: u64) -> Self {
        let Some(folder) = folder else {
            let news = "no fault records: neither STATE_DIRECTORY nor HOME says where".to_owned();
            return Self { news: Some(news), ..Self::default() };
        };
        match Faults::open(&folder, interfaces, epoch_micros) {
            Ok(faults) => Self { faults: Some(faults), ..Self::default() },
            Err(error) => {
                let news = format!("no fault records in {}: {error}", folder.display());
                Self { news: Some(news), ..Self::default() }
            }
        }
    }

    /// A frame has passed by.
    pub(super) fn frame(&mut self, at: Instant, telegram: &Telegram) {
        if let Some(session) = &mut self.session {
            session.log.frame(at, telegram);
        }
        if let Some(faults) = &mut self.faults {
            faults.frame(at, telegram);
        }
    }

    /// A cycle has run.
    pub(super) fn cycle(&mut self, record: &Record) {
        if let Some(session) = &mut self.session {
            session.log.cycle(&Brief::from(record));
        }
        if let Some(faults) = &mut self.faults {
            faults.cycle(record);
        }
    }

    /// What is to be told, one line each: where a fault record is, or what is no longer kept and why.
    pub(super) fn news(&mut self) -> Option<String> {
        let news = self.news.take();
        let news = news.or_else(|| self.session.as_mut().and_then(Session::news));
        news.or_else(|| self.faults.as_mut().and_then(Faults::news))
    }

    /// Ends all of it; what it leaves, in a line.
    ///
    /// # Errors
    /// When the session is not complete on the disk. The fault records are then there all the same.
    pub(super) fn finish(self, summary: &Summary) -> (Option<String>, anyhow::Result<()>) {
        let left = self.faults.and_then(Faults::finish);
        (left, self.session.map_or(Ok(()), |session| session.finish(summary)))
    }
}
