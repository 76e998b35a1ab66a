//! The socket of a bus: its filter, its deadlines and sleeps, an interface that is down, and the order of two buses.

use crate::common::prelude::*;

use bus::{BusEvent, SendError, SocketCan};

#[test]
fn socket_receives_data_frames_of_eleven_bits_alone() {
    let mut bus = SocketCan::open(&["vcan0".to_owned()]).unwrap();
    for frame in ["181#R", "00000181#1122", "181#1122334455667788"] {
        Process::start("cansend", &["vcan0", frame]).wait().succeeds();
    }
    let until = bus.now() + Duration::from_millis(5);
    let received = bus.receive(until).unwrap();
    let frame = Frame::new(0x181, [0x11, 0x22, 0x33, 0x44, 0x55, 0x66, 0x77, 0x88]);
    assert_eq!(received.event, BusEvent::Frame(frame));
    assert!(received.at <= bus.now());
    assert_eq!(bus.receive(until), None);
}

#[test]
fn late_frame_on_one_bus_delays_no_other_bus() {
    let names = ["vcan0", "vcan1"].map(str::to_owned);
    let (mut bus, mut other) = (SocketCan::open(&names).unwrap(), SocketCan::open(&names).unwrap());
    let frame =
        |channel| Telegram { channel: Channel(channel), frame: Frame::new(0x181, [channel]) };
    other.send(frame(1)).unwrap();
    let until = bus.now() + Duration::from_millis(1);
    other.receive(other.now() + Duration::from_millis(3));
    other.send(frame(0)).unwrap();
    let received = bus.receive(until).unwrap();
    assert_eq!((received.channel, received.event), (Channel(1), BusEvent::Frame(frame(1).frame)));
    assert_eq!(bus.receive(until), None, "the other came later");
    let later = bus.now() + Duration::from_millis(1);
    assert_eq!(bus.receive(later).unwrap().channel, Channel(0));
}

#[test]
fn frames_slept_over_come_in_the_order_of_both_buses() {
    let names = ["vcan0", "vcan1"].map(str::to_owned);
    let (mut bus, mut other) = (SocketCan::open(&names).unwrap(), SocketCan::open(&names).unwrap());
    let pause = Duration::from_micros(50);
    let begun = bus.now();
    let order = [(1, 1), (0, 2), (0, 3), (1, 4), (0, 5)];
    for (channel, number) in order {
        let frame = Frame::new(0x181, [number]);
        other.send(Telegram { channel: Channel(channel), frame }).unwrap();
        let until = other.now() + pause;
        while other.receive(until).is_some() {}
    }
    let (from, until) = (begun + Duration::from_millis(2), begun + Duration::from_millis(3));
    let mut now = bus.now();
    let mut received = Vec::new();
    for _ in order {
        let wake = bus.wait(now, from, until);
        let event = wake.received.unwrap();
        assert!(event.at < from, "kept its time");
        assert!(wake.now >= from && wake.now < until, "{:?}: all at once", wake.now);
        let BusEvent::Frame(frame) = event.event else { panic!("{event:?}") };
        received.push((event.channel.0, frame.data()[0]));
        now = wake.now;
    }
    assert_eq!(received, order);
    let wake = bus.wait(now, from, until);
    assert!(wake.received.is_none() && wake.now >= until, "{wake:?}");
}

#[test]
fn frame_received_after_the_end_of_a_slept_wait_is_kept() {
    let name = ["vcan0".to_owned()];
    let (mut bus, mut other) = (SocketCan::open(&name).unwrap(), SocketCan::open(&name).unwrap());
    let frame = |number| Telegram { channel: Channel(0), frame: Frame::new(0x181, [number]) };
    let begun = bus.now();
    other.send(frame(1)).unwrap();
    other.receive(begun + Duration::from_millis(4));
    other.send(frame(2)).unwrap();
    let [from, until] = [2, 3].map(|millis| begun + Duration::from_millis(millis));
    let now = bus.now();
    let first = bus.wait(now, from, until).received.map(|received| received.event);
    assert_eq!(first, Some(BusEvent::Frame(frame(1).frame)));
    assert_eq!(bus.wait(now, from, until).received, None, "the other came after the end");
    let second = bus.receive(bus.now()).map(|received| received.event);
    assert_eq!(second, Some(BusEvent::Frame(frame(2).frame)));
}

#[test]
fn interface_found_down_after_a_sleep_is_reported_once() {
    let mut bus = SocketCan::open(&["vcan1".to_owned()]).unwrap();
    Process::start("ip", &["link", "set", "vcan1", "down"]).wait().succeeds();
    let now = bus.now();
    let [from, until] = [1, 2].map(|millis| now + Duration::from_millis(millis));
    let wake = bus.wait(now, from, until);
    let event = wake.received.map(|received| received.event);
    assert_eq!(event, Some(BusEvent::Error(bus::BusError::Down)));
    let wake = bus.wait(wake.now, from, until);
    assert!(wake.received.is_none() && wake.now >= until, "{wake:?}");
    Process::start("ip", &["link", "set", "vcan1", "up"]).wait().succeeds();
}

#[test]
fn hazard_24_run_and_commission_refuse_an_interface_down() {
    let scratch = Scratch::new("down");
    Process::start("ip", &["link", "set", "vcan1", "down"]).wait().succeeds();
    for words in [&["run"][..], &["commission", "--prove"]] {
        let args = [words, &["--config", KRAFT, "-i", "vcan1"]].concat();
        let outcome = scratch.frhc(&args).wait();
        assert_eq!(outcome.code, Some(4), "{words:?}: {}", outcome.stderr);
        let reason = "vcan1: the interface is down (ip link set vcan1 up)";
        assert!(outcome.stderr.contains(reason), "{words:?}: {}", outcome.stderr);
    }
    Process::start("ip", &["link", "set", "vcan1", "up"]).wait().succeeds();
}

#[test]
fn receive_ends_at_its_deadline() {
    let mut bus = SocketCan::open(&["vcan0".to_owned()]).unwrap();
    bus::realtime::ask();
    for micros in [100, 1_000, 12_345] {
        let until = bus.now() + Duration::from_micros(micros);
        assert_eq!(bus.receive(until), None);
        let late = bus.now().since(until);
        assert!(bus.now() >= until && late < Duration::from_micros(10), "{late:?} late");
    }
}

#[test]
fn interface_that_goes_down_is_reported_and_accepts_no_frame() {
    let mut bus = SocketCan::open(&["vcan1".to_owned()]).unwrap();
    Process::start("ip", &["link", "set", "vcan1", "down"]).wait().succeeds();
    let telegram = Telegram { channel: Channel(0), frame: Frame::new(0x80, []) };
    let event = bus.receive(bus.now() + Duration::from_millis(5)).map(|received| received.event);
    assert_eq!(event, Some(BusEvent::Error(bus::BusError::Down)));
    assert_eq!(bus.send(telegram), Err(SendError::Down));
    Process::start("ip", &["link", "set", "vcan1", "up"]).wait().succeeds();
}
