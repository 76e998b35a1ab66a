//! Robot in another process, as `frhc check` reports it.

use serde_json::{Value, json};

use crate::commanded_side;
use config::{Agreement, Config};

/// Returns the line on the figures that it must have; `None` where the commanded side is in this process.
pub(super) fn line(config: &Config) -> Option<String> {
    let Agreement { round_trip, stated } = config.far_side.agreement?;
    Some(format!(
        "far side   arm {} at {}, round trips of up to {:.1} ms, contacts of up to {:.0} N/m",
        config.far_side.arm,
        commanded_side::socket_of(config).display(),
        round_trip.as_secs_f64() * 1e3,
        stated.stiffest_contact
    ))
}

/// Returns the same for scripts. A figure for which anything will do is null.
pub(super) fn json(config: &Config) -> Value {
    let Some(Agreement { round_trip, stated }) = config.far_side.agreement else {
        return Value::Null;
    };
    let bounded = |most: f64| most.is_finite().then_some(most);
    json!({
        "arm": config.far_side.arm,
        "socket": commanded_side::socket_of(config),
        "round_trip_ms": round_trip.as_secs_f64() * 1e3,
        "stiffest_contact_n_per_m": stated.stiffest_contact,
        "max_sample_period_s": bounded(stated.sample_period),
        "max_hold_after_s": bounded(stated.hold_after),
        "min_sensor_range": stated.sensor_range,
        "max_servo_lag_s": stated.servo_lag,
        "max_speed": stated.max_speed,
        "payload_removal": stated.payload_removal.words(),
        "accommodation": stated.accommodation,
        "accommodation_deadband": stated.deadband,
    })
}
