//! CANopen services of the master except PDOs: NMT, SDO, error control, SYNC, heartbeat, TIME.

use std::collections::VecDeque;
use std::time::Duration;

use crate::guard_requests::GuardRequests;
use crate::sdo_pacer::SdoPacer;
use crate::target_readings::TargetReadings;
use canopen::frame::{Channel, Frame};
use canopen::master::Master;
use canopen::master::event::Event;
use canopen::plan::NodePlan;
use canopen::{NmtState, heartbeat, sync, time_stamp};
use config::Config;
use units::time::Instant;

/// Minimum time from the start of a boot to the first reset of a node. Within it another master that sends SYNC four
/// times a second is detected, and its nodes are not changed.
const RESET_DELAY: Duration = Duration::from_millis(250);

/// Maximum number of queued events; further ones are dropped.
const MAX_QUEUED_EVENTS: usize = 64;

/// Master, its producers of heartbeat, SYNC and TIME, and the events for the log.
#[derive(Clone, Debug)]
pub(super) struct Network {
    pub(super) master: Master,
    pub(super) heartbeat: heartbeat::Producer,
    pub(super) sync: sync::Counter,
    /// Producer of TIME, if configured.
    pub(super) time_stamp: Option<time_stamp::Producer>,
    pub(super) sdo_pacer: SdoPacer,
    pub(super) guard_requests: GuardRequests,
    /// Order in which the target torques of the drives are read.
    pub(super) targets: TargetReadings,
    /// Set once heartbeat and guarding have ended for all nodes, until the next boot.
    is_silent: bool,
    /// Network events for the log, oldest first.
    events: VecDeque<Event>,
}

impl Network {
    /// Returns the master of the nodes of `plans`. Sends no frame.
    pub(super) fn new(config: &Config, plans: Vec<(Channel, NodePlan)>) -> Self {
        let producer = |period| time_stamp::Producer::new(time_stamp::COB_ID, period);
        Self {
            guard_requests: GuardRequests::new(&plans, config.period),
            master: Master::new(plans).with_node_id(config.node_id),
            heartbeat: heartbeat::Producer::new(
                config.node_id,
                config.heartbeat,
                NmtState::Operational,
            ),
            sync: sync::Counter::new(config.sync_counter),
            time_stamp: config.time_period.map(producer),
            sdo_pacer: SdoPacer::new(),
            targets: TargetReadings::new(&config.exchange().tpdos),
            is_silent: false,
            events: VecDeque::with_capacity(MAX_QUEUED_EVENTS),
        }
    }

    /// Returns the heartbeat if one is due, unless error control has ended.
    pub(super) fn heartbeat(&mut self, now: Instant) -> Option<Frame> {
        if self.is_silent { None } else { self.heartbeat.due(now) }
    }

    /// Ends heartbeat and guarding for all nodes until the next boot, so that the drives' watchdogs expire.
    pub(super) fn end_error_control(&mut self) {
        self.is_silent = true;
        self.master.end_guarding();
        self.guard_requests.clear();
    }

    /// Stops guarding the drives, so that they must miss their master.
    pub(super) fn pause_guarding(&mut self) {
        self.master.pause_guarding();
        self.guard_requests.clear();
    }

    /// Returns whether heartbeat and guarding have ended for all nodes.
    pub(super) const fn is_silent(&self) -> bool {
        self.is_silent
    }

    /// Restarts the master's boot, error control and the SYNC counter.
    pub(super) fn restart(&mut self, now: Instant) {
        self.is_silent = false;
        self.guard_requests.clear();
        self.master.restart(now + RESET_DELAY);
        self.sync.restart();
    }

    /// Queues an event for the log.
    pub(super) fn queue_event(&mut self, event: Event) {
        if self.events.len() < MAX_QUEUED_EVENTS {
            self.events.push_back(event);
        }
    }

    /// Takes the oldest queued event.
    pub(super) fn next_event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }
}
