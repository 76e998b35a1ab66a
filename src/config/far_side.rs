//! `[remote.link]` of a robot in another process: its socket, and the figures that it must have.

use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::time::Duration;

use crate::figure::{optional, required};
use crate::link::{HOLD_AFTER_MS, RemoteLink, millis};
use crate::model;
use crate::net_ft::{self, NetFtSensor};
use crate::problem::Problems;
use crate::raw;
use crate::remote::{given, has_model, is_both, is_link};
use crate::robots::RobotArm;
use crate::value::Optional;
use ::remote::delay::HOLD_AFTER;
use ::remote::model::Difference;
use ::remote::site::Virtual;
use ::remote::stated::StatedCapability;

/// Default number of the arm.
const DEFAULT_ARM: u16 = 1;

/// Range of the round trip, in ms. It ends at the largest maximum age of a sample.
const ROUND_TRIP_MS: RangeInclusive<f64> = 0.1..=100.0;

/// Range of the period of the far side's cycle, in ms.
const SAMPLE_PERIOD_MS: RangeInclusive<f64> = 0.1..=100.0;

/// Maximum of a force, moment or stiffness, in N, N·m and N/m.
const MAX_FIGURE: f64 = 1e9;

/// End of the message for a missing figure.
const NEEDED: &str = "a robot in another process needs: stability depends on it";

/// Settings of a robot in another process, behind the contract of docs/link.md.
#[derive(Clone, Debug, PartialEq)]
pub struct FarSide {
    /// Path of the socket, if configured.
    pub socket: Option<PathBuf>,
    /// Number of the arm, equal at both ends.
    pub arm: u16,
    /// Range of its force/torque sensor, in N and N·m, if stated.
    pub sensor_range: [Option<f64>; 2],
    /// Maximum contact force and moment at {MRF}, in N and N·m, if configured. Only the robot uses them, not the node.
    pub wrench_limit: [Option<f64>; 2],
    /// Age of the newest command after which the robot holds, if stated.
    pub hold_after: Option<Duration>,
    /// Network force/torque sensor in place of the simulated one. Only the robot uses it, not the node.
    pub sensor: Option<NetFtSensor>,
    /// Figures that the robot must have; `None` if the commanded side is in this process.
    pub agreement: Option<Agreement>,
    /// Difference to the predicted pose beyond which the robot counts as not following; `None` without a model.
    pub model_limit: Option<Difference>,
}

/// Figures of a robot in another process, used to check gains and limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agreement {
    /// Maximum round trip of a message and its echo, including the far side's cycle, at the 99th percentile.
    pub round_trip: Duration,
    /// Minimum capability.
    pub stated: StatedCapability,
}

/// Reads the keys. Returns `None` after a problem.
pub(super) fn read(
    file: &raw::File,
    period: Option<Duration>,
    link: Option<&RemoteLink>,
    remote: Option<&(Virtual, Option<RobotArm>)>,
    problems: &mut Problems<'_>,
) -> Option<FarSide> {
    let raw = &file.remote.link;
    let mut figure = |key: &Optional<f64>, range| optional(key, range, problems);
    let force = figure(&raw.sensor_range_n, 1e-3..=MAX_FIGURE);
    let moment = figure(&raw.sensor_range_nm, 1e-3..=MAX_FIGURE);
    let limit_force = figure(&raw.wrench_limit_n, 1e-3..=MAX_FIGURE);
    let limit_moment = figure(&raw.wrench_limit_nm, 1e-3..=MAX_FIGURE);
    let hold_after = figure(&raw.hold_after_ms, HOLD_AFTER_MS).map(|age| age.map(millis));
    let sample_period = figure(&raw.sample_period_ms, SAMPLE_PERIOD_MS);
    let stiffest = figure(&raw.stiffest_contact_n_per_m, 1.0..=MAX_FIGURE);
    let round_trip = figure(&raw.round_trip_ms, ROUND_TRIP_MS);
    let sensor = raw.sensor.as_ref().map(|sensor| net_ft::read(sensor, file, period, problems));
    let model_limit = model::limit(file, problems);
    let mut agreement = None;
    if is_link(&file.remote) {
        // A file with a model is that of the robot, too.
        if !has_model(&file.remote) {
            refuse_keys_of_the_robot(raw, problems);
        }
        let [name, stiffest_name] = ["round_trip_ms", "stiffest_contact_n_per_m"];
        let round_trip = required(&raw.round_trip_ms, name, NEEDED, round_trip, problems);
        let key = &raw.stiffest_contact_n_per_m;
        let stiffest = required(key, stiffest_name, NEEDED, stiffest, problems);
        let (round_trip, max_age) = (millis(round_trip?), link?.max_age);
        if round_trip > max_age {
            let reason = format_args!(
                "must be at most the maximum age of a sample, {:.1} ms: raise max_age_ms, at most to 100",
                max_age.as_secs_f64() * 1e3
            );
            problems.add(&raw.round_trip_ms, reason);
        }
        let (Virtual { interaction, servo, .. }, _) = remote?;
        let stated = StatedCapability {
            stiffest_contact: stiffest?,
            sample_period: sample_period?.map_or(f64::INFINITY, |period| period / 1e3),
            hold_after: hold_after?.unwrap_or(HOLD_AFTER).as_secs_f64(),
            sensor_range: [force?.unwrap_or(0.0), moment?.unwrap_or(0.0)],
            ..StatedCapability::from_interaction(interaction, servo)
        };
        model::check(model_limit?.as_ref(), servo, round_trip, raw, problems);
        agreement = Some(Agreement { round_trip, stated });
    }
    Some(FarSide {
        socket: raw.socket.as_ref().map(PathBuf::from),
        arm: raw.arm.or(DEFAULT_ARM).get()?,
        sensor_range: [force?, moment?],
        wrench_limit: [limit_force?, limit_moment?],
        hold_after: hold_after?,
        sensor: given(sensor)?,
        agreement,
        model_limit: model_limit?.filter(|_| is_both(&file.remote)),
    })
}

/// Refuses keys of the robot in the file of a node alone, where they would have no effect: the contract does not carry
/// them.
fn refuse_keys_of_the_robot(raw: &raw::RemoteLink, problems: &mut Problems<'_>) {
    for key in [&raw.wrench_limit_n, &raw.wrench_limit_nm] {
        if !key.is_absent() {
            let reason = "limits the robot itself, and this file is the node's: move it to the file of frhc robot";
            problems.add(key, reason);
        }
    }
    if let Some(sensor) = &raw.sensor {
        let reason = "is the robot's sensor, and this file is the node's: move the section to the file of frhc robot";
        problems.add(sensor, reason);
    }
}
