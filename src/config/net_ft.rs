//! `[remote.link.sensor]`: network force/torque sensor that `frhc robot` reads in place of the simulated one.

use std::net::{IpAddr, SocketAddr};
use std::ops::RangeInclusive;
use std::time::Duration;

use crate::problem::Problems;
use crate::raw;
use crate::value::Value;

/// Default UDP port.
const DEFAULT_PORT: u16 = 49_152;

/// Default RDT output rate, in records per second, as the sensor is delivered.
const DEFAULT_RATE_HZ: f64 = 7_000.0;

/// Range of the RDT output rate, in records per second.
const RATE_HZ: RangeInclusive<f64> = 10.0..=8_000.0;

/// Range of records per cycle. Below one, readings are missing; the maximum is half of what the robot reads in a cycle.
const RECORDS_PER_CYCLE: RangeInclusive<f64> = 1.0..=128.0;

/// Range of counts per N or N·m.
const COUNTS: RangeInclusive<f64> = 1e-3..=1e9;

/// ATI Net F/T, or a sensor with its protocol.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NetFtSensor {
    /// Address and UDP port.
    pub address: SocketAddr,
    /// Counts of a force per N, as the sensor is set up.
    pub counts_per_n: f64,
    /// Counts of a moment per N·m, as the sensor is set up.
    pub counts_per_nm: f64,
}

/// Reads the section. Returns `None` after a problem.
pub(super) fn read(
    raw: &raw::RemoteSensor,
    file: &raw::File,
    period: Option<Duration>,
    problems: &mut Problems<'_>,
) -> Option<NetFtSensor> {
    let address = address(&raw.address, problems);
    let counts_per_n = problems.within(&raw.counts_per_n, COUNTS);
    let counts_per_nm = problems.within(&raw.counts_per_nm, COUNTS);
    let rate = raw.rate_hz.or(DEFAULT_RATE_HZ);
    let rate_hz = problems.within(&rate, RATE_HZ).filter(|rate| RATE_HZ.contains(rate));
    if let (Some(rate_hz), Some(period)) = (rate_hz, period)
        && !RECORDS_PER_CYCLE.contains(&(rate_hz * period.as_secs_f64()))
    {
        let reason = format_args!(
            "must be 1 to 128 records in each cycle of {} ms, got {rate_hz} per second: set the RDT output rate of the sensor, and \
             this key",
            period.as_secs_f64() * 1e3
        );
        problems.add(&rate, reason);
    }
    refuse_payload(file, problems);
    Some(NetFtSensor {
        address: address?,
        counts_per_n: counts_per_n?,
        counts_per_nm: counts_per_nm?,
    })
}

/// Reads an IP address with or without a port. A host name is refused, because it may come to mean another sensor.
fn address(value: &Value<String>, problems: &mut Problems<'_>) -> Option<SocketAddr> {
    let text = value.as_ref()?;
    let with_port = text.parse::<SocketAddr>().ok();
    let alone = text.parse::<IpAddr>().ok().map(|ip| SocketAddr::new(ip, DEFAULT_PORT));
    let address = with_port.or(alone).filter(is_of_one_sensor);
    if address.is_none() {
        let reason = format_args!(
            "must be the IP address of one sensor, with its UDP port unless that is {DEFAULT_PORT}, got \"{text}\""
        );
        problems.add(value, reason);
    }
    address
}

/// Returns whether an address is unicast and specified, with a port.
fn is_of_one_sensor(address: &SocketAddr) -> bool {
    let is_broadcast = matches!(address.ip(), IpAddr::V4(ip) if ip.is_broadcast());
    let is_unusable = address.ip().is_unspecified() || address.ip().is_multicast() || is_broadcast;
    !is_unusable && address.port() != 0
}

/// Refuses a payload. Its weight is removed by the posture of the simulated arm, but the real sensor does not turn with it.
fn refuse_payload(file: &raw::File, problems: &mut Problems<'_>) {
    if let Some(mass) = file.remote.mass_kg.get()
        && mass > 0.0
    {
        let reason = format_args!(
            "must be 0 with [remote.link.sensor], got {mass}: that sensor does not turn with the simulated arm; have it set its \
             load as zero by frhc robot --bias"
        );
        problems.add(&file.remote.mass_kg, reason);
    }
}
