//! SocketCAN: raw sockets of several buses, all waited for at once.
//!
//! Error frames and 29-bit identifiers are told apart here and never become a frame; remote frames
//! neither, but where [simulated devices](SocketCan::with_remote_frames) answer them. Time is
//! `CLOCK_MONOTONIC` since the bus was opened; a frame bears the time of its arrival, so that a late
//! reader knows what is old.
//!
//! That a frame was taken proves nothing: a controller that is off the bus takes them all. A node
//! therefore has a second socket on each bus, its [witness](SocketCan::with_transmit_confirmation), that hears nothing
//! but SYNC. A driver with `IFF_ECHO` shows a sent frame to the other sockets of its host once it was on
//! the wire, so what the witness hears has been sent; and the node's own socket never hears what it sends
//! itself. Other drivers have the kernel show it at once, and the witness proves no more than the sending.

use std::io;
use std::os::fd::AsFd;
use std::time::Duration;

use nix::errno::Errno;
use nix::poll::PollFd;
use nix::poll::PollFlags;
use nix::poll::ppoll;
use nix::sys::time::TimeSpec;
use socketcan::CanFilter;
use socketcan::id::CAN_EFF_FLAG;
use socketcan::id::CAN_RTR_FLAG;
use socketcan::id::CAN_SFF_MASK;
use thiserror::Error;

use crate::Bus;
use crate::BusEvent;
use crate::BusFault;
use crate::Received;
use crate::ReopenError;
use crate::SendError;
use crate::clock;
use crate::clock::Reading;
use crate::interface;
use crate::interface::Remark;
use crate::interface::Unfit;
use crate::socket::Purpose;
use crate::socket::Socket;
use canopen::frame::Channel;
use canopen::frame::Telegram;
use canopen::listening::Pattern;
use canopen::sync;
use units::time::Instant;

/// Most buses one node has.
const MOST: usize = 8;

/// Frames read at most after a wait should have ended: what a socket's buffer holds.
const BACKLOG: usize = 256;

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
    lines: Vec<Line>,
    opened: Duration,
    epoch: Duration,
    /// Frames that may queue on each interface, where all must be fit for torques, now and whenever they
    /// are opened again.
    bursts: Option<Vec<u32>>,
    /// That frames were lost before the one that was read last.
    overrun: Option<Received>,
    /// The socket looked at first, so that none is starved by another.
    first: usize,
}

/// One bus.
#[derive(Debug)]
struct Line {
    interface: String,
    filters: Vec<CanFilter>,
    hears_itself: bool,
    socket: Socket,
    /// A frame that came after the deadline of the call that read it. Its socket is not read on.
    held: Option<Received>,
    witness: Option<Witness>,
}

