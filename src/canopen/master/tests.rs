//! Tests of a master with several nodes on two buses, by its frames.

use std::time::Duration;

use canopen_rs::{NmtState, Value};
use proptest::prelude::*;

use super::*;
use crate::abort::AbortCode;
use crate::emcy::Emergency;
use crate::master::duplicate::Sign;
use crate::master::steps::Configuration;
use crate::object::Object;
use crate::plan::{BOOT_TIMEOUT, ShownMode};
use crate::testing::plans::{elbow, guarded_elbow, switch_box};
use crate::testing::scripted::ScriptedDevice;
use units::numbering::NodeIndex;

const MS: Duration = Duration::from_millis(1);

/// Nodes on two buses and their master; node-id 3 exists on both.
struct Bench {
    master: Master,
    devices: Vec<(Channel, ScriptedDevice)>,
    now: Instant,
    events: Vec<Event>,
    sent: Vec<Telegram>,
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
        Self::with_plans(plans())
    }

    /// Master with a scripted device for each of `plans`.
    fn with_plans(plans: Vec<(Channel, NodePlan)>) -> Self {
        let devices =
            plans.iter().map(|(channel, plan)| (*channel, ScriptedDevice::suiting(plan))).collect();
        let master = Master::new(plans);
        Self { master, devices, now: Instant::ZERO, events: vec![], sent: vec![] }
    }

    fn booted() -> Self {
        let mut bench = Self::new();
        bench.run(300);
        assert_eq!(bench.events.last(), Some(&Event::Booted));
        bench.events.clear();
        bench
    }

    /// Runs for `ms` milliseconds; configured devices send a heartbeat every 25 ms.
    fn run(&mut self, ms: u64) {
        for _ in 0..ms {
            self.now = self.now + MS;
            for place in 0..self.devices.len() {
                let (channel, device) = &self.devices[place];
                let configured = device.objects[&Object::PRODUCER_HEARTBEAT] == [25, 0];
                if configured && self.now.as_micros().is_multiple_of(25_000) {
                    let frame = device.heartbeat(device.state);
                    self.receive(*channel, frame);
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

    fn receive(&mut self, channel: Channel, frame: Frame) {
        let mut out = Vec::new();
        let event = self.master.on_frame(self.now, &Telegram { channel, frame }, &mut out);
        self.events.extend(event);
        self.exchange(out);
    }

    /// Runs like a cycle: releases one queued frame every millisecond.
    fn cycle(&mut self, ms: u64) {
        for _ in 0..ms {
            self.run(1);
            let released = self.master.release();
            self.exchange(released.into_iter().collect());
        }
    }

    /// Delivers the master's frames and the replies.
    fn exchange(&mut self, mut out: Vec<Telegram>) {
        while !out.is_empty() {
            let telegram = out.remove(0);
            self.sent.push(telegram);
            for place in 0..self.devices.len() {
                let (channel, device) = &mut self.devices[place];
                let answer = if *channel == telegram.channel {
                    device.answer(&telegram.frame)
                } else {
                    None
                };
                if let Some(frame) = answer {
                    let received = Telegram { channel: telegram.channel, frame };
                    self.events.extend(self.master.on_frame(self.now, &received, &mut out));
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
        self.sent.iter().any(|t| t.frame.cob_id == 0 && t.frame.data().first() == Some(&1))
    }
}

#[test]
fn every_node_of_every_bus_is_booted_and_started() {
    let bench = Bench::booted();
    assert!(bench.devices.iter().all(|(_, device)| device.state == 0x05));
    assert!(!bench.master.is_booting());
    let starts: Vec<_> = bench.sent.iter().rev().take(3).map(|t| (t.channel, t.frame)).collect();
    let start = |node| Frame::new(0, [1, node]);
    assert_eq!(starts, [(Channel(1), start(16)), (Channel(1), start(3)), (Channel(0), start(3))]);
}

#[test]
fn node_has_one_transfer_at_a_time() {
    let mut bench = Bench::new();
    bench.devices.clear();
    bench.run(1_950);
    for (channel, cob_id) in [(0, 0x603), (1, 0x603), (1, 0x610)] {
        let is_its = |t: &&Telegram| t.channel == Channel(channel) && t.frame.cob_id == cob_id;
        let requests = bench.sent.iter().filter(is_its).filter_map(|t| t.frame.data().first());
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
fn every_absent_node_is_named() {
    let mut bench = Bench::new();
    bench.devices.clear();
    bench.run(3_000);
    assert_eq!(bench.failures().len(), 3);
    assert!(
        bench.failures().iter().all(|failure| failure.ends_with("does not answer, waited 2.0 s"))
    );
}

#[test]
fn heartbeat_lost_while_another_node_boots_is_a_failure() {
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
    assert_eq!(bench.failures(), late.map(|name| format!("{name}: did not become operational")));
    assert!(!bench.master.is_booting());
}

#[test]
fn mode_refused_before_the_start_is_commanded_after_it() {
    let mut bench = Bench::new();
    bench.devices[0].1.takes_mode_late = true;
    while !bench.was_started() {
        bench.run(1);
    }
    assert!(!bench.devices[0].1.written.contains(&Object::MODE_OF_OPERATION));
    bench.run(100);
    assert_eq!(bench.events.last(), Some(&Event::Booted));
    assert_eq!(bench.devices[0].1.written.last(), Some(&Object::MODE_OF_OPERATION));
    assert_eq!(bench.devices[0].1.objects[&Object::MODE_OF_OPERATION], [10]);
}

#[test]
fn mode_refused_after_the_start_too_is_a_failure() {
    let mut bench = Bench::new();
    bench.devices[0].1.refuses.insert(Object::MODE_OF_OPERATION, AbortCode::DEVICE_STATE);
    bench.run(500);
    let failures = bench.failures();
    assert_eq!(failures.len(), 1, "{failures:?}");
    assert!(failures[0].starts_with("joint 3 (elbow), node 3: 6060h refused: 08000022h"));
    assert!(!bench.events.contains(&Event::Booted) && !bench.master.is_booting());
}

#[test]
fn torque_limits_are_raised_in_the_running_network() {
    let reduced_limits = vec![(Object::MAX_TORQUE, Value::Unsigned16(50))];
    let mut plans = plans();
    plans[0].1.shown_mode = ShownMode::WhenEnabled { reduced_limits };
    let mut bench = Bench::with_plans(plans);
    bench.run(300);
    assert_eq!(bench.events.last(), Some(&Event::Booted));
    assert_eq!(bench.devices[0].1.objects[&Object::MAX_TORQUE], [50, 0]);
    let planned = bench.devices[1].1.objects[&Object::MAX_TORQUE].clone();
    for forgets in [false, true] {
        bench.events.clear();
        if forgets {
            bench.devices[0].1.forgets.push(Object::MAX_TORQUE);
            bench.devices[0].1.objects.insert(Object::MAX_TORQUE, vec![50, 0]);
        }
        let mut out = Vec::new();
        assert!(bench.master.raise_limits(bench.now, NodeIndex(0), &mut out));
        assert!(!bench.master.raise_limits(bench.now, NodeIndex(0), &mut out), "one at a time");
        bench.exchange(out);
        bench.cycle(10);
        if forgets {
            assert!(bench.failures()[0].contains("6072h is 0032h"), "{:?}", bench.failures());
        } else {
            assert_eq!(bench.events, [Event::LimitsRaised { node: NodeIndex(0) }]);
            assert_eq!(bench.devices[0].1.objects[&Object::MAX_TORQUE], planned);
        }
    }
}

#[test]
fn lost_heartbeat_returns_as_a_state_change() {
    let mut bench = Bench::booted();
    let beat = bench.devices[1].1.objects.insert(Object::PRODUCER_HEARTBEAT, vec![0, 0]);
    bench.run(100);
    assert_eq!(bench.events, [Event::HeartbeatLost { node: NodeIndex(1) }]);
    bench.devices[1].1.objects.insert(Object::PRODUCER_HEARTBEAT, beat.unwrap());
    bench.run(100);
    let back = Event::StateChanged { node: NodeIndex(1), state: NmtState::Operational };
    assert_eq!(bench.events[1..], [back]);
}

#[test]
fn all_nodes_lost_at_once_are_all_reported() {
    let mut bench = Bench::booted();
    bench.devices.clear();
    bench.run(100);
    assert_eq!(bench.events, [0, 1, 2].map(NodeIndex).map(|node| Event::HeartbeatLost { node }));
}

#[test]
fn reboot_is_reported_as_such() {
    let mut bench = Bench::booted();
    bench.receive(Channel(1), Frame::new(0x710, [0]));
    assert_eq!(bench.events, [Event::Rebooted { node: NodeIndex(2) }]);
    assert_eq!(bench.master.health(NodeIndex(2)), Some(Health::Alive(NmtState::PreOperational)));
}

#[test]
fn emergency_is_matched_by_bus_and_both_cob_ids() {
    let mut bench = Bench::booted();
    bench.master.slaves[1].plan.emcy_cob_id = 0x683;
    let data = [0x50, 0x82, 0x11, 0, 0, 0, 0, 0];
    for (channel, cob_id) in [(0, 0x83), (1, 0x83), (1, 0x683), (0, 0x683), (1, 0x84)] {
        bench.receive(Channel(channel), Frame::new(cob_id, data));
    }
    let emergency = Emergency::decode(&data).unwrap();
    let emergencies = bench.events.iter().filter(|event| matches!(event, Event::Emergency { .. }));
    let expected = [0, 1, 1].map(NodeIndex).map(|node| Event::Emergency { node, emergency });
    assert!(emergencies.eq(&expected));
    let unknown = Event::UnknownNode { channel: Channel(1), node_id: 4 };
    assert_eq!(bench.events.last(), Some(&unknown));
}

#[test]
fn command_of_another_master_is_reported() {
    let mut bench = Bench::booted();
    let foreign =
        [Frame::new(0, [0x81, 0]), Frame::new(0x80, []), Frame::new(0x203, [0x0F, 0, 1, 0])];
    for frame in foreign {
        bench.receive(Channel(0), frame);
    }
    let channel = Channel(0);
    assert_eq!(bench.events, foreign.map(|frame| Event::ForeignMaster { channel, frame }));
}

#[test]
fn download_of_another_client_is_a_foreign_master() {
    let download = Frame::new(0x603, [0x2B, 0x00, 0x14, 5, 0, 0, 0, 0]);
    let by_blocks = Frame::new(0x603, [0xC2, 0x00, 0x14, 5, 0, 0, 0, 0]);
    let confirmed = Frame::new(0x583, [0x60, 0x00, 0x14, 5, 0, 0, 0, 0]);
    let mut bench = Bench::booted();
    let channel = Channel(0);
    for frame in [download, by_blocks, confirmed] {
        bench.receive(channel, frame);
        assert_eq!(bench.events, [Event::ForeignMaster { channel, frame }]);
        bench.events.clear();
    }
    bench.receive(channel, Frame::new(0x604, *download.data().first_chunk::<8>().unwrap()));
    assert_eq!(bench.events, [], "no node of this master");
}

#[test]
fn confirmations_of_own_downloads_are_not_foreign() {
    let mut bench = Bench::booted();
    let mut out = Vec::new();
    bench.master.power_off(bench.now, NodeIndex(0), &mut out);
    bench.master.power_off(bench.now, NodeIndex(0), &mut out);
    assert_eq!(out.len(), 2);
    let confirmed = Frame::new(0x583, [0x60, 0x40, 0x60, 0, 0, 0, 0, 0]);
    bench.receive(Channel(0), confirmed);
    bench.receive(Channel(0), confirmed);
    let is_foreign = |event: &Event| matches!(event, Event::ForeignMaster { .. });
    assert!(!bench.events.iter().any(is_foreign), "the first came after the second was sent");
    bench.events.clear();
    bench.receive(Channel(0), confirmed);
    let foreign = Event::ForeignMaster { channel: Channel(0), frame: confirmed };
    assert_eq!(bench.events, [foreign]);
}

#[test]
fn uploads_of_another_client_are_allowed_and_counted() {
    let mut bench = Bench::booted();
    for _ in 0..3 {
        bench.receive(Channel(0), Frame::new(0x603, [0x40, 0x41, 0x60, 0, 0, 0, 0, 0]));
        bench.receive(Channel(0), Frame::new(0x583, [0x4B, 0x41, 0x60, 0, 0x37, 2, 0, 0]));
    }
    bench.receive(Channel(0), Frame::new(0x603, [0xA4, 0x08, 0x10, 0, 21, 0, 0, 0]));
    bench.receive(Channel(0), Frame::new(0x583, [0x61, b'f', b'r', b'h', b'c', 0, 0, 0]));
    assert_eq!(bench.events, [Event::ReadByAnother { node: NodeIndex(0) }], "reported once");
    assert_eq!(bench.master.foreign_uploads(), 4);
}

#[test]
fn tpdos_and_unrelated_frames_are_ignored() {
    let mut bench = Bench::booted();
    bench.master.slaves[0].plan.pdos[0].cob_id = 0x310; // a TPDO, if not a predefined one
    let before = bench.sent.len();
    for cob_id in [0x183, 0x283, 0x383, 0x483, 0x605, 0x583, 0x205, 0x310, 0x585, 0x7E4] {
        bench.receive(Channel(0), Frame::new(cob_id, [0; 8]));
    }
    bench.receive(Channel(0), Frame::remote(0x80, 0));
    assert_eq!((bench.events.len(), bench.sent.len()), (0, before));
}

#[test]
fn restart_configures_every_node_again() {
    let mut bench = Bench::booted();
    for (_, device) in &mut bench.devices {
        device.written.clear();
    }
    bench.master.restart(bench.now);
    assert!(bench.master.is_booting());
    bench.run(300);
    assert_eq!(bench.events.last(), Some(&Event::Booted));
    assert!(bench.devices.iter().all(|(_, device)| !device.written.is_empty()));
}

#[test]
fn hazard_26_no_node_is_reset_before_a_master_could_be_found() {
    let mut bench = Bench::new();
    let listening = 250;
    bench.master.restart(bench.now + MS * listening);
    let is_command = |t: &Telegram| {
        let is_download = t.frame.cob_id & 0x780 == 0x600 && t.frame.data()[0] >> 5 == 1;
        t.frame.cob_id == 0 || is_download
    };
    bench.run(u64::from(listening) - 1);
    assert!(bench.sent.iter().any(|t| t.frame.cob_id == 0x603), "they are read");
    assert!(!bench.sent.iter().any(is_command));
    let sync = Frame::new(0x080, []);
    bench.receive(Channel(1), sync);
    assert_eq!(bench.events, [Event::ForeignMaster { channel: Channel(1), frame: sync }]);
    bench.run(300);
    assert!(bench.sent.iter().any(is_command), "the owner ends the boot, not the master");
}

#[test]
fn shutdown_sets_every_node_pre_operational() {
    let mut bench = Bench::booted();
    let mut out = Vec::new();
    bench.master.enter_pre_operational(&mut out);
    bench.exchange(out);
    assert!(bench.devices.iter().all(|(_, device)| device.state == 0x7F));
}

#[test]
fn origin_of_each_configuration_is_reported() {
    let mut bench = Bench::new();
    bench.devices[1].1 = ScriptedDevice::holding(&elbow());
    bench.run(300);
    for (node, configuration) in [
        (0, Configuration::Downloaded),
        (1, Configuration::Skipped),
        (2, Configuration::Downloaded),
    ] {
        assert!(
            bench.events.contains(&Event::Configured { node: NodeIndex(node), configuration }),
            "{node}"
        );
    }
    assert_eq!(bench.events.last(), Some(&Event::Booted));
}

#[test]
fn all_failures_are_reported_without_further_frames() {
    let mut bench = Bench::new();
    bench.devices.clear();
    bench.run(2_001);
    assert_eq!(bench.failures().len(), 3);
    assert!(!bench.master.is_booting());
}

/// Plans with an optional switch box.
fn with_optional_switches() -> Vec<(Channel, NodePlan)> {
    let mut plans = plans();
    plans[2].1.is_optional = true;
    plans
}

#[test]
fn absent_optional_node_joins_the_others_when_it_appears() {
    let mut bench = Bench::with_plans(with_optional_switches());
    let (channel, switches) = bench.devices.pop().unwrap();
    bench.run(2_300);
    let absent = Event::Absent { node: NodeIndex(2), waited: BOOT_TIMEOUT };
    assert!(bench.events.contains(&absent));
    assert_eq!(bench.events.last(), Some(&Event::Booted));
    bench.events.clear();
    bench.cycle(5_000);
    assert_eq!(bench.events, [], "reported once");

    let boot_up = switches.heartbeat(0);
    bench.devices.push((channel, switches));
    bench.receive(channel, boot_up);
    bench.cycle(300);
    let configuration = Configuration::Downloaded;
    assert_eq!(
        bench.events,
        [
            Event::Configured { node: NodeIndex(2), configuration },
            Event::Joined { node: NodeIndex(2) }
        ]
    );
    assert_eq!(bench.devices[2].1.state, 0x05);
    bench.cycle(500);
    bench.devices.pop();
    bench.events.clear();
    bench.cycle(100);
    assert_eq!(
        bench.events,
        [Event::HeartbeatLost { node: NodeIndex(2) }],
        "it counts as the others now"
    );
}

#[test]
fn optional_node_with_lost_boot_up_is_polled() {
    let mut bench = Bench::with_plans(with_optional_switches());
    let switches = bench.devices.pop().unwrap();
    bench.run(2_300);
    bench.devices.push(switches);
    bench.cycle(1_500);
    assert_eq!(bench.events.last(), Some(&Event::Joined { node: NodeIndex(2) }));
}

#[test]
fn optional_node_lost_during_its_boot_is_still_awaited() {
    let mut bench = Bench::with_plans(with_optional_switches());
    let (channel, switches) = bench.devices.pop().unwrap();
    bench.run(2_300);
    bench.events.clear();
    // It appears and is gone in the middle of its boot.
    let boot_up = switches.heartbeat(0);
    bench.devices.push((channel, switches));
    bench.receive(channel, boot_up);
    bench.cycle(3);
    let (channel, switches) = bench.devices.pop().unwrap();
    bench.cycle(8_000);
    assert_eq!(bench.events, [], "neither a failure nor reported again");
    bench.devices.push((channel, switches));
    bench.cycle(3_000);
    assert_eq!(bench.events.last(), Some(&Event::Joined { node: NodeIndex(2) }));
}

#[test]
fn wrong_optional_node_is_a_failure() {
    let mut bench = Bench::with_plans(with_optional_switches());
    bench.devices[2].1.objects.insert(Object::PRODUCT_CODE, vec![1, 0, 0, 0]);
    bench.run(2_300);
    assert_eq!(bench.failures().len(), 1);
    assert!(!bench.was_started());
}

#[test]
fn running_network_gets_one_queued_frame_per_cycle() {
    let mut bench = Bench::with_plans(with_optional_switches());
    let (channel, switches) = bench.devices.pop().unwrap();
    bench.run(2_300);
    bench.sent.clear();
    let boot_up = switches.heartbeat(0);
    bench.devices.push((channel, switches));
    bench.receive(channel, boot_up);
    bench.run(100);
    assert_eq!(bench.sent, [], "nothing goes out by itself");
    let (mut before, mut most) = (0, 0);
    for _ in 0..300 {
        bench.cycle(1);
        most = most.max(bench.sent.len() - before);
        before = bench.sent.len();
    }
    assert_eq!((most, bench.events.last()), (1, Some(&Event::Joined { node: NodeIndex(2) })));
}

#[test]
fn emergency_triggers_a_read_of_the_error_history() {
    let mut bench = Bench::booted();
    let device = &mut bench.devices[1].1;
    device.objects.insert(Object::ERROR_HISTORY, vec![2]);
    for (sub, code) in [(1, [0x50, 0x82, 0, 0]), (2, [0x10, 0x32, 0, 0])] {
        device.objects.insert(Object { sub, ..Object::ERROR_HISTORY }, code.to_vec());
    }
    bench.receive(Channel(1), Frame::new(0x83, [0x50, 0x82, 0x11, 0, 0, 0, 0, 0]));
    bench.receive(Channel(1), Frame::new(0x83, [0x10, 0x32, 0x15, 0, 0, 0, 0, 0]));
    bench.cycle(20);
    let histories: Vec<_> =
        bench.events.iter().filter(|e| matches!(e, Event::ErrorHistory { .. })).collect();
    let text = "error history (1003h): 8250h RPDO timeout, 3210h DC link over-voltage";
    assert_eq!(histories.len(), 1, "one reading at a time");
    assert_eq!(
        (histories[0].node(), histories[0].to_string().as_str()),
        (Some(NodeIndex(1)), text)
    );
    bench.events.clear();
    bench.receive(Channel(1), Frame::new(0x83, [0; 8]));
    bench.cycle(20);
    assert_eq!(bench.events.len(), 1, "a cleared error causes no read");
}

#[test]
fn two_nodes_with_one_node_id_are_reported() {
    let mut bench = Bench::booted();
    for _ in 0..20 {
        bench.run(25);
        bench.receive(Channel(0), Frame::new(0x703, [5]));
    }
    let sign = Sign::ExtraHeartbeats;
    assert_eq!(bench.events, [Event::Duplicate { node: NodeIndex(0), sign }]);
}

#[test]
fn guarded_node_is_polled_and_can_be_lost() {
    let mut plans = plans();
    plans[0].1 = guarded_elbow();
    let mut bench = Bench::with_plans(plans);
    bench.run(300);
    assert_eq!(bench.events.last(), Some(&Event::Booted));
    bench.events.clear();
    bench.sent.clear();
    bench.run(1_000);
    let polled = bench.sent.iter().filter(|t| t.frame == Frame::remote(0x703, 1)).count();
    assert_eq!((polled, bench.events.len()), (100, 0));
    bench.devices[0].1.deaf_for = u32::MAX;
    bench.run(40);
    assert_eq!(bench.events, [Event::HeartbeatLost { node: NodeIndex(0) }]);
}

#[test]
fn unknown_node_is_reported_once() {
    let mut bench = Bench::booted();
    for _ in 0..3 {
        bench.receive(Channel(0), Frame::new(0x709, [5]));
        bench.receive(Channel(1), Frame::new(0x703, [5]));
    }
    assert_eq!(bench.events, [Event::UnknownNode { channel: Channel(0), node_id: 9 }]);
}

proptest! {
    #[test]
    fn any_frames_never_panic_and_deadlines_advance(
        is_booted in any::<bool>(),
        is_optional in any::<bool>(),
        steps in proptest::collection::vec(
            (0_u64..40, 0_u8..3, cob_ids(), proptest::collection::vec(any::<u8>(), 0..9)),
            0..50,
        ),
    ) {
        let mut bench = if is_optional { Bench::with_plans(with_optional_switches()) } else { Bench::new() };
        if is_optional {
            bench.devices.pop();
        }
        if is_booted {
            bench.run(2_500);
            bench.events.clear();
        }
        for (ms, channel, cob_id, data) in steps {
            bench.run(ms);
            bench.receive(Channel(channel), Frame::from_slice(cob_id, &data).unwrap());
        }
        bench.run(8_000);
        prop_assert!(!bench.master.is_booting());
        let failed = !bench.failures().is_empty();
        let booted = bench.events.contains(&Event::Booted);
        prop_assert!(is_booted || booted != failed, "one outcome: {:?}", bench.events);
        let waiting = std::iter::from_fn(|| bench.master.release()).count();
        prop_assert!(waiting <= MAX_QUEUED);
    }
}

/// Any COB-ID, more often one that matters to this master.
fn cob_ids() -> impl Strategy<Value = u16> {
    let known = prop::sample::select(vec![
        0x000_u16, 0x080, 0x083, 0x090, 0x183, 0x203, 0x583, 0x590, 0x703, 0x710, 0x705,
    ]);
    prop_oneof![known, 0..0x800_u16]
}
