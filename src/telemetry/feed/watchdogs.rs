//! Margins to stops by missing samples, by the age of the commanded side's sample, by the difference between robot and
//! model, and by missing heartbeats.

use std::time::Duration;

use serde::Serialize;

use canopen::NodeId;
use canopen::frame::{Channel, Telegram};
use canopen::heartbeat::reports_state;
use config::Config;
use node::record::Record;
use remote::model::Difference;
use units::time::Instant;

/// Value that causes a stop at its limit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Watchdog {
    name: &'static str,
    /// Maximum since the last snapshot.
    value: f64,
    limit: f64,
    unit: &'static str,
}

/// Margins of the node's watches, computed from its records and the frames.
#[derive(Clone, Debug)]
pub(super) struct Watchdogs {
    /// Consecutive cycles without a sample of each joint.
    missing: [u32; 6],
    max_missing: u32,
    missing_limit: u32,
    max_age: Option<Duration>,
    age_limit: Duration,
    /// Maximum difference between robot and model, and its limit.
    model: Option<Difference>,
    model_limit: Option<Difference>,
    /// Error control of the nodes: heartbeat, or the answer to guarding.
    nodes: Vec<Beat>,
    /// Heartbeat of this node.
    master: Beat,
}

/// State reports of one node.
#[derive(Clone, Copy, Debug)]
struct Beat {
    channel: Option<Channel>,
    node: NodeId,
    /// Time without a report after which the node is lost; zero if it is not monitored.
    limit: Duration,
    last: Option<Instant>,
    longest: Duration,
}

impl Beat {
    fn is_from(&self, telegram: &Telegram) -> bool {
        let is_there = self.channel.is_none_or(|channel| channel == telegram.channel);
        is_there && reports_state(&telegram.frame, self.node)
    }

    /// Records that no report was received until `now`.
    fn wait(&mut self, now: Instant) {
        let waited = self.last.map_or(Duration::ZERO, |last| now.since(last));
        self.longest = self.longest.max(waited);
    }

    fn on_report(&mut self, at: Instant) {
        self.wait(at);
        self.last = Some(at);
    }

    /// Resets all reports.
    fn rest(&mut self) {
        (self.last, self.longest) = (None, Duration::ZERO);
    }

    /// Returns the longest time since the last call, as a share of the limit.
    fn share(&self) -> f64 {
        self.longest.as_secs_f64() / self.limit.as_secs_f64().max(1e-6)
    }

    fn watchdog(&self, name: &'static str) -> Watchdog {
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        Watchdog { name, value: ms(self.longest), limit: ms(self.limit), unit: "ms" }
    }
}

impl Watchdogs {
    /// Creates the watchdogs of a configuration.
    pub(super) fn new(config: &Config) -> Self {
        let (last, longest) = (None, Duration::ZERO);
        let beat = |channel, node, limit| Beat { channel, node, limit, last, longest };
        let plans = config.node_plans().into_iter();
        let nodes = plans.filter(|(_, plan)| plan.error_control.period_ms() > 0);
        let nodes = nodes
            .map(|(channel, plan)| beat(Some(channel), plan.node, plan.error_control.lost_after()));
        let master_lost = Duration::from_millis(config.safety.node_lost_ms.into());
        Self {
            missing: [0; 6],
            max_missing: 0,
            missing_limit: config.safety.missing_samples,
            max_age: None,
            age_limit: config.link.max_age,
            model: None,
            model_limit: config.far_side.model_limit,
            nodes: nodes.collect(),
            master: beat(None, config.node_id, master_lost),
        }
    }

    /// Resets all margins.
    pub(super) fn restart(&mut self) {
        (self.missing, self.max_missing) = ([0; 6], 0);
        (self.max_age, self.model) = (None, None);
        self.nodes.iter_mut().chain([&mut self.master]).for_each(Beat::rest);
    }

    /// Adds a frame.
    pub(super) fn on_frame(&mut self, at: Instant, telegram: &Telegram) {
        let beats = self.nodes.iter_mut().chain([&mut self.master]);
        beats.filter(|beat| beat.is_from(telegram)).for_each(|beat| beat.on_report(at));
    }

    /// Adds a cycle.
    pub(super) fn on_record(&mut self, record: &Record) {
        for (missing, is_sampled) in self.missing.iter_mut().zip(record.sampled) {
            *missing = if is_sampled { 0 } else { missing.saturating_add(1) };
            self.max_missing = self.max_missing.max(*missing);
        }
        self.max_age = self.max_age.max(record.sample_age);
        if let Some(difference) = record.model {
            self.model = Some(self.model.unwrap_or_default().max(difference));
        }
        self.nodes.iter_mut().chain([&mut self.master]).for_each(|beat| beat.wait(record.at));
        if record.mode.is_stopped() {
            // The node withholds its heartbeat as the last means to switch a drive off.
            self.master.rest();
        }
    }

    /// Takes the maxima since the last call.
    pub(super) fn take(&mut self) -> Vec<Watchdog> {
        let missing = Watchdog {
            name: "samples missing in a row",
            value: self.max_missing.into(),
            limit: self.missing_limit.into(),
            unit: "cycles",
        };
        let age = self.max_age.take().map(|age| Watchdog {
            name: "age of the commanded side",
            value: age.as_secs_f64() * 1e3,
            limit: self.age_limit.as_secs_f64() * 1e3,
            unit: "ms",
        });
        let models = self.model.take().zip(self.model_limit).map(model_watchdogs);
        let nearest = self.nodes.iter().max_by(|one, other| one.share().total_cmp(&other.share()));
        let nodes = nearest.map(|beat| beat.watchdog("heartbeats of the nodes"));
        let is_watched = self.master.limit > Duration::ZERO;
        let master = is_watched.then(|| self.master.watchdog("heartbeat of this node"));
        let [distance, angle] = models.map_or([None; 2], |models| models.map(Some));
        let found = [Some(missing), age, distance, angle, nodes, master];
        let found = found.into_iter().flatten().collect();
        self.max_missing = self.missing.into_iter().max().unwrap_or(0);
        self.nodes
            .iter_mut()
            .chain([&mut self.master])
            .for_each(|beat| beat.longest = Duration::ZERO);
        found
    }
}

fn model_watchdogs((most, limit): (Difference, Difference)) -> [Watchdog; 2] {
    [
        Watchdog {
            name: "distance of the robot to its model",
            value: most.distance * 1e3,
            limit: limit.distance * 1e3,
            unit: "mm",
        },
        Watchdog {
            name: "angle of the robot to its model",
            value: most.angle.to_degrees(),
            limit: limit.angle.to_degrees(),
            unit: "°",
        },
    ]
}
