//! What is kept of a run, off the cycle's thread: the session, if one is recorded, and every trip.

use std::path::Path;
use std::path::PathBuf;

use crate::canopen::frame::Telegram;
use crate::cli::archive::Kept;
use crate::cli::fault_records;
use crate::cli::fault_records::Faults;
use crate::cli::provenance::Provenance;
use crate::cli::session;
use crate::cli::session::Session;
use crate::telemetry::record::Record;
use crate::telemetry::summary::Summary;
use crate::time::Instant;

/// Nothing, a session, fault records, or both.
#[derive(Debug, Default)]
pub(super) struct Keeper {
    pub(super) session: Option<Session>,
    pub(super) faults: Option<Faults>,
    pub(super) news: Option<String>,
}

impl Keeper {
    /// A session in `folder`, with its fault records in `faults` there.
    pub(super) fn of_session(folder: &Path, provenance: &Provenance) -> anyhow::Result<Self> {
        let session = Session::create(folder, provenance)?;
        let faults = Some(folder.join(session::FAULTS));
        Ok(Self { session: Some(session), ..Self::of_faults(faults, provenance) })
    }

    /// Fault records alone, where they belong.
    pub(super) fn of_faults_alone(provenance: &Provenance) -> Self {
        Self::of_faults(fault_records::default_folder(), provenance)
    }

    fn of_faults(folder: Option<PathBuf>, provenance: &Provenance) -> Self {
        let Some(folder) = folder else {
            let news = "no fault records: neither STATE_DIRECTORY nor HOME says where".to_owned();
            return Self { news: Some(news), ..Self::default() };
        };
        match Faults::open(&folder, provenance) {
            Ok(faults) => Self { faults: Some(faults), ..Self::default() },
            Err(error) => {
                let news = format!("no fault records in {}: {error}", folder.display());
                Self { news: Some(news), ..Self::default() }
            }
        }
    }

    /// A frame has passed by.
    pub(super) fn frame(&mut self, at: Instant, telegram: &Telegram) {
        if let Some(faults) = &mut self.faults {
            faults.frame(at, telegram);
        }
        if let Some(session) = &mut self.session {
            session.frame(at, telegram);
        }
    }

    /// A cycle has run.
    pub(super) fn cycle(&mut self, record: &Record) {
        if let Some(faults) = &mut self.faults {
            faults.cycle(record);
        }
        if let Some(session) = &mut self.session {
            session.cycle(record);
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
