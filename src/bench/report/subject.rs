//! Content of a folder: a session or a fault record, with every part that can be read, and a remark for each that cannot.

use std::fs;
use std::io::{self, BufRead, Read};
use std::path::{Path, PathBuf};

use serde_json::Value;
use thiserror::Error;

use config::Config;
use config::files;
use replay::{BusLog, Session};
use telemetry::manifest::Manifest;
use telemetry::parts::{Part, Parts, Stream};

/// Maximum size of a JSON file, in bytes.
const MAX_SIZE: u64 = 4 << 20;

/// Maximum number of fault records of a session: those that `frhc run` keeps, and some more.
const MAX_RECORDS: usize = 100;

/// Stamps above this count from 1970, not from time zero: ten years, in µs.
const SINCE_1970: u64 = 315_360_000_000_000;

/// Reason why a folder has no report.
#[derive(Debug, Error)]
pub enum NoSubject {
    /// Folder without a file of a session or of a fault record.
    #[error("{0}: not a session or fault record: no session.json, fault.json or bus.log in it")]
    Nothing(PathBuf),
    /// Folder that cannot be read.
    #[error("{0}: {1}")]
    Unreadable(PathBuf, io::Error),
}

/// Session or fault record of a folder.
#[derive(Debug)]
pub struct Subject {
    pub(crate) folder: PathBuf,
    /// Name of its folder.
    pub(crate) name: String,
    /// Description, as far as it can be read.
    pub(crate) manifest: Option<Manifest>,
    /// Session; `None` if its description or a copied file is invalid.
    pub(crate) session: Option<Session>,
    /// Configuration: of the session, or another one that was named.
    pub(crate) config: Option<Config>,
    /// `summary.json`, or the `fault.json` of a fault record.
    pub(crate) summary: Option<Value>,
    pub(crate) fault: Option<Value>,
    /// Fault records of a session: folder and content.
    pub(crate) records: Vec<(String, Value)>,
    /// Parts that are missing, a sentence each.
    pub(crate) remarks: Vec<String>,
}

impl Subject {
    /// Reads the descriptions of a folder. `configure` returns the configuration of a session, or the reason why it cannot.
    ///
    /// # Errors
    /// Returns an error if the folder has no session and no fault record.
    pub fn open(
        folder: &Path,
        named: Option<Config>,
        configure: impl Fn(&Session) -> Result<Config, String>,
    ) -> Result<Self, NoSubject> {
        let found = fs::metadata(folder);
        let found = found.map_err(|error| NoSubject::Unreadable(folder.to_path_buf(), error))?;
        let has = |name: &str| found.is_dir() && fs::symlink_metadata(folder.join(name)).is_ok();
        let (is_session, is_record) = (has("session.json"), has("fault.json"));
        if !is_session && !is_record && !has("bus.log") && !has("bus.log.gz") {
            return Err(NoSubject::Nothing(folder.to_path_buf()));
        }
        let mut subject = Self {
            folder: folder.to_path_buf(),
            name: name_of(folder),
            manifest: None,
            session: None,
            config: None,
            summary: None,
            fault: None,
            records: Vec::new(),
            remarks: Vec::new(),
        };
        if is_record && !is_session {
            subject.open_record(configure);
        } else {
            subject.open_session(configure);
        }
        // A valid session has a configuration; a replay with another one would differ.
        match (&subject.session, &subject.config, named) {
            (Some(_), Some(_), Some(_)) => {
                subject.remarks.push("--config is not used: the session has its own".to_owned());
            }
            (_, _, Some(named)) => subject.config = Some(named),
            (_, _, None) => {}
        }
        Ok(subject)
    }

    /// Returns whether it is a fault record, without a session in the same folder.
    pub fn is_record(&self) -> bool {
        let has = |name: &str| fs::symlink_metadata(self.folder.join(name)).is_ok();
        has("fault.json") && !has("session.json")
    }

    /// Returns the number of its cycles by `summary.json`.
    pub fn cycles(&self) -> Option<u64> {
        self.summary.as_ref()?.get("cycles")?.as_u64()
    }

