//! Real force/torque sensor of `[remote.link.sensor]`, instead of the simulated one.

use anyhow::Context;
use serde_json::{Value, json};

use config::{Config, NetFtSensor};
use net_ft::reader::{Condition, Counts, Reader};
use net_ft::scale::Scale;
use net_ft::socket::NetFt;
use run::exit::{Failure, Kind, OrFail};
use testbench::far_robot::RobotLimits;
use units::time::Instant;

/// Opens the sensor of a configuration; `None` if not configured.
pub(super) fn opened(config: &Config, bias: bool, now: Instant) -> Result<Option<NetFt>, Failure> {
    let Some(NetFtSensor { address, counts_per_n, counts_per_nm }) = config.far_side.sensor else {
        return if bias { Err(no_sensor(config)) } else { Ok(None) };
    };
    let scale = Scale::new(counts_per_n, counts_per_nm).or_fail(Kind::Configuration)?;
    let max_wait = config.period * RobotLimits::default().max_missed_readings;
    let mut reader = Reader::new(address, scale, max_wait, now);
    if bias {
        reader.bias();
    }
    let opened = NetFt::open(reader, now);
    let opened = opened.with_context(|| format!("{address}: cannot open a UDP socket"));
    opened.map(Some).or_fail(Kind::Bus)
}

/// Returns the failure of `--bias` without a sensor.
fn no_sensor(config: &Config) -> Failure {
    let reason = "remote.link.sensor: absent; --bias is for a sensor at an address of its own";
    Failure::new(Kind::Configuration, format!("{}: {reason}", config.file.display()))
}

/// Condition of a real force/torque sensor, and counts of its records.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SensorStatus {
    condition: Condition,
    counts: Counts,
}

impl SensorStatus {
    pub(super) fn new(sensor: &NetFt, now: Instant) -> Self {
        Self { condition: sensor.condition(now), counts: *sensor.counts() }
    }

    /// Returns the condition and all counts above 0, for a line of text.
    pub(super) fn text(&self) -> String {
        let counts = self.named().into_iter().filter(|(_, count)| *count > 0);
        let counts = counts.map(|(name, count)| format!(", {name} {count}")).collect::<String>();
        format!("  sensor {}{counts}", self.condition)
    }

    /// Returns the status as an object.
    pub(super) fn json(&self) -> Value {
        let counts = self.named().into_iter().map(|(name, count)| (name.to_owned(), json!(count)));
        let condition =
            std::iter::once(("condition".to_owned(), json!(self.condition.to_string())));
        Value::Object(condition.chain(counts).collect())
    }

    fn named(&self) -> [(&'static str, u64); 9] {
        let Counts {
            records,
            lost,
            overtaken,
            frozen,
            waited,
            invalid,
            malformed,
            foreign,
            requests,
        } = self.counts;
        [
            ("records", records),
            ("lost", lost),
            ("overtaken", overtaken),
            ("frozen", frozen),
            ("waited", waited),
            ("invalid", invalid),
            ("malformed", malformed),
            ("foreign", foreign),
            ("requests", requests),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(condition: Condition) -> SensorStatus {
        let counts = Counts { records: 70, lost: 2, requests: 1, ..Counts::default() };
        SensorStatus { condition, counts }
    }

    #[test]
    fn status_has_the_condition_and_the_counts() {
        let text = status(Condition::Invalid(0x8001_0000)).text();
        assert_eq!(text, "  sensor status 80010000h, records 70, lost 2, requests 1");
        let json = status(Condition::Silent).json();
        assert_eq!((&json["condition"], &json["lost"]), (&json!("silent"), &json!(2)));
        assert_eq!((&json["foreign"], json.as_object().unwrap().len()), (&json!(0), 10));
    }
}
