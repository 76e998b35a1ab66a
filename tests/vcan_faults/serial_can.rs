//! A serial CAN adapter that does as it is told: slcan, the line discipline of the kernel, on one end of a
//! pseudo-terminal; at the other this, with the drives' interface for its wire.
//!
//! It holds frames back, reports the states that controllers report, and is pulled.

use std::fs;
use std::io::Read;
use std::io::Write;
use std::os::fd::AsFd;
use std::sync::mpsc::Receiver;
use std::sync::mpsc::Sender;
use std::sync::mpsc::channel;
use std::thread;
use std::thread::JoinHandle;
use std::time::Duration;

use nix::fcntl::OFlag;
use nix::poll::PollFd;
use nix::poll::PollFlags;
use nix::poll::PollTimeout;
use nix::poll::poll;
use nix::pty::PtyMaster;
use nix::pty::grantpt;
use nix::pty::posix_openpt;
use nix::pty::ptsname_r;
use nix::pty::unlockpt;
use socketcan::CanFrame;
use socketcan::CanSocket;
use socketcan::EmbeddedFrame;
use socketcan::Id;
use socketcan::Socket;
use socketcan::StandardId;

use crate::common::process::Process;
use crate::gateway::DRIVES;
use crate::interface::ip;

/// What an adapter is told to do.
#[derive(Debug)]
enum Order {
    Stall,
    GoOn,
    Say(String),
}

/// An adapter that is plugged in; pulled when a test ends.
pub(crate) struct Adapter {
    interface: &'static str,
    orders: Option<Sender<Order>>,
    wire: Option<JoinHandle<()>>,
    /// Holds the line discipline until the terminal is hung up.
    slcand: Option<Process>,
}

impl Adapter {
    /// Its interface is up.
    pub(crate) fn plugged(interface: &'static str) -> Self {
        // The programs started meanwhile must not hold it, or it would not be hung up.
        let terminal = OFlag::O_RDWR | OFlag::O_NOCTTY | OFlag::O_CLOEXEC;
        let terminal = posix_openpt(terminal).unwrap();
        grantpt(&terminal).unwrap();
        unlockpt(&terminal).unwrap();
        let line = ptsname_r(&terminal).unwrap();
        let slcand = Process::of("slcand", &["-F", "-o", "-s8", &line, interface]);
        wait_until_it_is(interface, true);
        let (orders, ordered) = channel();
        let wire = thread::spawn(move || Wire::new(terminal).carry(&ordered));
        // About a cycle of frames, as scripts/vcan_setup.sh has it.
        ip(&format!("link set {interface} txqueuelen 16 up"));
        Self { interface, orders: Some(orders), wire: Some(wire), slcand: Some(slcand) }
    }

    /// From now on it takes nothing from the host, and gives it nothing.
    pub(crate) fn stall(&self) {
        self.order(Order::Stall);
    }

    /// What it held back goes out.
    pub(crate) fn go_on(&self) {
        self.order(Order::GoOn);
    }

    /// Tells the host a state of its controller: `sb000255` is bus-off, `sp128000` passive, `sw096000` a
    /// warning.
    pub(crate) fn say(&self, words: &str) {
        self.order(Order::Say(words.to_owned()));
    }

    fn order(&self, order: Order) {
        self.orders.as_ref().unwrap().send(order).unwrap();
    }

    /// Pulls it: the terminal is hung up, and the interface with it.
    pub(crate) fn unplug(&mut self) {
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

/// Waits until there is such an interface, or none.
fn wait_until_it_is(interface: &str, there: bool) {
    while fs::exists(format!("/sys/class/net/{interface}")).unwrap() != there {
        thread::sleep(Duration::from_millis(1));
    }
}

/// Between terminal and drives.
struct Wire {
    terminal: PtyMaster,
    bus: CanSocket,
    /// What came from the host, up to the end of a frame.
    text: String,
    is_stalled: bool,
}

impl Wire {
    fn new(terminal: PtyMaster) -> Self {
        let bus = CanSocket::open(DRIVES).unwrap();
        bus.set_nonblocking(true).unwrap();
        Self { terminal, bus, text: String::new(), is_stalled: false }
    }

    /// Until nobody gives orders any more.
    fn carry(&mut self, ordered: &Receiver<Order>) {
        use std::sync::mpsc::TryRecvError::Disconnected;
        loop {
            match ordered.try_recv() {
                Ok(Order::Stall) => self.is_stalled = true,
                Ok(Order::GoOn) => self.is_stalled = false,
                Ok(Order::Say(words)) => self.tell(&words),
                Err(Disconnected) => return,
                Err(_) => self.wait(),
            }
        }
    }

    /// Carries what comes within a short while, for then there may be an order.
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
            self.hear_host();
        }
        if from_bus {
            while let Ok(frame) = self.bus.read_frame() {
                if let Some(line) = line(&frame) {
                    self.tell(&line);
                }
            }
        }
    }

    fn hear_host(&mut self) {
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

    fn tell(&mut self, line: &str) {
        // A host that has hung up hears nothing.
        self.terminal.write_all(format!("{line}\r").as_bytes()).ok();
    }
}

/// A data frame of 11 bits as slcan writes it: `t`, three digits, a length, the data.
fn line(frame: &CanFrame) -> Option<String> {
    let (CanFrame::Data(data), Id::Standard(id)) = (frame, frame.id()) else { return None };
    let digits: String = data.data().iter().map(|byte| format!("{byte:02X}")).collect();
    Some(format!("t{:03X}{}{digits}", id.as_raw(), data.data().len()))
}

/// The frame of such a line; `None` for a command to the adapter.
fn frame(line: &str) -> Option<CanFrame> {
    let line = line.strip_prefix('t')?;
    let (id, rest) = line.split_at_checked(3)?;
    let digits = rest.get(1..)?;
    let bytes = (0..digits.len() / 2)
        .map(|place| u8::from_str_radix(&digits[2 * place..][..2], 16))
        .collect::<Result<Vec<u8>, _>>();
    CanFrame::new(StandardId::new(u16::from_str_radix(id, 16).ok()?)?, &bytes.ok()?)
}
