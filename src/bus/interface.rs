//! Whether an interface is fit for torques: that nothing of the node's queues in it for longer than a
//! cycle, and that its controller does not come back from bus-off by itself.
//!
//! The length of the queue (`txqueuelen`) means nothing to an interface without one (`noqueue`), and that
//! of a virtual bus queues only where somebody set it up to: that is told, and not refused.

use std::fmt;
use std::io;
use std::os::fd::AsRawFd;

use nix::sys::socket::AddressFamily;
use nix::sys::socket::MsgFlags;
use nix::sys::socket::NetlinkAddr;
use nix::sys::socket::SockFlag;
use nix::sys::socket::SockProtocol;
use nix::sys::socket::SockType;
use nix::sys::socket::recv;
use nix::sys::socket::sendto;
use nix::sys::socket::socket;
use thiserror::Error;

use crate::netlink;
use crate::netlink::Link;

/// The driver shows a sent frame to its host when it was on the wire, and not before (linux/if.h).
const IFF_ECHO: u32 = 1 << 18;

/// The kinds of interfaces that have no wire.
const VIRTUAL: [&str; 2] = ["vcan", "vxcan"];

/// The interface is up (linux/if.h).
const IFF_UP: u32 = 1;

/// Why an interface is not taken.
#[derive(Debug, Error)]
pub enum Unfit {
    /// No frame can be sent.
    #[error("{interface}: the interface is down (ip link set {interface} up)")]
    Down { interface: String },
    /// Torques would be old when they get out.
    #[error(
        "{interface}: txqueuelen must be at most {most}, the frames of one cycle, got {queue}: torques would \
         be old (ip link set {interface} txqueuelen {most})"
    )]
    Queues { interface: String, queue: u32, most: u32 },
    /// After bus-off, only a boot of the network may go on.
    #[error(
        "{interface}: its controller restarts by itself {millis} ms after bus-off; it must not \
         (ip link set {interface} type can restart-ms 0)"
    )]
    Restarts { interface: String, millis: u32 },
    /// The kernel did not say.
    #[error("{interface}: {error}")]
    Unknown { interface: String, error: io::Error },
}

/// What is to be told of an interface that is taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remark {
    /// That its frames were sent is not known, only that its driver took them.
    NoEcho { interface: String },
    /// Somebody has set up a queue on a bus without a wire.
    VirtualQueue { interface: String, qdisc: String },
}

/// Asks the kernel for each interface; what is to be told of those that are fit. `bursts` are the most frames that
/// the node sends on each in one cycle: more must not queue.
///
/// # Errors
/// The first interface that is not fit, or of which nothing is known.
pub fn check(interfaces: &[String], bursts: &[u32]) -> Result<Vec<Remark>, Unfit> {
    let mut remarks = Vec::new();
    for (interface, burst) in interfaces.iter().zip(bursts) {
        let link = ask(interface);
        let unknown = |error| Unfit::Unknown { interface: interface.clone(), error };
        remarks.extend(judge(interface, &link.map_err(unknown)?, *burst)?);
    }
    Ok(remarks)
}

/// What follows from what is known of an interface.
fn judge(interface: &str, link: &Link, most: u32) -> Result<Vec<Remark>, Unfit> {
    let interface = interface.to_owned();
    if link.flags & IFF_UP == 0 {
        return Err(Unfit::Down { interface });
    }
    if let Some(millis) = link.restart_millis.filter(|millis| *millis != 0) {
        return Err(Unfit::Restarts { interface, millis });
    }
    let is_virtual = VIRTUAL.contains(&&*link.kind);
    let has_queue = link.qdisc != "noqueue";
    let queue = link.queue;
    if has_queue && !is_virtual && queue > most {
        return Err(Unfit::Queues { interface, queue, most });
    }
    let mut remarks = Vec::new();
    if has_queue && is_virtual {
        let qdisc = link.qdisc.clone();
        remarks.push(Remark::VirtualQueue { interface: interface.clone(), qdisc });
    }
    if link.flags & IFF_ECHO == 0 && !is_virtual {
        remarks.push(Remark::NoEcho { interface });
    }
    Ok(remarks)
}

