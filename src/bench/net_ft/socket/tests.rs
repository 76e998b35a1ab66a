//! Tests of the socket with a fake sensor on the loopback interface.

use socket2::SockRef;

use super::*;
use crate::rdt::Record;
use crate::scale::Scale;
use units::spatial::Wrench;

const MAX_WAIT: Duration = Duration::from_millis(3);

/// Fake sensor, controlled by the test.
struct Sensor {
    socket: UdpSocket,
    reader: SocketAddr,
    sequence: u32,
}

impl Sensor {
    /// Opens both ends; the sensor has received the first request.
    fn and_reader() -> (Self, NetFt) {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        let mut net_ft = opened(socket.local_addr().unwrap());
        assert_eq!(net_ft.read(at(0)).number, 0);
        let (request, reader) = request(&socket);
        assert_eq!(request, Request::Stream.encode());
        (Self { socket, reader, sequence: 0 }, net_ft)
    }

    /// Sends records, each in the socket of the reader when this returns.
    fn send(&mut self, count: u32) {
        for _ in 0..count {
            self.sequence += 1;
            let (rdt_sequence, counts) = (self.sequence, [1_000_000, 0, 0, 0, 0, 2_000_000]);
            let record = Record { rdt_sequence, ft_sequence: rdt_sequence, status: 0, counts };
            self.socket.send_to(&record.encode(), self.reader).unwrap();
        }
    }
}

fn at(millis: u64) -> Instant {
    Instant::from_micros(1_000 * millis)
}

fn opened(sensor: SocketAddr) -> NetFt {
    let reader = Reader::new(sensor, Scale::new(1e6, 1e6).unwrap(), MAX_WAIT, at(0));
    NetFt::open(reader, at(0)).unwrap()
}

fn request(socket: &UdpSocket) -> ([u8; 8], SocketAddr) {
    let mut bytes = [0; 8];
    let (length, source) = socket.recv_from(&mut bytes).unwrap();
    assert_eq!(length, bytes.len());
    (bytes, source)
}

#[test]
fn read_empties_the_socket_and_returns_the_newest() {
    let (mut sensor, mut net_ft) = Sensor::and_reader();
    sensor.send(7);
    let wrench = Wrench::from_components([1.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
    assert_eq!(net_ft.read(at(1)), Reading { number: 6, wrench: Some(wrench) });
    assert_eq!(net_ft.read(at(2)).number, 6);
    sensor.send(7);
    assert_eq!(net_ft.read(at(3)).number, 13);
}

#[test]
fn read_takes_256_datagrams_and_the_next_one_the_rest() {
    let (mut sensor, mut net_ft) = Sensor::and_reader();
    // Space for about 500 datagrams, twice the default.
    SockRef::from(&net_ft.socket).set_recv_buffer_size(212_992).unwrap();
    sensor.send(260);
    net_ft.read(at(1));
    assert_eq!(net_ft.counts().records, 256);
    net_ft.read(at(2));
    assert_eq!(net_ft.counts().records, 260);
    assert_eq!(net_ft.condition(at(2)), Condition::Valid);
}

#[test]
fn longer_and_shorter_datagrams_are_no_records() {
    let (sensor, mut net_ft) = Sensor::and_reader();
    for length in [0, 8, 35, 37, 72, 1_400] {
        sensor.socket.send_to(&vec![0; length], sensor.reader).unwrap();
    }
    net_ft.read(at(1));
    assert_eq!((net_ft.counts().malformed, net_ft.counts().records), (6, 0));
}

#[test]
fn silent_sensor_is_reported_once_and_requested_again() {
    let (mut sensor, mut net_ft) = Sensor::and_reader();
    let address = sensor.socket.local_addr().unwrap();
    net_ft.read(at(99));
    assert_eq!(net_ft.event(), None);
    net_ft.read(at(100));
    assert_eq!(net_ft.event(), Some(SensorEvent::Condition(address, Condition::Silent)));
    net_ft.read(at(900));
    assert_eq!(net_ft.event(), None);
    for _ in 0..2 {
        assert_eq!(request(&sensor.socket).0, Request::Stream.encode());
    }
    sensor.send(2);
    net_ft.read(at(901));
    assert_eq!(net_ft.event(), Some(SensorEvent::Condition(address, Condition::Valid)));
}

#[test]
fn datagrams_of_another_port_are_reported() {
    let (mut sensor, mut net_ft) = Sensor::and_reader();
    let address = sensor.socket.local_addr().unwrap();
    let other = UdpSocket::bind("127.0.0.1:0").unwrap();
    sensor.send(2);
    net_ft.read(at(1));
    other.send_to(&[0; 36], sensor.reader).unwrap();
    sensor.send(1);
    net_ft.read(at(101));
    assert_eq!(net_ft.event(), Some(SensorEvent::Condition(address, Condition::Silent)));
    net_ft.read(at(700));
    let source = other.local_addr().unwrap();
    assert_eq!(net_ft.event(), Some(SensorEvent::Foreign(address, source)));
    net_ft.read(at(1_400));
    assert_eq!((net_ft.event(), net_ft.counts().foreign), (None, 1));
}

#[test]
fn stop_is_sent_to_the_sensor() {
    let (sensor, mut net_ft) = Sensor::and_reader();
    net_ft.stop();
    assert_eq!(request(&sensor.socket).0, Request::Stop.encode());
}

#[test]
fn address_that_cannot_be_reached_is_reported_with_the_reason() {
    // Broadcasts need a permission that the socket lacks.
    let mut net_ft = opened("255.255.255.255:49152".parse().unwrap());
    net_ft.read(at(0));
    net_ft.read(at(100));
    let event = net_ft.event().unwrap();
    assert!(matches!(event, SensorEvent::Unsent(..)), "{event:?}");
}
