//! CANopen services of the master except PDOs: NMT, SDO, error control, SYNC, heartbeat, TIME.

use std::collections::VecDeque;

use crate::sdo_pacer::SdoPacer;
use canopen::frame::Channel;
use canopen::master::Master;
use canopen::master::event::Event;
use canopen::plan::NodePlan;
use canopen::{NmtState, heartbeat, sync, time_stamp};
use config::Config;

/// Maximum number of queued notices; further ones are dropped.
const MAX_NOTICES: usize = 64;

/// The master and its producers.
#[derive(Clone, Debug)]
pub(super) struct Network {
    pub(super) master: Master,
    pub(super) heartbeat: heartbeat::Producer,
    pub(super) sync: sync::Counter,
    /// Producer of TIME, if configured.
    pub(super) time_stamp: Option<time_stamp::Producer>,
    pub(super) sdo_pacer: SdoPacer,
    /// Network events for the log, oldest first.
    notices: VecDeque<Event>,
}

impl Network {
    /// Returns the master of the nodes of `plans`. Sends no frame.
    pub(super) fn new(config: &Config, plans: Vec<(Channel, NodePlan)>) -> Self {
        let producer = |period| time_stamp::Producer::new(time_stamp::COB_ID, period);
        Self {
            master: Master::new(plans),
            heartbeat: heartbeat::Producer::new(
                config.node_id,
                config.heartbeat,
                NmtState::Operational,
            ),
            sync: sync::Counter::new(config.sync_counter),
            time_stamp: config.time_period.map(producer),
            sdo_pacer: SdoPacer::new(),
            notices: VecDeque::with_capacity(MAX_NOTICES),
        }
    }

    /// Restarts the master's boot and the SYNC counter.
    pub(super) fn restart(&mut self) {
        self.master.restart();
        self.sync.restart();
    }

    /// Queues an event for the log.
    pub(super) fn note(&mut self, event: Event) {
        if self.notices.len() < MAX_NOTICES {
            self.notices.push_back(event);
        }
    }

    /// Takes the oldest queued event.
    pub(super) fn notice(&mut self) -> Option<Event> {
        self.notices.pop_front()
    }
}
