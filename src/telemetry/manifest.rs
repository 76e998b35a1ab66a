//! Description of a recorded session, `session.json`: program, host and time, and copies of all files of the configuration.

use serde::{Deserialize, Serialize};

/// Version of a session's folder; docs/sessions.md describes it.
pub const FORMAT: u16 = 2;

/// Oldest version that can be read, whose sessions have one part.
pub const OLDEST_FORMAT: u16 = 1;

/// Description of a session.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the folder.
    pub format: u16,
    /// Program and version.
    pub program: String,
    /// Command that recorded the session.
    pub kind: SessionKind,
    /// Time zero of the session, in µs since 1970; zero in virtual time.
    pub origin_us: u64,
    /// Interfaces of the buses, in the order of the channels.
    pub interfaces: Vec<String>,
    /// Names of the joints, base first.
    pub joints: Vec<String>,
    /// Path of the configuration, one of `files`.
    pub configuration: String,
    /// Path of a robot file that replaces the configuration's, one of `files`.
    pub robot: Option<String>,
    /// Path of the scenario, one of `files`.
    pub scenario: Option<String>,
    /// Case that a campaign has recorded; `None` for other sessions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub case: Option<CampaignCase>,
    /// Set if the passivity layer of the configuration was disabled.
    pub without_passivity: bool,
    /// Copies of the files.
    pub files: Vec<FileCopy>,
    /// Facts about the host.
    pub host: Host,
}

/// Command that recorded a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SessionKind {
    /// `frhc run`.
    Run,
    /// `frhc demo`.
    Demo,
    /// `frhc campaign`.
    Campaign,
}

/// Seed and number by which `frhc campaign` repeats a case.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct CampaignCase {
    /// Seed that all random choices of the campaign follow from.
    pub seed: u64,
    /// Number of the case, from 1.
    pub number: u32,
}

/// File of the session that is a copy of one that the run has read.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileCopy {
    /// Path by which the session has read the original.
    pub path: String,
    /// Name of the copy in the folder of the session.
    pub copy: String,
    /// SHA-256 of the content, in hexadecimal digits.
    pub sha256: String,
}

/// Facts about a host.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Host {
    /// Host name; `None` in an anonymous session.
    pub name: Option<String>,
    /// Release of the kernel.
    pub kernel: String,
    /// Architecture.
    pub machine: String,
    /// Model of the processor.
    pub processor: String,
    /// Number of processors.
    pub processors: usize,
}
