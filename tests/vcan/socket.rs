//! The socket of a bus: its filter, its deadlines, an interface that is down, and the order of two buses.

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
