//! Arguments, each `key=value`.

use std::time::Duration;

use crate::Outcome;
use crate::carrier::Carrier;

/// Settings of one measurement.
#[derive(Clone, Debug)]
pub(crate) struct Options {
    /// zenoh endpoint that carries the messages.
    pub(crate) carrier: Carrier,
    /// Messages of each end per second.
    pub(crate) rate: u32,
    /// Length of the measurement.
    pub(crate) seconds: u32,
    /// Maximum messages that are not echoed yet; zero for any number.
    pub(crate) window: u64,
    /// Age of the newest sample from which the node would end reflection.
    pub(crate) limit: Duration,
    /// First columns of the row.
    pub(crate) label: String,
    /// Set by the node for the process of the far side.
    pub(crate) is_far: bool,
    /// Set if an end that receives nothing declares its subscriber again.
    pub(crate) redeclares: bool,
    /// Time in ms for a session of zenoh to open, and its lease; zero for zenoh's own settings.
    pub(crate) open_timeout: u64,
    /// Folder of the certificates; set for the far side.
    pub(crate) folder: String,
    /// Port of the far side.
    pub(crate) port: u16,
}

impl Options {
    /// Reads the arguments.
    pub(crate) fn from_args(args: impl Iterator<Item = String>) -> Outcome<Self> {
        let mut options = Self {
            carrier: Carrier::Tls,
            rate: 1_000,
            seconds: 5,
            window: 0,
            limit: Duration::from_millis(100),
            label: String::new(),
            is_far: false,
            redeclares: false,
            open_timeout: 0,
            folder: String::new(),
            port: 20_000 + u16::try_from(std::process::id() % 20_000)?,
        };
        for arg in args {
            let (key, value) =
                arg.split_once('=').ok_or(format!("expected key=value, got {arg}"))?;
            options.set(key, value)?;
        }
        Ok(options)
    }

    fn set(&mut self, key: &str, value: &str) -> Outcome<()> {
        match key {
            "carrier" => self.carrier = Carrier::from_name(value)?,
            "rate" => self.rate = value.parse()?,
            "seconds" => self.seconds = value.parse()?,
            "window" => self.window = value.parse()?,
            "limit" => self.limit = Duration::from_millis(value.parse()?),
            "label" => value.clone_into(&mut self.label),
            "far" => self.is_far = value.parse()?,
            "redeclare" => self.redeclares = value.parse()?,
            "open_timeout" => self.open_timeout = value.parse()?,
            "folder" => value.clone_into(&mut self.folder),
            "port" => self.port = value.parse()?,
            _ => return Err(format!("unknown key {key}").into()),
        }
        Ok(())
    }

    /// Time from one message of an end to its next.
    pub(crate) fn period(&self) -> Duration {
        Duration::from_secs(1) / self.rate.max(1)
    }
}
