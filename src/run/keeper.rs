//! What is kept of a run, off the cycle's thread: the session, if one is recorded, and every trip.

use std::path::Path;
use std::path::PathBuf;

use crate::fault_records;
use crate::fault_records::Faults;
use crate::kept::Kept;
use crate::provenance::Provenance;
use crate::session;
use crate::session::Session;
use canopen::frame::Telegram;
use node::record::Record;
use telemetry::summary::Summary;
use units::time::Instant;

/// Nothing, a session, fault records, or both.
#[derive(Debug, Default)]
pub struct Keeper {
    pub(super) session: Option<Session>,
    pub(super) faults: Option<Faults>,
    pub(super) news: Option<String>,
}

impl Keeper {
    /// A session in `folder`, with its fault records in `faults` there.
    ///
    /// # Errors
    /// When its files cannot be made.
    pub fn of_session(folder: &Path, provenance: &Provenance) -> anyhow::Result<Self> {
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
    pub fn frame(&mut self, at: Instant, telegram: &Telegram) {
        if let Some(faults) = &mut self.faults {
            faults.frame(at, telegram);
        }
        if let Some(session) = &mut self.session {
            session.frame(at, telegram);
        }
    }

    /// A cycle has run.
    pub fn cycle(&mut self, record: &Record) {
        if let Some(faults) = &mut self.faults {
            faults.cycle(record);
        }
        if let Some(session) = &mut self.session {
            session.cycle(record);
        }
    }

    /// What is to be told, one line each: where a fault record is, or what is no longer kept and why.
    pub fn news(&mut self) -> Option<String> {
        let news = self.news.take();
        let news = news.or_else(|| self.session.as_mut().and_then(Session::news));
        news.or_else(|| self.faults.as_mut().and_then(Faults::news))
    }

    /// Ends all of it; what it leaves, in a line.
    ///
    /// # Errors
    /// When the session is not complete on the disk. The fault records are then there all the same.
    pub fn finish(self, summary: &Summary) -> (Option<String>, anyhow::Result<()>) {
        let left = self.faults.and_then(Faults::finish);
        (left, self.session.map_or(Ok(()), |session| session.finish(summary)))
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::scratch::path as scratch;
    use canopen::frame::Channel;
    use canopen::frame::Frame;
    use config::Config;
    use lab::bench::Bench;
    use node::cause::Cause;
    use node::record::Mode;
    use sim::scenario::Scenario;
    use units::numbering::Joint;

    fn provenance() -> Provenance {
        Provenance { interfaces: vec!["can0".to_owned()], ..Provenance::default() }
    }

    /// Shows it a SYNC and a cycle, and one more of each with a trip.
    fn trip(keeper: &mut Keeper) {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let script = Scenario::parse("seconds = 1").unwrap();
        let record = Bench::new(&config, script, 1, false, ()).cycle();
        let cause = Some(Cause::SamplesMissing { joint: Joint::of::<3>(), cycles: 3 });
        let engaged = Record { mode: Mode::Engaged, cause: None, ..record };
        let stopped = Record { mode: Mode::ZeroTorque, cause, ..record };
        for (cycle, record) in [(1, engaged), (2, stopped)] {
            let at = Instant::from_micros(1_000 * cycle);
            let frame = Frame::new(0x80, []);
            keeper.frame(at, &Telegram { channel: Channel(0), frame });
            keeper.cycle(&Record { cycle, at, ..record });
        }
    }

    #[test]
    fn session_keeps_everything_and_its_trips_below_it() {
        let folder = scratch("keeper");
        let mut keeper = Keeper::of_session(&folder, &provenance()).unwrap();
        trip(&mut keeper);
        let fault = folder.join("faults/001-2-samples-missing");
        assert_eq!(keeper.news(), Some(format!("fault record: {}", fault.display())));
        assert_eq!(keeper.news(), None);
        let (left, finished) = keeper.finish(&Summary::default());
        finished.unwrap();
        assert!(left.unwrap().ends_with("001-2-samples-missing"));
        for log in [folder.join("bus.log"), fault.join("bus.log")] {
            let log = fs::read_to_string(log).unwrap();
            let lines = |text: &str| log.lines().filter(|line| line.contains(text)).count();
            assert_eq!((lines(" can0 "), lines(" node0 ")), (2, 2), "{log}");
        }
        assert!(folder.join("summary.json").exists());
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn run_without_trip_leaves_no_fault_records() {
        let folder = scratch("keeper-quiet");
        let keeper = Keeper::of_faults(Some(folder.clone()), &provenance());
        let (left, finished) = keeper.finish(&Summary::default());
        finished.unwrap();
        assert_eq!((left, folder.exists()), (None, false));
    }

    #[test]
    fn missing_place_for_fault_records_is_reported_and_the_run_goes_on() {
        let file = scratch("keeper-file");
        fs::write(&file, "").unwrap();
        for (folder, why) in
            [(None, "neither STATE_DIRECTORY nor HOME"), (Some(&file), "keeper-file")]
        {
            let mut keeper = Keeper::of_faults(folder.cloned(), &provenance());
            trip(&mut keeper);
            let news = keeper.news().unwrap();
            assert!(news.starts_with("no fault records") && news.contains(why), "{news}");
            assert_eq!(keeper.news(), None);
            let (left, finished) = keeper.finish(&Summary::default());
            finished.unwrap();
            assert_eq!(left, None);
        }
        fs::remove_file(&file).unwrap();
    }

    #[test]
    fn session_that_cannot_begin_is_an_error() {
        let folder = scratch("keeper-twice");
        Keeper::of_session(&folder, &provenance()).unwrap();
        assert!(Keeper::of_session(&folder, &provenance()).is_err());
        fs::remove_dir_all(&folder).unwrap();
    }
}
