//! SocketCAN: one raw socket per bus, all waited for at once.
//!
//! Error frames and 29-bit identifiers are told apart here and never become a [`Frame`]; remote frames
//! neither, but where [simulated devices](SocketCan::with_remote_frames) answer them. Time is
//! `CLOCK_MONOTONIC` since the bus was opened; a frame bears the kernel's receive stamp, so that a late
//! reader knows what is old.

use std::io;
use std::io::ErrorKind;
use std::os::fd::AsFd;
use std::os::fd::OwnedFd;
use std::time::Duration;
use std::time::UNIX_EPOCH;

use nix::errno::Errno;
use nix::poll::PollFd;
use nix::poll::PollFlags;
use nix::poll::ppoll;
use nix::sys::time::TimeSpec;
use socket2::SockAddr;
use socket2::Type;
use socketcan::CanAddr;
use socketcan::CanFilter;
use socketcan::CanFrame;
use socketcan::CanSocket;
use socketcan::EmbeddedFrame;
use socketcan::Id;
use socketcan::Socket;
use socketcan::SocketOptions;
use socketcan::StandardId;
use socketcan::addr::AF_CAN;
use socketcan::addr::CAN_RAW;
use socketcan::errors::ControllerProblems;
use socketcan::errors::ErrorCause;
use socketcan::id::CAN_EFF_FLAG;
use socketcan::id::CAN_RTR_FLAG;
use thiserror::Error;

use crate::bus::Bus;
use crate::bus::BusFault;
use crate::bus::Heard;
use crate::bus::Received;
use crate::bus::SendError;
use crate::bus::clock;
use crate::canopen::frame::Channel;
use crate::canopen::frame::Frame;
use crate::canopen::frame::Telegram;
use crate::time::Instant;

/// Most buses one node has.
const MOST: usize = 8;

/// What may wait in a socket before the driver takes it, in bytes: about a cycle of frames. More would
/// be a store of stale torques.
const SEND_BUFFER: usize = 8 << 10;

/// A stamp older than this is a clock that was set, not a frame that waited.
const OLDEST: Duration = Duration::from_secs(1);

/// Why no bus could be opened.
#[derive(Debug, Error)]
pub enum OpenError {
    /// This kernel has no CAN.
    #[error("{interface}: this kernel has no CAN (scripts/with_vcan.sh runs where it has not)")]
    NoCan { interface: String },
    /// There is no such interface.
    #[error("{0}: no such interface")]
    Absent(String),
    /// Anything else the kernel says.
    #[error("{interface}: {error}")]
    Failed { interface: String, error: io::Error },
    /// Too many at once.
    #[error("{0} buses; at most 8")]
    TooMany(usize),
}

/// Several SocketCAN interfaces under one clock.
#[derive(Debug)]
pub struct SocketCan {
    sockets: Vec<CanSocket>,
    opened: Duration,
    epoch: Duration,
    /// A frame that came after the deadline of the call that read it.
    held: Option<Received>,
    /// The bus looked at first, so that none is starved by another.
    first: usize,
}

impl SocketCan {
    /// Opens an interface for each bus, in the order of the channels.
    ///
    /// # Errors
    /// The first interface that cannot be opened. Nothing has been sent then.
    pub fn open(interfaces: &[String]) -> Result<Self, OpenError> {
        if interfaces.len() > MOST {
            return Err(OpenError::TooMany(interfaces.len()));
        }
        let sockets = interfaces.iter().map(|name| open(name).map_err(|error| why(name, error)));
        let sockets = sockets.collect::<Result<_, _>>()?;
        let opened = clock::monotonic();
        let epoch = clock::wall();
        Ok(Self { sockets, opened, epoch, held: None, first: 0 })
    }

    /// The same, hearing remote frames too: simulated devices answer them when they are guarded, or asked
    /// for a TPDO. A master hears no remote frame at all.
    ///
    /// # Errors
    /// The first interface that does not take the filter.
    pub fn with_remote_frames(self) -> Result<Self, OpenError> {
        for socket in &self.sockets {
            socket.set_filters(&[data_frames(), remote_frames()]).map_err(|error| {
                OpenError::Failed { interface: "remote frames".to_owned(), error }
            })?;
        }
        Ok(self)
    }

