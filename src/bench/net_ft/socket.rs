//! Socket of a sensor: reads until it is empty, and sends the requests that are due. Never waits.

use std::io::{self, ErrorKind};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, UdpSocket};
use std::time::Duration;

use crate::rdt::{Record, Request};
use crate::reader::{Condition, Counts, Reader, Reading};
use units::time::Instant;

/// Maximum number of datagrams per read. At 7,000 records per second, seven arrive per millisecond. After a pause, a
/// socket of the usual size contains up to 280, which two reads empty.
pub const MAX_DATAGRAMS: usize = 256;

/// Minimum time between two log lines for the same sensor.
const REPORT_PERIOD: Duration = Duration::from_millis(100);

/// Change that is logged.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SensorEvent {
    /// Change in the condition of its records.
    Condition(SocketAddr, Condition),
    /// Datagrams come from another address or port.
    Foreign(SocketAddr, SocketAddr),
    /// Request that cannot be sent.
    Unsent(SocketAddr, String),
}

impl SensorEvent {
    /// Writes the line.
    pub fn log(&self) {
        match self {
            Self::Condition(sensor, Condition::Valid) => {
                tracing::info!("{sensor}: the force/torque sensor streams");
            }
            Self::Condition(sensor, Condition::Silent) => tracing::warn!(
                "{sensor}: no new record of the force/torque sensor; is it on, is the address its own, does another program \
                 read it? Requests them every 100 ms"
            ),
            Self::Condition(sensor, Condition::Invalid(status)) => tracing::warn!(
                "{sensor}: the force/torque sensor has status {status:08X}h: its readings are invalid"
            ),
            Self::Foreign(sensor, source) => tracing::warn!(
                "{sensor}: drops datagrams from {source}, which is not the force/torque sensor"
            ),
            Self::Unsent(sensor, error) => {
                tracing::warn!(
                    "{sensor}: cannot send a request to the force/torque sensor: {error}"
                );
            }
        }
    }
}

/// Reader of a sensor with its socket.
#[derive(Debug)]
pub struct NetFt {
    socket: UdpSocket,
    reader: Reader,
    reported_condition: Option<Condition>,
    reported_foreign: Option<SocketAddr>,
    /// Error of the newest request.
    error: Option<String>,
    /// Earliest time of the next line.
    report_at: Instant,
    event: Option<SensorEvent>,
}

impl NetFt {
    /// Opens a socket at a free port. The first read sends the request to the sensor.
    ///
    /// # Errors
    /// Returns an error if the system refuses the socket.
    pub fn open(reader: Reader, now: Instant) -> io::Result<Self> {
        // Not connected: a connected socket hides foreign datagrams, which can explain a silent sensor.
        let any: IpAddr = match reader.sensor() {
            SocketAddr::V4(_) => Ipv4Addr::UNSPECIFIED.into(),
            SocketAddr::V6(_) => Ipv6Addr::UNSPECIFIED.into(),
        };
        let socket = UdpSocket::bind((any, 0))?;
        socket.set_nonblocking(true)?;
        Ok(Self {
            socket,
            reader,
            reported_condition: None,
            reported_foreign: None,
            error: None,
            report_at: now + REPORT_PERIOD,
            event: None,
        })
    }

    /// Reads the waiting datagrams, at most [`MAX_DATAGRAMS`], and sends the requests that are due. Returns the newest reading.
    pub fn read(&mut self, now: Instant) -> Reading {
        self.receive(now);
        for request in self.reader.requests(now) {
            self.send(request);
        }
        self.narrate(now);
        self.reader.reading()
    }

    /// Requests the sensor to stop its records.
    pub fn stop(&mut self) {
        self.send(Request::Stop);
    }

    /// Returns the condition of the records at `now`.
    pub fn condition(&self, now: Instant) -> Condition {
        self.reader.condition(now)
    }

    /// Returns the counts of records, datagrams and requests since the start.
    pub const fn counts(&self) -> &Counts {
        self.reader.counts()
    }

    /// Returns the newest change, once.
    pub const fn event(&mut self) -> Option<SensorEvent> {
        self.event.take()
    }

    fn receive(&mut self, now: Instant) {
        // One byte longer than a record, to detect longer datagrams.
        let mut buffer = [0; Record::LENGTH + 1];
        for _ in 0..MAX_DATAGRAMS {
            match self.socket.recv_from(&mut buffer) {
                Ok((length, source)) => {
                    let bytes = buffer.get(..length).unwrap_or_default();
                    self.reader.on_datagram(now, source, bytes);
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => {
                    return self.reader.on_empty(now);
                }
                // An interruption or a temporary failure: the next read takes the waiting datagrams.
                Err(_) => return,
            }
        }
    }

    fn send(&mut self, request: Request) {
        let sent = self.socket.send_to(&request.encode(), self.reader.sensor());
        self.error = sent.err().map(|error| error.to_string());
    }

    /// Stores a change, unless the last one is newer than [`REPORT_PERIOD`].
    fn narrate(&mut self, now: Instant) {
        if now < self.report_at {
            return;
        }
        let (sensor, foreign) = (self.reader.sensor(), self.reader.foreign());
        let condition = self.reader.condition(now);
        let event = if self.reported_condition != Some(condition) {
            self.reported_condition = Some(condition);
            let error = self.error.clone().filter(|_| condition == Condition::Silent);
            error.map_or(SensorEvent::Condition(sensor, condition), |error| {
                SensorEvent::Unsent(sensor, error)
            })
        } else if let Some(source) = foreign
            && self.reported_foreign != foreign
        {
            self.reported_foreign = foreign;
            SensorEvent::Foreign(sensor, source)
        } else {
            return;
        };
        self.event = Some(event);
        self.report_at = now + REPORT_PERIOD;
    }
}

#[cfg(test)]
mod tests;