/// Who hears nothing but SYNC, the node's own too.
#[derive(Debug)]
struct Witness {
    socket: Socket,
    /// When it last did.
    event: Instant,
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
        let lines = interfaces.iter().map(|name| Line::open(name)).collect::<Result<_, _>>()?;
        let Reading { monotonic, wall } = Reading::now();
        let (opened, epoch, bursts) = (monotonic, wall, None);
        Ok(Self { lines, opened, epoch, bursts, overrun: None, first: 0 })
    }

    /// The same, hearing of each bus only what is in its patterns, in the order of the channels: a flood
    /// of anything else wakes nobody.
    ///
    /// # Errors
    /// The first interface that does not take the filters.
    pub fn with_filters(mut self, patterns: &[Vec<Pattern>]) -> Result<Self, OpenError> {
        for (line, patterns) in self.lines.iter_mut().zip(patterns) {
            line.filters = patterns.iter().map(data_frames).collect();
            line.reopen()?;
        }
        Ok(self)
    }

    /// The same, hearing remote frames too: simulated devices answer them when they are guarded, or asked
    /// for a TPDO. A master hears no remote frame at all.
    ///
    /// # Errors
    /// The first interface that does not take the filter.
    pub fn with_remote_frames(mut self) -> Result<Self, OpenError> {
        for line in &mut self.lines {
            line.filters.push(remote_frames());
            line.reopen()?;
        }
        Ok(self)
    }

    /// The same, but what is sent here is heard here too, once it is on the bus: simulated devices are
    /// several that hear each other.
    ///
    /// # Errors
    /// The first interface that does not do so.
    pub fn with_own_frames(mut self) -> Result<Self, OpenError> {
        for line in &mut self.lines {
            line.hears_itself = true;
            line.reopen()?;
        }
        Ok(self)
    }

    /// The same, but of each SYNC it is known when it was on the bus.
    ///
    /// # Errors
    /// The first interface that cannot be opened a second time.
    pub fn with_transmit_confirmation(mut self) -> Result<Self, OpenError> {
        for line in &mut self.lines {
            line.witness = Some(Witness::open(&line.interface)?);
        }
        Ok(self)
    }

    /// The same, on interfaces that are [fit](interface::check) for torques in such bursts, which is checked
    /// again whenever they are opened again; and what is to be reported of them.
    ///
    /// # Errors
    /// The first interface that is not fit.
    pub fn fit_for_torques(mut self, bursts: Vec<u32>) -> Result<(Self, Vec<Remark>), Unfit> {
        let remarks = interface::check(&self.interfaces(), &bursts)?;
        self.bursts = Some(bursts);
        Ok((self, remarks))
    }

    fn interfaces(&self) -> Vec<String> {
        self.lines.iter().map(|line| line.interface.clone()).collect()
    }

    /// The wall clock when the bus was opened, in µs since 1970: what logs add to an [`Instant`].
    pub fn epoch_micros(&self) -> u64 {
        u64::try_from(self.epoch.as_micros()).unwrap_or(u64::MAX)
    }

    /// The bus's clock, for other threads: what it shows compares with [`Bus::now`].
    pub fn clock(&self) -> impl Fn() -> Instant + Copy + Send + Sync + use<> {
        let opened = self.opened;
        move || Instant::ZERO + clock::monotonic().saturating_sub(opened)
    }

    /// Waits until a socket can be read, `timeout` at most; its place. Sockets of even places are the
    /// buses', those of odd places their witnesses'.
    fn wait(&mut self, timeout: Duration) -> Option<usize> {
        let before = Reading::now();
        let sockets = self.lines.iter().flat_map(Line::sockets);
        let anchor = self.lines.first()?.socket.as_fd();
        let mut polled: [PollFd<'_>; 2 * MOST] =
            std::array::from_fn(|_| PollFd::new(anchor, PollFlags::empty()));
        for (place, socket) in polled.iter_mut().zip(sockets) {
            if let Some(socket) = socket {
                *place = PollFd::new(socket.as_fd(), PollFlags::POLLIN);
            }
        }
        let count = 2 * self.lines.len();
        let outcome = ppoll(polled.get_mut(..count)?, Some(TimeSpec::from_duration(timeout)), None);
        // A signal may have come first: then nothing is known, and the caller looks at the clock.
        outcome.ok()?;
        let ready: [bool; 2 * MOST] = polled.map(|place| place.any().unwrap_or_default());
        let is_ready = |place: &usize| ready.get(*place).copied().unwrap_or_default();
        let sockets = self.lines.iter_mut().flat_map(Line::sockets_mut);
        for (socket, is_ready) in sockets.zip(ready) {
            if let Some(socket) = socket.filter(|_| !is_ready) {
                socket.found_empty(before);
            }
        }
        (0..count).map(|turn| (self.first + turn) % count).find(is_ready)
    }

    /// Takes the oldest of the frames that were held and came until `until`.
    fn take_held(&mut self, until: Instant) -> Option<Received> {
        let at = |line: &Line| line.held.map(|held| held.at).filter(|at| *at <= until);
        let lines = self.lines.iter_mut().filter(|line| at(line).is_some());
        lines.min_by_key(|line| at(line))?.held.take()
    }

    /// Reads what is there; `None` if it was nothing that concerns a CANopen node.
    fn read(&mut self, place: usize) -> Option<Received> {
        self.first = place + 1;
        let (now, opened) = (self.now(), self.opened);
        let line = self.lines.get_mut(place / 2)?;
        let channel = Channel(u8::try_from(place / 2).unwrap_or(u8::MAX));
        if place % 2 == 1 {
            line.witness.as_mut()?.read(opened);
            return None;
        }
        let fault = |at, fault| Received { at, channel, event: BusEvent::Fault(fault) };
        match line.socket.read() {
            Ok(taken) => {
                let taken = taken?;
                let at = Instant::ZERO + taken.arrived.saturating_sub(opened);
                let overrun = taken.has_overrun.then(|| fault(now, BusFault::Overrun));
                self.overrun = self.overrun.or(overrun);
                Some(Received { at, channel, event: taken.event? })
            }
            Err(down) => Some(fault(now, down)),
        }
    }
}

impl Bus for SocketCan {
    fn now(&self) -> Instant {
        Instant::ZERO + clock::monotonic().saturating_sub(self.opened)
    }

    fn wall(&self) -> Duration {
        clock::wall()
    }