    /// The same, but what is sent here is heard here too, once it is on the bus: simulated devices are
    /// several that hear each other.
    ///
    /// # Errors
    /// The first interface that does not do so.
    pub fn hearing_itself(self) -> Result<Self, OpenError> {
        for socket in &self.sockets {
            socket
                .set_recv_own_msgs(true)
                .map_err(|error| OpenError::Failed { interface: "own frames".to_owned(), error })?;
        }
        Ok(self)
    }

    /// The wall clock when the bus was opened, in µs since 1970: what logs add to an [`Instant`].
    pub fn epoch_micros(&self) -> u64 {
        u64::try_from(self.epoch.as_micros()).unwrap_or(u64::MAX)
    }

    /// Waits until a socket can be read, `timeout` at most; its place.
    fn wait(&self, timeout: Duration) -> Option<usize> {
        let anchor = self.sockets.first()?.as_fd();
        let mut polled: [PollFd<'_>; MOST] = std::array::from_fn(|place| {
            let socket = self.sockets.get(place).map_or(anchor, CanSocket::as_fd);
            PollFd::new(socket, PollFlags::POLLIN)
        });
        let count = self.sockets.len();
        let polled = polled.get_mut(..count)?;
        match ppoll(polled, Some(TimeSpec::from_duration(timeout)), None) {
            Ok(ready) if ready > 0 => {
                let is_ready =
                    |place: &usize| polled.get(*place).and_then(PollFd::any).unwrap_or_default();
                (0..count).map(|turn| (self.first + turn) % count).find(is_ready)
            }
            // Nothing came, or a signal did: the caller looks at the clock.
            Ok(_) | Err(_) => None,
        }
    }

    /// Reads what is there; `None` if it was nothing that concerns a CANopen node.
    fn read(&mut self, place: usize) -> Option<Received> {
        self.first = place + 1;
        let channel = Channel(u8::try_from(place).unwrap_or(u8::MAX));
        let socket = self.sockets.get(place)?;
        let (at, heard) = match socket.read_frame_with_timestamps() {
            Ok((frame, stamps)) => {
                let stamp = stamps.socket.and_then(|at| at.duration_since(UNIX_EPOCH).ok());
                (self.instant_of(stamp), sort(frame)?)
            }
            Err(error) => (self.now(), Heard::Fault(trouble(&error)?)),
        };
        Some(Received { at, channel, heard })
    }

    /// The kernel's wall-clock stamp as an instant: now, less the age it shows.
    fn instant_of(&self, stamp: Option<Duration>) -> Instant {
        let wall = clock::wall();
        let age = stamp.and_then(|stamp| wall.checked_sub(stamp)).filter(|age| *age < OLDEST);
        self.now() - age.unwrap_or_default()
    }
}

impl Bus for SocketCan {
    fn now(&self) -> Instant {
        Instant::ZERO + clock::monotonic().saturating_sub(self.opened)
    }

    fn wall(&self) -> Duration {
        clock::wall()
    }

    fn send(&mut self, telegram: Telegram) -> Result<(), SendError> {
        let Channel(place) = telegram.channel;
        let socket = self.sockets.get(usize::from(place)).ok_or(SendError::Down)?;
        let id = StandardId::new(telegram.frame.cob_id).ok_or(SendError::Down)?;
        let frame = if telegram.frame.is_remote() {
            CanFrame::new_remote(id, usize::from(telegram.frame.length()))
        } else {
            CanFrame::new(id, telegram.frame.data())
        };
        let frame = frame.ok_or(SendError::Down)?;
        socket.write_frame(&frame).map_err(|error| {
            match error.raw_os_error().map(Errno::from_raw) {
                Some(Errno::EAGAIN | Errno::ENOBUFS) => SendError::Full,
                _ => SendError::Down,
            }
        })
    }

