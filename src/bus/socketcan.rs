//! SocketCAN: raw sockets of several buses with a common wait.
//!
//! Error frames and 29-bit identifiers are filtered out here, and remote frames except for
//! [simulated devices](SocketCan::with_remote_frames). Time is `CLOCK_BOOTTIME` since opening, read once per wait. Each
//! frame has its receive time, so that a late reader detects stale frames.

use std::os::fd::AsFd;
use std::time::Duration;

use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;
use socketcan::CanFilter;

use crate::clock::{self, Reading, instant};
use crate::confirmation::ConfirmationSocket;
use crate::interface::{self, Remark, Unfit};
use crate::socket::{BACKLOG, OpenError, Purpose, Socket, data_frames, remote_frames};
use crate::{Bus, BusError, BusEvent, ReceivedEvent, ReopenError, SendError, Wake};
use canopen::frame::{Channel, Telegram};
use canopen::listening::Pattern;
use canopen::sync;
use units::time::Instant;

/// Maximum buses of one node.
const MAX_BUSES: usize = 8;

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
    /// Frame read before its turn, or received after the deadline of the call that read it. Its socket is not read
    /// meanwhile.
    held: Option<ReceivedEvent>,
    /// Set after a sleep, until its socket is found empty: it is read without a poll.
    is_unread: bool,
    confirmation: Option<ConfirmationSocket>,
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

    /// Lets time pass until `from`, and returns the time. Frames stay in their sockets meanwhile.
    fn sleep(&mut self, mut now: Instant, from: Instant) -> Instant {
        while now < from {
            // A signal may end the sleep early.
            ppoll(&mut [], Some(TimeSpec::from_duration(from.since(now))), None).ok();
            now = self.read_clocks();
        }
        self.lines.iter_mut().for_each(|line| line.is_unread = true);
        now
    }

    /// Holds the next frame of each bus slept over, so that the oldest is known. Returns the time.
    fn read_slept_over(&mut self, mut now: Instant) -> Instant {
        for place in 0..self.lines.len() {
            for _ in 0..BACKLOG {
                if !self.lines.get(place).is_some_and(|line| line.is_unread && line.is_read()) {
                    break;
                }
                now = self.read_clocks();
                let received = self.read(place, now);
                if let Some(line) = self.lines.get_mut(place) {
                    line.held = received;
                }
            }
        }
        now
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
            Ok(None) => {
                line.is_unread = false;
                None
            }
            Ok(Some(taken)) => {
                let at = instant(taken.arrived, opened);
                let overrun = taken.has_overrun.then(|| error(now, BusError::Overrun));
                self.overrun = self.overrun.or(overrun);
                Some(ReceivedEvent { at, channel, event: taken.event? })
            }
            Err(down) => {
                line.is_unread = false;
                Some(error(now, down))
            }
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
            confirmation.on_sync(now);
        }
        Ok(())
    }

    fn wait(&mut self, mut now: Instant, from: Instant, until: Instant) -> Wake {
        if now < from {
            now = self.sleep(now, from);
        }
        now = self.read_slept_over(now);
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
        let (held, confirmation) = (None, None);
        Ok(Self {
            interface,
            filters,
            receives_own: false,
            socket,
            held,
            is_unread: false,
            confirmation,
        })
    }

    /// Opens the sockets again with their options: discards frames not yet read, and finds an interface that was
    /// plugged in again.
    fn reopen(&mut self) -> Result<(), OpenError> {
        self.socket = socket(&self.interface, &self.filters, self.receives_own)?;
        (self.held, self.is_unread) = (None, false);
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

/// Opens the socket of a bus.
fn socket(interface: &str, filters: &[CanFilter], receives_own: bool) -> Result<Socket, OpenError> {
    let purpose = Purpose { filters, receives_errors: true, receives_own };
    Socket::open(interface, &purpose)
}