    fn suspended(&self) -> Duration {
        clock::suspended()
    }

    fn transmit_confirmed_at(&self, Channel(place): Channel) -> Option<Instant> {
        Some(self.lines.get(usize::from(place))?.witness.as_ref()?.event)
    }

    fn send(&mut self, telegram: Telegram) -> Result<(), SendError> {
        let Channel(place) = telegram.channel;
        let line = self.lines.get(usize::from(place)).ok_or(SendError::Down)?;
        line.socket.send(&telegram.frame)
    }

    fn receive(&mut self, until: Instant) -> Option<Received> {
        if let Some(overrun) = self.overrun.take() {
            return Some(overrun);
        }
        if let Some(held) = self.take_held(until) {
            return Some(held);
        }
        let mut late = 0;
        while late < BACKLOG {
            let left = until.since(self.now());
            let Some(place) = self.wait(left) else {
                if left.is_zero() {
                    return None;
                }
                continue;
            };
            late += usize::from(left.is_zero());
            let Some(received) = self.read(place) else { continue };
            if received.at <= until {
                return Some(received);
            }
            // Another bus may still have one that came in time.
            if let Some(line) = self.lines.get_mut(place / 2) {
                line.held = Some(received);
            }
        }
        None
    }

    fn reopen(&mut self) -> Result<(), ReopenError> {
        self.overrun = None;
        for (place, line) in (0..).zip(&mut self.lines) {
            line.reopen().map_err(|_| ReopenError::Gone(Channel(place)))?;
        }
        if let Some(bursts) = &self.bursts {
            let checked = interface::check(&self.interfaces(), bursts);
            checked.map_err(|unfit| ReopenError::Unfit(unfit.to_string()))?;
        }
        Ok(())
    }
}

impl Line {
    fn open(interface: &str) -> Result<Self, OpenError> {
        let filters = vec![data_frames(&Pattern::ANY)];
        let socket = socket(interface, &filters, false)?;
        let interface = interface.to_owned();
        Ok(Self { interface, filters, hears_itself: false, socket, held: None, witness: None })
    }

    /// Opens its sockets anew, as they were: what waited in them is gone, and an interface that was
    /// unplugged and plugged in again is the new one.
    fn reopen(&mut self) -> Result<(), OpenError> {
        self.socket = socket(&self.interface, &self.filters, self.hears_itself)?;
        self.held = None;
        if self.witness.is_some() {
            self.witness = Some(Witness::open(&self.interface)?);
        }
        Ok(())
    }

    /// The bus's, unless a frame of it is held, then its witness's.
    fn sockets(&self) -> [Option<&Socket>; 2] {
        let own = Some(&self.socket).filter(|_| self.held.is_none());
        [own, self.witness.as_ref().map(|witness| &witness.socket)]
    }

    fn sockets_mut(&mut self) -> [Option<&mut Socket>; 2] {
        let own = Some(&mut self.socket).filter(|_| self.held.is_none());
        [own, self.witness.as_mut().map(|witness| &mut witness.socket)]
    }
}

impl Witness {
    fn open(interface: &str) -> Result<Self, OpenError> {
        let filters = [data_frames(&Pattern::only(sync::COB_ID))];
        let purpose = Purpose { filters: &filters, hears_errors: false, hears_itself: false };
        let socket = Socket::open(interface, &purpose).map_err(|error| why(interface, error))?;
        Ok(Self { socket, event: Instant::ZERO })
    }

    /// Takes what it heard. That its interface is down is the bus's own socket's to tell.
    fn read(&mut self, opened: Duration) {
        if let Ok(Some(taken)) = self.socket.read() {
            self.event = Instant::ZERO + taken.arrived.saturating_sub(opened);
        }
    }
}

/// A bus's own socket.
fn socket(interface: &str, filters: &[CanFilter], hears_itself: bool) -> Result<Socket, OpenError> {
    let purpose = Purpose { filters, hears_errors: true, hears_itself };
    Socket::open(interface, &purpose).map_err(|error| why(interface, error))
}

/// Data frames with 11 bits: the two flags are in the mask and not in the identifier.
fn data_frames(pattern: &Pattern) -> CanFilter {
    let mask = u32::from(pattern.mask) & CAN_SFF_MASK;
    CanFilter::new(pattern.cob_id.into(), mask | CAN_EFF_FLAG | CAN_RTR_FLAG)
}

/// Remote frames with 11 bits.
fn remote_frames() -> CanFilter {
    CanFilter::new(CAN_RTR_FLAG, CAN_EFF_FLAG | CAN_RTR_FLAG)
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
