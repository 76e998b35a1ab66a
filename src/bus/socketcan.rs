//! SocketCAN: raw sockets of several buses with a common wait.
//!
//! Error frames and 29-bit identifiers are filtered out here, and remote frames except for
//! [simulated devices](SocketCan::with_remote_frames). Time is `CLOCK_BOOTTIME` since opening, read once per wait. Each
//! frame has its receive time, so that a late reader detects stale frames.
//!
//! A controller in bus-off accepts frames without transmitting them. A second socket per bus therefore receives SYNC only,
//! for [transmit confirmation](SocketCan::with_transmit_confirmation). Drivers with `IFF_ECHO` loop a frame back to other
//! sockets once it was transmitted. With other drivers the kernel loops it back at once, which confirms nothing.

use std::io;
use std::os::fd::AsFd;
use std::time::Duration;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;
use socketcan::CanFilter;
use socketcan::id::{CAN_EFF_FLAG, CAN_RTR_FLAG, CAN_SFF_MASK};
use thiserror::Error;

use crate::clock::{self, Reading};
use crate::interface::{self, Remark, Unfit};
use crate::socket::{Purpose, Socket};
use crate::{Bus, BusError, BusEvent, ReceivedEvent, ReopenError, SendError, Wake};
use canopen::frame::{Channel, Telegram};
use canopen::listening::Pattern;
use canopen::sync;
use units::time::Instant;

/// Maximum buses of one node.
const MAX_BUSES: usize = 8;

/// Maximum frames read after the end of a wait, or for one confirmation: the capacity of a socket's buffer.
const BACKLOG: usize = 256;

/// Reasons why a bus cannot be opened.
#[derive(Debug, Error)]
pub enum OpenError {
    /// Kernel without CAN support.
    #[error(
        "{interface}: the kernel has no CAN support (scripts/with_vcan.sh runs a kernel that has)"
    )]
    NoCan { interface: String },
    /// Interface that does not exist.
    #[error("{0}: no such interface")]
    Absent(String),
    /// Any other error of the kernel.
    #[error("{interface}: {error}")]
    Failed { interface: String, error: io::Error },
    /// More buses than a node can have.
    #[error("at most 8 buses, got {0}")]
    TooMany(usize),
}

/// Several SocketCAN interfaces with a common clock.
#[derive(Debug)]
pub struct SocketCan {
    lines: Vec<Line>,
    /// Time of opening, in ns since boot and since 1970.
    opened: u64,
    epoch: u64,
    /// Last reading of both clocks.
    last: Reading,
    /// Maximum numbers of queued frames, for interfaces that must be fit for torques; `reopen` checks them again.
    bursts: Option<Vec<u32>>,
    /// Overrun before the last frame read.
    overrun: Option<ReceivedEvent>,
    /// Index of the socket polled first, which rotates.
    first: usize,
}

/// One bus.
#[derive(Debug)]
struct Line {
    interface: String,
    filters: Vec<CanFilter>,
    receives_own: bool,
    socket: Socket,
    /// Frame received after the deadline of the call that read it. Its socket is not read meanwhile.
    held: Option<ReceivedEvent>,
    confirmation: Option<ConfirmationSocket>,
}

/// Socket that receives SYNC, also those of this node.
#[derive(Debug)]
struct ConfirmationSocket {
    socket: Socket,
    /// Time of the last SYNC seen.
    event: Instant,
    /// Time of the last SYNC of this node.
    sent: Instant,
}

impl SocketCan {
    /// Opens one interface per bus, in the order of the channels.
    ///
    /// # Errors
    /// Returns the first interface that cannot be opened. No frame was sent.
    pub fn open(interfaces: &[String]) -> Result<Self, OpenError> {
        if interfaces.len() > MAX_BUSES {
            return Err(OpenError::TooMany(interfaces.len()));
        }
        let lines = interfaces.iter().map(|name| Line::open(name)).collect::<Result<_, _>>()?;
        let last = Reading::now();
        let (opened, epoch, bursts) = (last.boot, last.wall, None);
        Ok(Self { lines, opened, epoch, last, bursts, overrun: None, first: 0 })
    }

    /// Limits reception on each bus to its patterns: a flood of other frames does not wake the node.
    ///
    /// # Errors
    /// Returns the first interface that refuses the filters.
    pub fn with_filters(mut self, patterns: &[Vec<Pattern>]) -> Result<Self, OpenError> {
        for (line, patterns) in self.lines.iter_mut().zip(patterns) {
            line.filters = patterns.iter().map(data_frames).collect();
            line.reopen()?;
        }
        Ok(self)
    }

    /// Receives remote frames as well: simulated devices answer node guarding and TPDO requests. A master ignores them.
    ///
    /// # Errors
    /// Returns the first interface that refuses the filter.
    pub fn with_remote_frames(mut self) -> Result<Self, OpenError> {
        for line in &mut self.lines {
            line.filters.push(remote_frames());
            line.reopen()?;
        }
        Ok(self)
    }

