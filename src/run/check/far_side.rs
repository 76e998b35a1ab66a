//! Robot in another process, as `frhc check` reports it.

use serde_json::{Value, json};

use crate::commanded_side;
use config::{Agreement, Config};
use remote::model::Difference;

/// Returns lines about the figures that the robot must have; empty if the commanded side is in this process.
pub(super) fn lines(config: &Config) -> impl Iterator<Item = String> {
    let agreed = config.far_side.agreement.map(|Agreement { round_trip, stated }| {
        format!(
            "far side   arm {} at {}, round trips of up to {:.1} ms, a hold after {:.0} ms, contacts of up to {:.0} N/m",
            config.far_side.arm,
            commanded_side::socket_of(config).display(),
            round_trip.as_secs_f64() * 1e3,
            stated.hold_after * 1e3,
            stated.stiffest_contact
        )
    });
    let model = config.far_side.model_limit.map(|Difference { distance, angle }| {
        let (distance, angle) = (distance * 1e3, angle.to_degrees());
        format!("model      the robot within {distance:.1} mm and {angle:.1}° of its prediction")
    });
    agreed.into_iter().chain(model)
}

/// Returns the figures as JSON. A figure without a requirement is `null`.
pub(super) fn json(config: &Config) -> Value {
    let Some(Agreement { round_trip, stated }) = config.far_side.agreement else {
        return Value::Null;
    };
    let bounded = |most: f64| most.is_finite().then_some(most);
    let limit = config.far_side.model_limit;
    json!({
        "arm": config.far_side.arm,
        "socket": commanded_side::socket_of(config),
        "round_trip_ms": round_trip.as_secs_f64() * 1e3,
        "model_limit_m": limit.map(|limit| limit.distance),
        "model_limit_deg": limit.map(|limit| limit.angle.to_degrees()),
        "stiffest_contact_n_per_m": stated.stiffest_contact,
        "max_sample_period_s": bounded(stated.sample_period),
        "max_hold_after_s": stated.hold_after,
        "min_sensor_range": stated.sensor_range,
        "max_servo_lag_s": stated.servo_lag,
        "max_speed": stated.max_speed,
        "payload_removal": stated.payload_removal.words(),
        "accommodation": stated.accommodation,
        "accommodation_deadband": stated.deadband,
    })
}
