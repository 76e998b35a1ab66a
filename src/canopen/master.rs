//! The NMT master: boots every node of every bus, starts them, and then watches them.
//!
//! The cyclic exchange is not here; TPDOs are passed over at once. Nor is any decision: what is heard
//! is an [`Event`], what follows from it is `node::safety`'s. The bus does not hand a master its own
//! frames, so a command, a SYNC or an RPDO that is heard is somebody else's.
//!
//! Once the network runs, nothing but guarding is sent in a burst: what the master wants of a node by
//! SDO waits in an outbox, of which the cycle [releases](Master::release) one frame at a time.

use std::collections::VecDeque;

use canopen_rs::NmtCommand;
use canopen_rs::NmtState;
use canopen_rs::nmt::HEARTBEAT_COB_BASE;
use canopen_rs::sdo::SDO_RESPONSE_COB_BASE;

use crate::canopen::boot_error::Problem;
use crate::canopen::commission::PATIENCE;
use crate::canopen::emcy;
use crate::canopen::emcy::Emergency;
use crate::canopen::event::Event;
use crate::canopen::frame::Channel;
use crate::canopen::frame::Frame;
use crate::canopen::frame::Telegram;
use crate::canopen::heartbeat::Health;
use crate::canopen::heartbeat::News;
use crate::canopen::layout::Direction;
use crate::canopen::nmt;
use crate::canopen::nmt::Order;
use crate::canopen::plan::NodePlan;
use crate::canopen::slave::Report;
use crate::canopen::slave::Slave;
use crate::canopen::strangers::Strangers;
use crate::canopen::sync;
use crate::time::Instant;

/// Events and frames that may wait for whoever owns the master; more are lost.
const QUEUE: usize = 64;

/// The master of all nodes on all buses.
#[derive(Clone, Debug)]
pub struct Master {
    slaves: Vec<Slave>,
    strangers: Strangers,
    phase: Phase,
    /// What one node wants sent; kept, so that nothing is allocated later.
    frames: Vec<Frame>,
    /// What waits for its cycle while the network runs.
    outbox: VecDeque<Telegram>,
    /// What has not been told yet.
    events: VecDeque<Event>,
}

/// How far they all are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Booting,
    /// Told to start; all must have said they did until then.
    Starting(Instant),
    Running,
    /// Not all of them could be booted.
    Failed,
}

impl Master {
    /// A master that begins to boot with the first call of [`on_time`](Self::on_time).
    pub fn new(plans: Vec<(Channel, NodePlan)>) -> Self {
        let strangers = Strangers::to(&plans);
        let slaves = plans.into_iter().map(|(channel, plan)| Slave::new(channel, plan));
        Self {
            slaves: slaves.collect(),
            strangers,
            phase: Phase::Booting,
            frames: Vec::with_capacity(8),
            outbox: VecDeque::with_capacity(QUEUE),
            events: VecDeque::with_capacity(QUEUE),
        }
    }

    /// Boots every node again, as after power-up.
    pub fn restart(&mut self) {
        self.slaves.iter_mut().for_each(Slave::restart);
        self.outbox.clear();
        self.events.clear();
        self.phase = Phase::Booting;
    }

    /// Whether a node is still to be booted or started; false once it is known how that went.
    pub fn is_booting(&self) -> bool {
        match self.phase {
            Phase::Booting | Phase::Starting(_) => true,
            Phase::Running | Phase::Failed => false,
        }
    }

    /// What is known of a node, by its place in the list of plans.
    pub fn health(&self, node: usize) -> Option<Health> {
        self.slaves.get(node).map(Slave::health)
    }