    /// Receives its own frames once they are on the bus, so that simulated devices receive each other.
    ///
    /// # Errors
    /// Returns the first interface that refuses the option.
    pub fn with_own_frames(mut self) -> Result<Self, OpenError> {
        for line in &mut self.lines {
            line.receives_own = true;
            line.reopen()?;
        }
        Ok(self)
    }

    /// Records the transmit confirmation of each SYNC.
    ///
    /// # Errors
    /// Returns the first interface that cannot be opened a second time.
    pub fn with_transmit_confirmation(mut self) -> Result<Self, OpenError> {
        for line in &mut self.lines {
            line.confirmation = Some(ConfirmationSocket::open(&line.interface)?);
        }
        Ok(self)
    }

    /// Checks that the interfaces are [fit](interface::check) for torques, now and in each `reopen`, and returns the
    /// remarks.
    ///
    /// # Errors
    /// Returns the first interface that is not fit.
    pub fn fit_for_torques(mut self, bursts: Vec<u32>) -> Result<(Self, Vec<Remark>), Unfit> {
        let remarks = interface::check(&self.interfaces(), &bursts)?;
        self.bursts = Some(bursts);
        Ok((self, remarks))
    }

    fn interfaces(&self) -> Vec<String> {
        self.lines.iter().map(|line| line.interface.clone()).collect()
    }

    /// Returns the wall clock at opening, in µs since 1970: logs add it to an [`Instant`].
    pub fn epoch_micros(&self) -> u64 {
        self.epoch / 1_000
    }

    /// Returns the clock of the bus for other threads, equal to [`Bus::now`].
    pub fn clock(&self) -> impl Fn() -> Instant + Copy + Send + Sync + use<> {
        let opened = self.opened;
        move || instant(clock::boot(), opened)
    }

    /// Reads both clocks, and returns the time.
    fn read_clocks(&mut self) -> Instant {
        self.last = self.last.again();
        instant(self.last.boot, self.opened)
    }

    /// Waits until a bus can be read, at most `timeout`, and returns its place. Buses with a held frame wait.
    fn poll(&mut self, timeout: Duration) -> Option<usize> {
        let anchor = self.lines.first()?.socket.as_fd();
        let mut polled: [PollFd<'_>; MAX_BUSES] =
            std::array::from_fn(|_| PollFd::new(anchor, PollFlags::empty()));
        let count = self.lines.len();
        let polled = polled.get_mut(..count)?;
        for (place, line) in polled.iter_mut().zip(&self.lines).filter(|(_, line)| line.is_read()) {
            *place = PollFd::new(line.socket.as_fd(), PollFlags::POLLIN);
        }
        let outcome = ppoll(polled, Some(TimeSpec::from_duration(timeout)), None);
        // A signal may have ended the wait. Nothing is then known, and the caller reads the clock.
        outcome.ok()?;
        let mut is_ready = [false; MAX_BUSES];
        for (is_ready, place) in is_ready.iter_mut().zip(&*polled) {
            *is_ready = place.any().unwrap_or_default();
        }
        for (line, is_ready) in self.lines.iter_mut().zip(is_ready) {
            if line.is_read() && !is_ready {
                line.socket.found_empty(self.last);
            }
        }
        let turns = (self.first..count).chain(0..self.first.min(count));
        turns.into_iter().find(|place| is_ready.get(*place).is_some_and(|is_ready| *is_ready))
    }

    /// Returns the oldest held frame received until `until`.
    fn take_held(&mut self, until: Instant) -> Option<ReceivedEvent> {
        let at = |line: &Line| line.held.map(|held| held.at).filter(|at| *at <= until);
        let lines = self.lines.iter_mut().filter(|line| at(line).is_some());
        lines.min_by_key(|line| at(line))?.held.take()
    }

    /// Reads one bus at `now`; `None` if there is nothing for a CANopen node.
    fn read(&mut self, place: usize, now: Instant) -> Option<ReceivedEvent> {
        self.first = place + 1;
        let opened = self.opened;
        let line = self.lines.get_mut(place)?;
        let channel = Channel(u8::try_from(place).unwrap_or(u8::MAX));
        let error = |at, error| ReceivedEvent { at, channel, event: BusEvent::Error(error) };
        match line.socket.read(self.last) {
            Ok(taken) => {
                let taken = taken?;
                let at = instant(taken.arrived, opened);
                let overrun = taken.has_overrun.then(|| error(now, BusError::Overrun));
                self.overrun = self.overrun.or(overrun);
                Some(ReceivedEvent { at, channel, event: taken.event? })
            }
            Err(down) => Some(error(now, down)),
        }
    }
}

impl Bus for SocketCan {
    fn now(&self) -> Instant {
        instant(clock::boot(), self.opened)
    }

    fn wall(&self) -> Duration {
        clock::wall()
    }

