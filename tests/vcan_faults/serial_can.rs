//! A simulated serial CAN adapter: the kernel's line discipline slcan on one end of a pseudo-terminal, this file on the
//! other, with the drives' interface as its wire.
//!
//! It stalls, reports states of its controller, and can be unplugged.

use std::io::{Read, Write};
use std::os::fd::AsFd;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};

use nix::fcntl::OFlag;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::pty::{PtyMaster, grantpt, posix_openpt, ptsname_r, unlockpt};
use socketcan::{CanFrame, CanSocket, EmbeddedFrame, Id, Socket, StandardId};

use crate::common::prelude::*;
use crate::gateway::DRIVES;
use crate::interface::ip;
use faults::Disturbance;

/// An order to the adapter's thread.
#[derive(Debug)]
enum Order {
    Stall,
    GoOn,
    Report(String),
}

/// An adapter that is plugged in; unplugged at the end of a test.
pub(crate) struct Adapter {
    interface: &'static str,
    orders: Option<Sender<Order>>,
    wire: Option<JoinHandle<()>>,
    /// Holds the line discipline until the terminal is hung up.
    slcand: Option<Process>,
}

impl Adapter {
    /// An adapter whose interface is up.
    pub(crate) fn plugged(interface: &'static str) -> Self {
        // Programs started meanwhile must not inherit the terminal, or it would not be hung up.
        let terminal = OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_CLOEXEC;
        let terminal = posix_openpt(terminal).unwrap();
        grantpt(&terminal).unwrap();
        unlockpt(&terminal).unwrap();
        let line = ptsname_r(&terminal).unwrap();
        let slcand = Process::start("slcand", &["-F", "-o", "-s8", &line, interface]);
        wait_until_it_is(interface, true);
        let (orders, ordered) = channel();
        let wire = thread::spawn(move || Wire::new(terminal).carry(&ordered));
        // About a cycle of frames, as scripts/vcan_setup.sh has it.
        ip(&format!("link set {interface} txqueuelen 16 up"));
        Self { interface, orders: Some(orders), wire: Some(wire), slcand: Some(slcand) }
    }

    /// From now on, accepts no frames from the host and delivers none.
    fn stall(&self) {
        self.order(Order::Stall);
    }

    /// Delivers the queued frames, and continues normally.
    pub(crate) fn go_on(&self) {
        self.order(Order::GoOn);
    }

    /// Applies a disturbance from now on.
    pub(crate) fn disturb(&mut self, disturbance: Disturbance) {
        match disturbance {
            Disturbance::AdapterStalled => self.stall(),
            Disturbance::AdapterUnplugged => self.unplug(),
            Disturbance::BusOff => {
                self.report("sb000255");
                self.stall();
            }
            Disturbance::ErrorPassive => self.report("sp128000"),
            Disturbance::ErrorWarning => self.report("sw096000"),
            Disturbance::QueueFull
            | Disturbance::AdapterStuck
            | Disturbance::InterfaceDown
            | Disturbance::Flood(_) => panic!("{disturbance} cannot be applied to this adapter"),
        }
    }

    /// Reports a state of its controller to the host.
    fn report(&self, words: &str) {
        self.order(Order::Report(words.to_owned()));
    }

    fn order(&self, order: Order) {
        self.orders.as_ref().unwrap().send(order).unwrap();
    }

    /// Unplugs it: the terminal is hung up, and the interface removed.
    fn unplug(&mut self) {
        self.orders = None;
        self.wire.take().map(JoinHandle::join).transpose().unwrap();
        drop(self.slcand.take());
        wait_until_it_is(self.interface, false);
    }
}

impl Drop for Adapter {
    fn drop(&mut self) {
        self.unplug();
    }
}

/// Waits until an interface exists, or does not.
fn wait_until_it_is(interface: &str, there: bool) {
    while fs::exists(format!("/sys/class/net/{interface}")).unwrap() != there {
        thread::sleep(Duration::from_millis(1));
    }
}

/// The wire between terminal and drives.
struct Wire {
    terminal: PtyMaster,
    bus: CanSocket,
    /// Text from the host, up to the end of a frame.
    text: String,
    is_stalled: bool,
}

impl Wire {
    fn new(terminal: PtyMaster) -> Self {
        let bus = CanSocket::open(DRIVES).unwrap();
        bus.set_nonblocking(true).unwrap();
        Self { terminal, bus, text: String::new(), is_stalled: false }
    }

    /// Runs until the adapter is unplugged.
    fn carry(&mut self, ordered: &Receiver<Order>) {
        use std::sync::mpsc::TryRecvError::Disconnected;
        loop {
            match ordered.try_recv() {
                Ok(Order::Stall) => self.is_stalled = true,
                Ok(Order::GoOn) => self.is_stalled = false,
                Ok(Order::Report(words)) => self.write(&words),
                Err(Disconnected) => return,
                Err(_) => self.wait(),
            }
        }
    }

    /// Carries frames for a short while, until the next order may have come.
    fn wait(&mut self) {
        if self.is_stalled {
            thread::sleep(Duration::from_micros(500));
            return;
        }
        let (terminal, bus) = (self.terminal.as_fd(), self.bus.as_fd());
        let mut both = [terminal, bus].map(|one| PollFd::new(one, PollFlags::POLLIN));
        poll(&mut both, PollTimeout::from(1_u8)).unwrap();
        let [from_host, from_bus] =
            both.map(|one| one.revents().is_some_and(|events| events.contains(PollFlags::POLLIN)));
        if from_host {
            self.read_host();
        }
        if from_bus {
            while let Ok(frame) = self.bus.read_frame() {
                if let Some(line) = line(&frame) {
                    self.write(&line);
                }
            }
        }
    }

    fn read_host(&mut self) {
        let mut bytes = [0; 4096];
        let Ok(length) = self.terminal.read(&mut bytes) else { return };
        self.text.push_str(std::str::from_utf8(&bytes[..length]).unwrap());
        while let Some((line, rest)) = self.text.split_once('\r') {
            if let Some(frame) = frame(line) {
                self.bus.write_frame(&frame).unwrap();
            }
            self.text = rest.to_owned();
        }
    }

    fn write(&mut self, line: &str) {
        // A disconnected host receives nothing.
        self.terminal.write_all(format!("{line}\r").as_bytes()).ok();
    }
}

/// Returns a data frame of 11 bits in slcan's format: `t`, three digits, a length, the data.
fn line(frame: &CanFrame) -> Option<String> {
    let (CanFrame::Data(data), Id::Standard(id)) = (frame, frame.id()) else { return None };
    let digits: String = data.data().iter().map(|byte| format!("{byte:02X}")).collect();
    Some(format!("t{:03X}{}{digits}", id.as_raw(), data.data().len()))
}

/// Returns the frame of such a line; `None` for a command to the adapter.
fn frame(line: &str) -> Option<CanFrame> {
    let line = line.strip_prefix('t')?;
    let (id, rest) = line.split_at_checked(3)?;
    let digits = rest.get(1..)?;
    let bytes = (0..digits.len() / 2)
        .map(|place| u8::from_str_radix(&digits[2 * place..][..2], 16))
        .collect::<Result<Vec<u8>, _>>();
    CanFrame::new(StandardId::new(u16::from_str_radix(id, 16).ok()?)?, &bytes.ok()?)
}