    fn open_session(&mut self, configure: impl Fn(&Session) -> Result<Config, String>) {
        match Session::open(&self.folder) {
            Ok(session) => {
                self.manifest = Some(session.manifest().clone());
                match configure(&session) {
                    Ok(config) => self.config = Some(config),
                    Err(reason) => {
                        self.remarks.push(format!("the configuration of the session: {reason}"));
                    }
                }
                self.remarks.extend(session.remarks());
                self.session = Some(session);
            }
            Err(error) => {
                self.remarks.push(format!("{error}; so nothing is replayed"));
                let text = self.json("session.json", false);
                self.manifest = text.and_then(|value| serde_json::from_value(value).ok());
            }
        }
        self.summary = self.json("summary.json", self.session.is_none());
        let folder = self.folder.join("faults");
        let entries = fs::read_dir(&folder).into_iter().flatten().flatten();
        let mut names: Vec<String> = entries
            .filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()))
            .map(|entry| entry.file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        for name in names.into_iter().take(MAX_RECORDS) {
            let document = self.json(&format!("faults/{name}/fault.json"), true);
            self.records.extend(document.map(|document| (name, document)));
        }
    }

    /// Reads a fault record; its configuration is that of the session in whose folder it is.
    fn open_record(&mut self, configure: impl Fn(&Session) -> Result<Config, String>) {
        self.fault = self.json("fault.json", true);
        let Ok(whole) = self.folder.canonicalize() else { return };
        let session = whole.parent().filter(|parent| parent.ends_with("faults"));
        let Some(folder) = session.and_then(Path::parent) else { return };
        match Session::open(folder).map_err(|error| error.to_string()) {
            Ok(session) => {
                self.manifest = Some(session.manifest().clone());
                self.config = configure(&session).ok();
            }
            Err(reason) => self.remarks.push(format!("the session of this record: {reason}")),
        }
    }

    /// Reads a JSON file; a remark where it cannot be read, or is missing although it should be there.
    fn json(&mut self, name: &str, is_expected: bool) -> Option<Value> {
        let read =
            read(&self.folder.join(name)).and_then(|text| Ok(serde_json::from_slice(&text)?));
        match read {
            Ok(value) => Some(value),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                if is_expected {
                    self.remarks.push(format!("{name} is missing"));
                }
                None
            }
            Err(error) => {
                self.remarks.push(format!("{name}: {error}"));
                None
            }
        }
    }

    /// Opens the log of frames: all its parts, plain or packed.
    pub(crate) fn log(&self) -> io::Result<Box<dyn BufRead>> {
        if let Some(session) = &self.session {
            return match session.bus_log() {
                Ok(log) => Ok(Box::new(log)),
                Err(error) => Err(io::Error::other(error.to_string())),
            };
        }
        let parts = Parts::find(&self.folder, None)?;
        let files = parts.stream(Stream::BusLog).flatten().map(Part::name);
        Ok(Box::new(BusLog::open(files.map(|file| self.folder.join(file)))?))
    }

    /// Returns the names of the joints, base first.
    pub(crate) fn joints(&self) -> Vec<String> {
        if let Some(config) = &self.config {
            return config.joints.iter().map(|joint| joint.name.clone()).collect();
        }
        let of_fault = || {
            let names = self.fault.as_ref()?.get("joints")?.as_array()?.clone();
            Some(names.iter().filter_map(Value::as_str).map(str::to_owned).collect())
        };
        let recorded = self.manifest.as_ref().map(|manifest| manifest.joints.clone());
        let mut names = recorded.or_else(of_fault).unwrap_or_default();
        for joint in names.len()..6 {
            names.push(format!("joint {}", joint + 1));
        }
        names
    }

    /// Returns the interfaces of the buses; those of the log's first lines where there is no description.
    pub(crate) fn interfaces(&self) -> Vec<String> {
        match &self.manifest {
            Some(manifest) => manifest.interfaces.clone(),
            None => self.log().map(crate::frames::interfaces).unwrap_or_default(),
        }
    }

    /// Returns time zero, in µs since 1970: that of the description, else of the summary or the fault record, else of the log.
    pub(crate) fn origin_us(&self) -> u64 {
        let recorded = self.manifest.as_ref().map(|manifest| manifest.origin_us);
        let documents = || {
            let document = self.fault.as_ref().or(self.summary.as_ref())?;
            let seconds = document.get("origin")?.get("unix_seconds")?.as_f64()?;
            format!("{:.0}", seconds * 1e6).parse().ok()
        };
        let log =
            || self.log().ok().and_then(crate::frames::first_us).filter(|at| *at > SINCE_1970);
        recorded.or_else(documents).or_else(log).unwrap_or(0)
    }
}

/// Returns the name of a folder, as its last part.
fn name_of(folder: &Path) -> String {
    let whole = folder.canonicalize().unwrap_or_else(|_| folder.to_path_buf());
    let name = whole.file_name().unwrap_or(whole.as_os_str());
    name.to_string_lossy().into_owned()
}

fn read(file: &Path) -> io::Result<Vec<u8>> {
    let mut content = Vec::new();
    files::open_unlinked(file)?.take(MAX_SIZE + 1).read_to_end(&mut content)?;
    let fits = u64::try_from(content.len()).is_ok_and(|length| length <= MAX_SIZE);
    if fits { Ok(content) } else { Err(io::ErrorKind::FileTooLarge.into()) }
}