    fn suspended(&self) -> Duration {
        clock::suspended()
    }

    fn transmit_confirmed_at(&mut self, Channel(place): Channel) -> Option<Instant> {
        self.read_clocks();
        let confirmation = self.lines.get_mut(usize::from(place))?.confirmation.as_mut()?;
        Some(confirmation.read(self.last, self.opened))
    }

    fn send_at(&mut self, now: Instant, telegram: Telegram) -> Result<(), SendError> {
        let Channel(place) = telegram.channel;
        let line = self.lines.get_mut(usize::from(place)).ok_or(SendError::Down)?;
        line.socket.send(&telegram.frame)?;
        if let Some(confirmation) = &mut line.confirmation
            && telegram.frame.cob_id == sync::COB_ID
        {
            confirmation.sent = now;
        }
        Ok(())
    }

    fn wait(&mut self, mut now: Instant, until: Instant) -> Wake {
        if let Some(ready) = self.overrun.take().or_else(|| self.take_held(until)) {
            return Wake { now, received: Some(ready) };
        }
        let mut late = 0;
        while late < BACKLOG {
            let left = until.since(now);
            let ready = self.poll(left);
            now = self.read_clocks();
            let Some(place) = ready else {
                // A signal may have ended the wait early.
                if now >= until {
                    break;
                }
                continue;
            };
            late += usize::from(left.is_zero());
            let Some(received) = self.read(place, now) else { continue };
            if received.at <= until {
                return Wake { now, received: Some(received) };
            }
            // Another bus may still have a frame received in time.
            if let Some(line) = self.lines.get_mut(place) {
                line.held = Some(received);
            }
        }
        Wake { now, received: None }
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
        Ok(Self { interface, filters, receives_own: false, socket, held: None, confirmation: None })
    }

    /// Opens the sockets again with their options: discards frames not yet read, and finds an interface that was
    /// plugged in again.
    fn reopen(&mut self) -> Result<(), OpenError> {
        self.socket = socket(&self.interface, &self.filters, self.receives_own)?;
        self.held = None;
        if self.confirmation.is_some() {
            self.confirmation = Some(ConfirmationSocket::open(&self.interface)?);
        }
        Ok(())
    }

    /// Returns whether the socket is read: no frame is held.
    fn is_read(&self) -> bool {
        self.held.is_none()
    }
}

impl ConfirmationSocket {
    fn open(interface: &str) -> Result<Self, OpenError> {
        let filters = [data_frames(&Pattern::only(sync::COB_ID))];
        let purpose = Purpose { filters: &filters, receives_errors: false, receives_own: false };
        let socket =
            Socket::open(interface, &purpose).map_err(|error| open_error(interface, error))?;
        Ok(Self { socket, event: Instant::ZERO, sent: Instant::ZERO })
    }

    /// Reads up to the SYNC of this cycle, and returns the time of the last one. The socket of the bus reports an
    /// interface that is down.
    fn read(&mut self, now: Reading, opened: u64) -> Instant {
        for _ in 0..BACKLOG {
            // Emptiness of the socket is checked only if a stamp would otherwise be of an unknown clock.
            if self.event >= self.sent && !self.socket.is_before_a_step(now) {
                break;
            }
            let Ok(Some(taken)) = self.socket.read(now) else {
                self.socket.found_empty(now);
                break;
            };
            self.event = instant(taken.arrived, opened);
        }
        self.event
    }
}

/// Returns the time on the bus of a time since boot, both in ns.
const fn instant(boot: u64, opened: u64) -> Instant {
    Instant::from_micros(boot.saturating_sub(opened) / 1_000)
}

/// Opens the socket of a bus.
fn socket(interface: &str, filters: &[CanFilter], receives_own: bool) -> Result<Socket, OpenError> {
    let purpose = Purpose { filters, receives_errors: true, receives_own };
    Socket::open(interface, &purpose).map_err(|error| open_error(interface, error))
}

/// Filters data frames with 11 bits: the mask has both flags, the identifier has none.
fn data_frames(pattern: &Pattern) -> CanFilter {
    let mask = u32::from(pattern.mask) & CAN_SFF_MASK;
    CanFilter::new(pattern.cob_id.into(), mask | CAN_EFF_FLAG | CAN_RTR_FLAG)
}

/// Filters remote frames with 11 bits.
fn remote_frames() -> CanFilter {
    CanFilter::new(CAN_RTR_FLAG, CAN_EFF_FLAG | CAN_RTR_FLAG)
}

/// Maps an error of the kernel.
fn open_error(interface: &str, error: io::Error) -> OpenError {
    let interface = interface.to_owned();
    match error.raw_os_error().map(Errno::from_raw) {
        Some(Errno::ENODEV) => OpenError::Absent(interface),
        Some(Errno::EAFNOSUPPORT | Errno::EPROTONOSUPPORT) => OpenError::NoCan { interface },
        _ => OpenError::Failed { interface, error },
    }
}