/// What the kernel says of an interface.
fn ask(interface: &str) -> io::Result<Link> {
    let (family, flags) = (AddressFamily::Netlink, SockFlag::SOCK_CLOEXEC);
    let kernel = socket(family, SockType::Raw, flags, SockProtocol::NetlinkRoute)?;
    let (fd, to_kernel) = (kernel.as_raw_fd(), NetlinkAddr::new(0, 0));
    sendto(fd, &netlink::request(interface), &to_kernel, MsgFlags::empty())?;
    let mut bytes = vec![0; 16 << 10];
    let length = recv(fd, &mut bytes, MsgFlags::empty())?;
    let told = bytes.get(..length).and_then(netlink::answer);
    told.ok_or_else(|| io::Error::other("the kernel does not say what it is"))
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoEcho { interface } => {
                write!(
                    f,
                    "{interface}: its driver has no echo; frames that are taken and not sent are "
                )?;
                f.write_str("found by the samples that do not come")
            }
            Self::VirtualQueue { interface, qdisc } => {
                write!(f, "{interface}: frames may queue in its {qdisc}; torques may be old")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn link(kind: &str, qdisc: &str, queue: u32) -> Link {
        let restart_millis = (kind == "can").then_some(0);
        let (kind, qdisc) = (kind.to_owned(), qdisc.to_owned());
        Link { flags: IFF_UP | IFF_ECHO, qdisc, queue, kind, restart_millis }
    }

    #[test]
    fn promise_10_an_interface_that_queues_for_longer_than_a_cycle_is_refused() {
        assert!(judge("can0", &link("can", "pfifo_fast", 11), 11).is_ok());
        let refused = judge("can0", &link("can", "pfifo_fast", 12), 11).unwrap_err().to_string();
        let reason = "can0: txqueuelen must be at most 11, the frames of one cycle, got 12";
        assert!(refused.starts_with(reason), "{refused}");
        assert!(refused.ends_with("(ip link set can0 txqueuelen 11)"), "{refused}");
        assert!(judge("slcan0", &link("", "pfifo_fast", 12), 11).is_err(), "no kind, but a queue");
    }

    #[test]
    fn what_never_queues_is_taken_whatever_its_length() {
        assert_eq!(judge("vcan0", &link("vcan", "noqueue", 1_000), 11).unwrap(), []);
        let remarks = judge("vcan0", &link("vcan", "tbf", 1_000), 11).unwrap();
        let (interface, qdisc) = ("vcan0".to_owned(), "tbf".to_owned());
        assert_eq!(remarks, [Remark::VirtualQueue { interface, qdisc }]);
    }

    #[test]
    fn hazard_23_a_controller_that_restarts_by_itself_is_refused() {
        let restarts = Link { restart_millis: Some(100), ..link("can", "pfifo_fast", 10) };
        let refused = judge("can0", &restarts, 11).unwrap_err().to_string();
        assert!(refused.contains("restarts by itself 100 ms after bus-off"), "{refused}");
    }

    #[test]
    fn hazard_24_an_interface_that_is_down_is_refused() {
        let down = Link { flags: IFF_ECHO, ..link("can", "pfifo_fast", 10) };
        let refused = judge("can0", &down, 11).unwrap_err().to_string();
        assert_eq!(refused, "can0: the interface is down (ip link set can0 up)");
    }

    #[test]
    fn a_driver_without_echo_is_told_of() {
        let silent = Link { flags: IFF_UP, ..link("can", "pfifo_fast", 10) };
        let interface = "can0".to_owned();
        assert_eq!(judge("can0", &silent, 11).unwrap(), [Remark::NoEcho { interface }]);
    }
}