    fn receive(&mut self, until: Instant) -> Option<Received> {
        if let Some(held) = self.held {
            if held.at > until {
                return None;
            }
            self.held = None;
            return Some(held);
        }
        loop {
            let left = until.since(self.now());
            let is_late = left.is_zero();
            match self.wait(left) {
                Some(place) => {
                    let Some(received) = self.read(place) else { continue };
                    if received.at > until {
                        self.held = Some(received);
                        return None;
                    }
                    return Some(received);
                }
                None if is_late => return None,
                None => {}
            }
        }
    }
}

/// Data frames with 11 bits: the two flags are in the mask and not in the identifier.
fn data_frames() -> CanFilter {
    CanFilter::new(0, CAN_EFF_FLAG | CAN_RTR_FLAG)
}

/// Remote frames with 11 bits.
fn remote_frames() -> CanFilter {
    CanFilter::new(CAN_RTR_FLAG, CAN_EFF_FLAG | CAN_RTR_FLAG)
}

/// A socket that is set up before it hears anything.
fn open(interface: &str) -> io::Result<CanSocket> {
    let address = CanAddr::from_iface(interface)?;
    let raw = socket2::Socket::new_raw(AF_CAN.into(), Type::RAW, Some(CAN_RAW.into()))?;
    let socket = CanSocket::from(OwnedFd::from(raw));
    socket.set_filters(&[data_frames()])?;
    socket.set_error_filter_accept_all()?;
    socket.set_recv_timestamp(true)?;
    socket.as_raw_socket().set_send_buffer_size(SEND_BUFFER)?;
    socket.as_raw_socket().bind(&SockAddr::from(address))?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}

/// What an error of opening means.
fn why(interface: &str, error: io::Error) -> OpenError {
    let interface = interface.to_owned();
    match error.raw_os_error().map(Errno::from_raw) {
        Some(Errno::ENODEV) => OpenError::Absent(interface),
        Some(Errno::EAFNOSUPPORT | Errno::EPROTONOSUPPORT) => OpenError::NoCan { interface },
        _ => OpenError::Failed { interface, error },
    }
}

/// What an error of reading means; `None` if nothing came after all.
fn trouble(error: &io::Error) -> Option<BusFault> {
    let nothing = matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted);
    (!nothing).then_some(BusFault::Down)
}

/// What a frame means; `None` if it does not concern a CANopen node.
fn sort(frame: CanFrame) -> Option<Heard> {
    match frame {
        CanFrame::Data(data) => {
            let Id::Standard(id) = data.id() else { return None };
            Frame::from_slice(id.as_raw(), data.data()).map(Heard::Frame)
        }
        CanFrame::Remote(remote) => {
            let Id::Standard(id) = remote.id() else { return None };
            let length = u8::try_from(remote.dlc()).ok()?;
            Some(Heard::Frame(Frame::remote(id.as_raw(), length)))
        }
        CanFrame::Error(error) => {
            let error = error.into_error();
            error.causes().filter_map(fault).max().map(Heard::Fault)
        }
    }
}

/// What one cause in an error frame means for the bus. Single errors are the controller's to count.
fn fault(cause: &ErrorCause) -> Option<BusFault> {
    if matches!(cause, ErrorCause::BusOff) {
        return Some(BusFault::Off);
    }
    if matches!(cause, ErrorCause::TransmitTimeout) {
        return Some(BusFault::Passive);
    }
    let ErrorCause::Controller(problems) = cause else { return None };
    let any = |these: ControllerProblems| problems.intersects(these);
    if any(ControllerProblems::RX_PASSIVE | ControllerProblems::TX_PASSIVE) {
        Some(BusFault::Passive)
    } else if any(ControllerProblems::RX_OVERFLOW | ControllerProblems::TX_OVERFLOW) {
        Some(BusFault::Overrun)
    } else if any(ControllerProblems::RX_WARNING | ControllerProblems::TX_WARNING) {
        Some(BusFault::Warning)
    } else {
        None
    }
}
