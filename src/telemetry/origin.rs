//! Origin of time of a run, common to stderr, `bus.log`, `fault.json` and `summary.json`.

use std::fmt;
use std::time::{Duration, UNIX_EPOCH};

use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// Wall clock at [`Instant::ZERO`](units::time::Instant::ZERO). A stamp in `bus.log` minus the origin is the time in
/// stderr and `fault.json`. Zero in virtual time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Origin(Duration);

impl Origin {
    /// Creates an origin `micros` µs after 1970.
    pub const fn from_micros(micros: u64) -> Self {
        Self(Duration::from_micros(micros))
    }

    /// Returns microseconds since 1970.
    pub fn as_micros(self) -> u64 {
        u64::try_from(self.0.as_micros()).unwrap_or(u64::MAX)
    }

    /// Formats UTC with milliseconds: `2026-11-22T07:12:43.123Z`.
    pub fn utc(self) -> String {
        humantime::format_rfc3339_millis(UNIX_EPOCH + self.0).to_string()
    }

    /// Formats UTC for a file name: `20261122T071243Z`.
    pub fn compact(self) -> String {
        let utc = humantime::format_rfc3339_seconds(UNIX_EPOCH + self.0).to_string();
        utc.replace(['-', ':'], "")
    }
}

/// Formats as `2026-11-22T07:12:43.123456Z (1795331563.123456)`.
impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let utc = humantime::format_rfc3339_micros(UNIX_EPOCH + self.0);
        write!(f, "{utc} ({}.{:06})", self.0.as_secs(), self.0.subsec_micros())
    }
}

/// Serializes as `{"utc": "2026-11-22T07:12:43.123456Z", "unix_seconds": 1795331563.123456}`.
impl Serialize for Origin {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let utc = humantime::format_rfc3339_micros(UNIX_EPOCH + self.0);
        let mut map = serializer.serialize_map(Some(2))?;
        map.serialize_entry("utc", &utc.to_string())?;
        map.serialize_entry("unix_seconds", &self.0.as_secs_f64())?;
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn origins_show_utc_and_the_stamp_of_the_log() {
        let origin = Origin::from_micros(1_795_331_563_123_456);
        assert_eq!(origin.to_string(), "2026-11-22T07:12:43.123456Z (1795331563.123456)");
        assert_eq!(origin.compact(), "20261122T071243Z");
        assert_eq!(origin.as_micros(), 1_795_331_563_123_456);
        assert_eq!(
            serde_json::to_string(&origin).unwrap(),
            r#"{"utc":"2026-11-22T07:12:43.123456Z","unix_seconds":1795331563.123456}"#
        );
    }
}