    /// Takes one received frame; telegrams to send are appended to `out`.
    pub fn on_frame(
        &mut self,
        now: Instant,
        telegram: &Telegram,
        out: &mut Vec<Telegram>,
    ) -> Option<Event> {
        let Telegram { channel, frame } = *telegram;
        match frame.cob_id & FUNCTION {
            // TPDO1 to TPDO4 of the predefined connection set: the cycle's.
            0x180 | 0x280 | 0x380 | 0x480 => return None,
            _ if frame.is_remote() => return None,
            SDO_RESPONSE_COB_BASE | HEARTBEAT_COB_BASE => self.answer(now, channel, &frame, out),
            _ if self.is_ours_alone(channel, &frame) => {
                self.tell(Event::ForeignMaster { channel, frame });
            }
            _ => self.emergency(now, channel, &frame, out),
        }
        if let Some(node_id) = self.strangers.heard(channel, &frame) {
            self.tell(Event::Stranger { channel, node_id });
        }
        self.proceed(now, out);
        self.events.pop_front()
    }

    /// Does what is due. It says one thing at a time: call it until its deadline lies ahead.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) -> Option<Event> {
        for place in 0..self.slaves.len() {
            let Some(slave) = self.slaves.get_mut(place) else { continue };
            let report = slave.on_time(now, &mut self.frames);
            self.after(now, place, report, out);
        }
        self.proceed(now, out);
        self.events.pop_front()
    }

    /// When [`on_time`](Self::on_time) must next be called.
    pub fn deadline(&self) -> Option<Instant> {
        let start = match self.phase {
            Phase::Starting(until) => Some(until),
            Phase::Booting | Phase::Running | Phase::Failed => None,
        };
        let untold = (!self.events.is_empty()).then_some(Instant::ZERO);
        let slaves = self.slaves.iter().filter_map(Slave::deadline);
        slaves.chain(start).chain(untold).min()
    }

    /// The next frame that has waited for its cycle, the oldest first.
    pub fn release(&mut self) -> Option<Telegram> {
        self.outbox.pop_front()
    }

    /// Reads what a node remembers of its errors, by its place in the list of plans; an
    /// [`Event::ErrorHistory`] tells it. A node that cannot be asked now is not.
    pub fn read_history(&mut self, now: Instant, node: usize, out: &mut Vec<Telegram>) {
        if let Some(slave) = self.slaves.get_mut(node) {
            slave.read_history(now, &mut self.frames);
            self.after(now, node, None, out);
        }
    }

    /// For an orderly stop, after torque and power are off: every node back to pre-operational.
    pub fn shut_down(&self, out: &mut Vec<Telegram>) {
        let order = NmtCommand::EnterPreOperational;
        out.extend(self.slaves.iter().map(|slave| telegram(slave, order)));
    }

    /// An SDO reply, a heartbeat, a boot-up message or an answer to guarding.
    fn answer(&mut self, now: Instant, channel: Channel, frame: &Frame, out: &mut Vec<Telegram>) {
        let node_id = frame.cob_id & !FUNCTION;
        let is_its =
            |slave: &Slave| slave.channel == channel && u16::from(slave.plan.node.raw()) == node_id;
        let Some(place) = self.slaves.iter().position(is_its) else { return };
        let Some(slave) = self.slaves.get_mut(place) else { return };
        let report = slave.on_frame(now, frame, &mut self.frames);
        self.after(now, place, report, out);
    }

    /// Sends what a node's part of the master wants sent, and draws the conclusion of its report.
    fn after(
        &mut self,
        now: Instant,
        place: usize,
        report: Option<Report>,
        out: &mut Vec<Telegram>,
    ) {
        let Some(slave) = self.slaves.get_mut(place) else { return };
        let channel = slave.channel;
        let is_paced = self.phase == Phase::Running;
        for frame in self.frames.drain(..) {
            let telegram = Telegram { channel, frame };
            if !is_paced || frame.is_remote() {
                out.push(telegram);
            } else if self.outbox.len() < QUEUE {
                self.outbox.push_back(telegram);
            }
        }
        let node = place;
        match report {
            None => {}
            Some(Report::Configured(configuration)) => {
                if slave.is_late && !matches!(self.phase, Phase::Booting) {
                    let start = telegram(slave, NmtCommand::StartRemoteNode);
                    if is_paced { self.outbox.push_back(start) } else { out.push(start) }
                }
                self.tell(Event::Configured { node, configuration });
            }
            Some(Report::Failed(error)) => self.tell(Event::BootFailed(error)),
            Some(Report::Absent(waited)) => self.tell(Event::Absent { node, waited }),
            Some(Report::History(history)) => self.tell(Event::ErrorHistory { node, history }),
            Some(Report::News(news)) if slave.is_late => self.on_news_of_late(now, node, news),
            Some(Report::News(news)) => self.on_news(node, news),
        }
    }

    /// What is heard of an optional node on its way back to the others: nobody depends on it yet.
    fn on_news_of_late(&mut self, now: Instant, node: usize, news: News) {
        let Some(slave) = self.slaves.get_mut(node) else { return };
        match news {
            News::State(NmtState::Operational) => {
                slave.is_late = false;
                self.tell(Event::Joined { node });
            }
            News::State(_) => {}
            News::BootedUp | News::Rebooted | News::Lost => slave.look_again(now),
            News::Duplicate(sign) => self.tell(Event::Duplicate { node, sign }),
        }
    }

    /// What a heartbeat, or its absence, means: a failed boot until all run, an event from then on.
    fn on_news(&mut self, node: usize, news: News) {
        let Some(slave) = self.slaves.get_mut(node) else { return };
        let is_running = self.phase == Phase::Running;
        let (problem, event) = match news {
            News::State(_) if !is_running => return,
            News::State(state) => return self.tell(Event::StateChanged { node, state }),
            News::BootedUp | News::Rebooted => (Problem::Rebooted, Event::Rebooted { node }),
            News::Lost => (Problem::NoHeartbeat, Event::HeartbeatLost { node }),
            News::Duplicate(sign) => (Problem::Duplicate(sign), Event::Duplicate { node, sign }),
        };
        let event = if is_running { event } else { Event::BootFailed(slave.fail(problem)) };
        self.tell(event);
    }

    /// Goes on to the next phase if all nodes are ready for it.
    fn proceed(&mut self, now: Instant, out: &mut Vec<Telegram>) {
        let has_failed = self.slaves.iter().any(Slave::has_failed);
        match self.phase {
            Phase::Booting if self.slaves.iter().any(Slave::is_pending) => {}
            Phase::Booting if has_failed => self.phase = Phase::Failed,
            Phase::Booting => {
                self.phase = Phase::Starting(now + PATIENCE);
                let configured = self.slaves.iter().filter(|slave| slave.is_watched());
                out.extend(configured.map(|slave| telegram(slave, NmtCommand::StartRemoteNode)));
            }
            Phase::Starting(_) if !self.slaves.iter().any(Slave::is_starting) => {
                if has_failed {
                    self.phase = Phase::Failed;
                } else {
                    self.phase = Phase::Running;
                    self.tell(Event::Booted);
                }
            }
            Phase::Starting(until) if now >= until => {
                let late = self.slaves.iter_mut().find(|slave| slave.is_starting());
                let failed = late.map(|slave| Event::BootFailed(slave.fail(Problem::NotStarted)));
                failed.into_iter().for_each(|event| self.tell(event));
            }
            Phase::Starting(_) | Phase::Running | Phase::Failed => {}
        }
    }

    /// Has something to say; nobody hears of it if too much has not been heard yet.
    fn tell(&mut self, event: Event) {
        if self.events.len() < QUEUE {
            self.events.push_back(event);
        }
    }

    /// Whether only the master may send this.
    fn is_ours_alone(&self, channel: Channel, frame: &Frame) -> bool {
        let is_rpdo = |slave: &Slave| {
            slave.channel == channel
                && slave.plan.pdos.iter().any(|pdo| {
                    pdo.direction == Direction::Receive
                        && pdo.service.is_some()
                        && pdo.cob_id == frame.cob_id
                })
        };
        frame.cob_id == nmt::COB_ID
            || frame.cob_id == sync::COB_ID
            || self.slaves.iter().any(is_rpdo)
    }

    /// The emergency of one of the nodes, where it was planned to be or where it was before that.
    fn emergency(
        &mut self,
        now: Instant,
        channel: Channel,
        frame: &Frame,
        out: &mut Vec<Telegram>,
    ) {
        let is_its = |slave: &Slave| {
            let cob_ids = [slave.plan.emcy_cob_id, emcy::default_cob_id(slave.plan.node)];
            slave.channel == channel && cob_ids.contains(&frame.cob_id)
        };
        let Some(node) = self.slaves.iter().position(is_its) else { return };
        let Some(emergency) = Emergency::decode(frame.data()) else { return };
        self.tell(Event::Emergency { node, emergency });
        if !emergency.is_reset() {
            self.read_history(now, node, out);
        }
    }
}

