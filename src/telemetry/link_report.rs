//! Report on the link to a robot in another process, for `frhc ctl status`.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;

use remote::link::LinkStatus;

/// State and figures of the link.
#[derive(Clone, Debug, Serialize)]
pub struct LinkReport {
    /// Set if a process is connected.
    pub connected: bool,
    /// Session of this node, as 16 hexadecimal digits.
    pub session: String,
    /// Session of the far side; `None` before the first valid message.
    pub far_session: Option<String>,
    /// Node that the far side follows: `this node`, the session of another node, or `None`.
    pub leader: Option<String>,
    /// State of the far side, with its reason to hold.
    pub far_side: Option<String>,
    /// Reason why the far side's capability was rejected; `None` with a valid one, and before the first.
    pub invalid_capability: Option<String>,
    /// Median of the newest round trips, in ms.
    pub round_trip_p50_ms: Option<f64>,
    /// 99th percentile of the newest round trips, in ms.
    pub round_trip_p99_ms: Option<f64>,
    /// Lost messages of the far side.
    pub lost: u64,
    /// Commands dropped because the far side's queue was full.
    pub dropped: u64,
    /// Messages that had no effect, by reason.
    pub rejects: BTreeMap<String, u64>,
}

impl LinkReport {
    /// Creates the report of a status.
    pub fn from_status(status: &LinkStatus) -> Self {
        let session = |session: u64| (session != 0).then(|| format!("{session:016x}"));
        let leader = match session(status.leader) {
            Some(_) if status.leader == status.session => Some("this node".to_owned()),
            other => other,
        };
        let far_side = status.reason.map(|reason| match reason.state() {
            following @ contract::FarState::Following => following.to_string(),
            holding @ contract::FarState::Holding => format!("{holding}: {reason}"),
        });
        let milliseconds = |duration: Duration| duration.as_secs_f64() * 1e3;
        let [p50, p99] = status.round_trips.map_or([None; 2], |known| known.map(Some));
        Self {
            connected: status.is_connected,
            session: format!("{:016x}", status.session),
            far_session: session(status.far_session),
            leader,
            far_side,
            invalid_capability: status.invalid_capability.map(|invalid| invalid.to_string()),
            round_trip_p50_ms: p50.map(milliseconds),
            round_trip_p99_ms: p99.map(milliseconds),
            lost: status.lost,
            dropped: status.dropped,
            rejects: status.rejects.iter().map(|(reject, n)| (reject.to_string(), *n)).collect(),
        }
    }
}