/// The bits of a COB-ID that say what it is for; the others are the node-id.
const FUNCTION: u16 = 0x780;

fn telegram(slave: &Slave, command: NmtCommand) -> Telegram {
    let frame = Order::to(slave.plan.node, command).frame();
    Telegram { channel: slave.channel, frame }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::canopen::object::Object;
    use crate::canopen::plan::tests::elbow;
    use crate::canopen::plan::tests::switch_box;
    use crate::canopen::scripted::Scripted;
    use proptest::prelude::*;
    use std::time::Duration;

    const MS: Duration = Duration::from_millis(1);

    /// Nodes on two buses and their master; node 3 is on both.
    struct Bench {
        master: Master,
        devices: Vec<(Channel, Scripted)>,
        now: Instant,
        events: Vec<Event>,
        said: Vec<Telegram>,
    }

    fn plans() -> Vec<(Channel, NodePlan)> {
        vec![
            (Channel(0), elbow()),
            (Channel(1), NodePlan { name: "joint 6 (roll)".into(), ..elbow() }),
            (Channel(1), switch_box()),
        ]
    }

    impl Bench {
        fn new() -> Self {
            let plans = plans();
            let devices =
                plans.iter().map(|(channel, plan)| (*channel, Scripted::suiting(plan))).collect();
            let master = Master::new(plans);
            Self { master, devices, now: Instant::ZERO, events: vec![], said: vec![] }
        }

        fn booted() -> Self {
            let mut bench = Self::new();
            bench.run(300);
            assert_eq!(bench.events, [Event::Booted]);
            bench.events.clear();
            bench
        }

        /// Runs for so many milliseconds; devices that were told to send heartbeats do, every 25 ms.
        fn run(&mut self, ms: u64) {
            for _ in 0..ms {
                self.now = self.now + MS;
                for place in 0..self.devices.len() {
                    let (channel, device) = &self.devices[place];
                    let configured = device.objects[&Object::PRODUCER_HEARTBEAT] == [25, 0];
                    if configured && self.now.as_micros().is_multiple_of(25_000) {
                        let frame = device.heartbeat(device.state);
                        self.hear(*channel, frame);
                    }
                }
                for _ in 0..100 {
                    if self.master.deadline().is_none_or(|due| due > self.now) {
                        break;
                    }
                    let mut out = Vec::new();
                    let event = self.master.on_time(self.now, &mut out);
                    self.events.extend(event);
                    self.exchange(out);
                }
                assert!(self.master.deadline().is_none_or(|due| due > self.now), "no progress");
            }
        }

        fn hear(&mut self, channel: Channel, frame: Frame) {
            let mut out = Vec::new();
            let event = self.master.on_frame(self.now, &Telegram { channel, frame }, &mut out);
            self.events.extend(event);
            self.exchange(out);
        }

        /// Delivers what the master says, and what is answered.
        fn exchange(&mut self, mut out: Vec<Telegram>) {
            while !out.is_empty() {
                let telegram = out.remove(0);
                self.said.push(telegram);
                for place in 0..self.devices.len() {
                    let (channel, device) = &mut self.devices[place];
                    let answer = if *channel == telegram.channel {
                        device.answer(&telegram.frame)
                    } else {
                        None
                    };
                    if let Some(frame) = answer {
                        let heard = Telegram { channel: telegram.channel, frame };
                        self.events.extend(self.master.on_frame(self.now, &heard, &mut out));
                    }
                }
            }
        }

        fn failures(&self) -> Vec<String> {
            let failure = |event: &Event| {
                if let Event::BootFailed(error) = event { Some(error.to_string()) } else { None }
            };
            self.events.iter().filter_map(failure).collect()
        }

        fn was_started(&self) -> bool {
            self.said.iter().any(|t| t.frame.cob_id == 0 && t.frame.data().first() == Some(&1))
        }
    }

    #[test]
    fn every_node_of_every_bus_is_booted_and_started() {
        let bench = Bench::booted();
        assert!(bench.devices.iter().all(|(_, device)| device.state == 0x05));
        assert!(!bench.master.is_booting());
        let starts: Vec<_> =
            bench.said.iter().rev().take(3).map(|t| (t.channel, t.frame)).collect();
        let start = |node| Frame::new(0, [1, node]);
        assert_eq!(
            starts,
            [(Channel(1), start(16)), (Channel(1), start(3)), (Channel(0), start(3))]
        );
    }

    #[test]
    fn a_node_has_one_transfer_at_a_time() {
        let mut bench = Bench::new();
        bench.devices.clear();
        bench.run(1_950);
        for (channel, cob_id) in [(0, 0x603), (1, 0x603), (1, 0x610)] {
            let is_its = |t: &&Telegram| t.channel == Channel(channel) && t.frame.cob_id == cob_id;
            let requests = bench.said.iter().filter(is_its).filter_map(|t| t.frame.data().first());
            let commands: Vec<u8> = requests.copied().collect();
            assert_eq!(commands, [[0x40, 0x80]; 20].concat()[..39], "read, abort, read, abort ...");
        }
    }

    #[test]
    fn one_wrong_node_is_named_and_none_is_started() {
        let mut bench = Bench::new();
        bench.devices[1].1.objects.insert(Object::VENDOR_ID, vec![1, 0, 0, 0]);
        bench.run(3_000);
        let message = "joint 6 (roll), node 3: 1018h:1 is 00000001h, expected 00000F8Ch";
        assert_eq!(bench.failures(), [message]);
        assert!(!bench.was_started());
        assert!(!bench.master.is_booting());
    }

    #[test]
    fn every_missing_node_is_named() {
        let mut bench = Bench::new();
        bench.devices.clear();
        bench.run(3_000);
        assert_eq!(bench.failures().len(), 3);
        assert!(
            bench
                .failures()
                .iter()
                .all(|failure| failure.ends_with("does not answer, waited 2.0 s"))
        );
    }

    #[test]
    fn a_node_that_falls_silent_while_another_boots_is_a_failure() {
        let mut bench = Bench::new();
        bench.devices[0].1.deaf_for = 15;
        bench.run(500);
        bench.devices[2].1.objects.insert(Object::PRODUCER_HEARTBEAT, vec![0, 0]);
        bench.run(2_000);
        assert_eq!(bench.failures(), ["switch box, node 16: no heartbeat"]);
        assert!(!bench.was_started());
    }

    #[test]
    fn nodes_that_do_not_start_are_named() {
        let mut bench = Bench::new();
        while !bench.was_started() {
            bench.run(1);
        }
        bench.devices[0].1.state = 0x7F;
        bench.devices[2].1.state = 0x04;
        bench.run(2_100);
        let late = ["joint 3 (elbow), node 3", "switch box, node 16"];
        assert_eq!(
            bench.failures(),
            late.map(|name| format!("{name}: did not become operational"))
        );
        assert!(!bench.master.is_booting());
    }

    #[test]
    fn a_silent_node_is_lost_and_heard_again() {
        let mut bench = Bench::booted();
        let beat = bench.devices[1].1.objects.insert(Object::PRODUCER_HEARTBEAT, vec![0, 0]);
        bench.run(100);
        assert_eq!(bench.events, [Event::HeartbeatLost { node: 1 }]);
        bench.devices[1].1.objects.insert(Object::PRODUCER_HEARTBEAT, beat.unwrap());
        bench.run(100);
        let back = Event::StateChanged { node: 1, state: NmtState::Operational };
        assert_eq!(bench.events[1..], [back]);
    }

    #[test]
    fn all_nodes_lost_at_once_are_all_reported() {
        let mut bench = Bench::booted();
        bench.devices.clear();
        bench.run(100);
        assert_eq!(bench.events, [0, 1, 2].map(|node| Event::HeartbeatLost { node }));
    }

    #[test]
    fn a_reboot_is_no_mere_change_of_state() {
        let mut bench = Bench::booted();
        bench.hear(Channel(1), Frame::new(0x710, [0]));
        assert_eq!(bench.events, [Event::Rebooted { node: 2 }]);
        assert_eq!(bench.master.health(2), Some(Health::Alive(NmtState::PreOperational)));
    }

    #[test]
    fn an_emergency_is_known_by_its_bus_and_by_both_its_places() {
        let mut bench = Bench::booted();
        bench.master.slaves[1].plan.emcy_cob_id = 0x683;
        let data = [0x50, 0x82, 0x11, 0, 0, 0, 0, 0];
        for (channel, cob_id) in [(0, 0x83), (1, 0x83), (1, 0x683), (0, 0x683), (1, 0x84)] {
            bench.hear(Channel(channel), Frame::new(cob_id, data));
        }
        let emergency = Emergency::decode(&data).unwrap();
        assert_eq!(bench.events, [0, 1, 1].map(|node| Event::Emergency { node, emergency }));
    }

    #[test]
    fn whoever_else_commands_is_heard() {
        let mut bench = Bench::booted();
        let foreign =
            [Frame::new(0, [0x81, 0]), Frame::new(0x80, []), Frame::new(0x203, [0x0F, 0, 1, 0])];
        for frame in foreign {
            bench.hear(Channel(0), frame);
        }
        let channel = Channel(0);
        assert_eq!(bench.events, foreign.map(|frame| Event::ForeignMaster { channel, frame }));
    }

    #[test]
    fn the_cyclic_exchange_and_strangers_are_passed_over() {
        let mut bench = Bench::booted();
        bench.master.slaves[0].plan.pdos[0].cob_id = 0x310; // a TPDO, if not a predefined one
        let before = bench.said.len();
        for cob_id in [0x183, 0x283, 0x383, 0x483, 0x603, 0x583, 0x205, 0x310, 0x705, 0x7E4] {
            bench.hear(Channel(0), Frame::new(cob_id, [0; 8]));
        }
        assert_eq!((bench.events.len(), bench.said.len()), (0, before));
    }

    #[test]
    fn a_restart_configures_every_node_again() {
        let mut bench = Bench::booted();
        for (_, device) in &mut bench.devices {
            device.written.clear();
        }
        bench.master.restart();
        assert!(bench.master.is_booting());
        bench.run(300);
        assert_eq!(bench.events, [Event::Booted]);
        assert!(bench.devices.iter().all(|(_, device)| !device.written.is_empty()));
    }

    #[test]
    fn an_orderly_stop_reaches_every_node() {
        let mut bench = Bench::booted();
        let mut out = Vec::new();
        bench.master.shut_down(&mut out);
        bench.exchange(out);
        assert!(bench.devices.iter().all(|(_, device)| device.state == 0x7F));
    }

    proptest! {
        #[test]
        fn any_frames_at_any_time_neither_panic_nor_stop_time(
            is_booted in any::<bool>(),
            steps in proptest::collection::vec(
                (0_u64..40, 0_u8..3, 0_u16..0x800, proptest::collection::vec(any::<u8>(), 0..9)),
                0..50,
            ),
        ) {
            let mut bench = if is_booted { Bench::booted() } else { Bench::new() };
            for (ms, channel, cob_id, data) in steps {
                bench.run(ms);
                bench.hear(Channel(channel), Frame::from_slice(cob_id, &data).unwrap());
            }
            bench.run(8_000);
            prop_assert!(!bench.master.is_booting());
        }
    }
}
