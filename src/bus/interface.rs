//! Check of a CAN interface: frames must not queue longer than a cycle, and the controller must not restart
//! automatically after bus-off.
//!
//! The queue length (`txqueuelen`) has no effect with `noqueue`. A queue on a virtual bus, which must be configured, is a
//! remark, not an error.

use std::os::fd::AsRawFd;
use std::{fmt, io};

use nix::sys::socket::{
    AddressFamily, MsgFlags, NetlinkAddr, SockFlag, SockProtocol, SockType, recv, sendto, socket,
};
use thiserror::Error;

use crate::netlink::{self, InterfaceProperties};

/// Interface flag: the driver loops frames back once they were transmitted (linux/if.h).
const IFF_ECHO: u32 = 1 << 18;

/// Kinds of interfaces without a wire.
const VIRTUAL: [&str; 2] = ["vcan", "vxcan"];

/// Interface flag: up (linux/if.h).
const IFF_UP: u32 = 1;

/// Reasons to refuse an interface.
#[derive(Debug, Error)]
pub enum Unfit {
    /// Interface without `IFF_UP`.
    #[error("{interface}: the interface is down (ip link set {interface} up)")]
    Down { interface: String },
    /// Transmit queue so long that torques would be stale when transmitted.
    #[error(
        "{interface}: txqueuelen must be at most {most}, the frames of one cycle, got {queue}: torques would \
         be old (ip link set {interface} txqueuelen {most})"
    )]
    Queues { interface: String, queue: u32, most: u32 },
    /// Automatic restart of the controller; only a boot of the network may follow bus-off.
    #[error(
        "{interface}: restart-ms must be 0, got {millis}: the controller would restart by itself after bus-off \
         (ip link set {interface} type can restart-ms 0)"
    )]
    Restarts { interface: String, millis: u32 },
    /// Kernel that does not answer.
    #[error("{interface}: {error}")]
    Unknown { interface: String, error: io::Error },
}

/// Remarks about an accepted interface.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Remark {
    /// Driver that does not confirm transmissions.
    NoEcho { interface: String },
    /// Queue of a virtual bus.
    VirtualQueue { interface: String, qdisc: String },
}

/// Queries each interface and returns the remarks. `bursts` are the maximum numbers of frames that the node queues on
/// each interface; queues must not be longer.
///
/// # Errors
/// Returns the first interface that is not fit, or unknown.
pub fn check(interfaces: &[String], bursts: &[u32]) -> Result<Vec<Remark>, Unfit> {
    let mut remarks = Vec::new();
    for (interface, burst) in interfaces.iter().zip(bursts) {
        let link = query(interface);
        let unknown = |error| Unfit::Unknown { interface: interface.clone(), error };
        remarks.extend(judge(interface, &link.map_err(unknown)?, *burst)?);
    }
    Ok(remarks)
}

/// Returns whether an interface has no wire; false if the kernel does not answer.
pub fn is_virtual(interface: &str) -> bool {
    query(interface).is_ok_and(|link| has_no_wire(&link))
}

fn has_no_wire(link: &InterfaceProperties) -> bool {
    VIRTUAL.contains(&&*link.kind)
}

/// Checks the properties of an interface.
fn judge(interface: &str, link: &InterfaceProperties, most: u32) -> Result<Vec<Remark>, Unfit> {
    let interface = interface.to_owned();
    if link.flags & IFF_UP == 0 {
        return Err(Unfit::Down { interface });
    }
    if let Some(millis) = link.restart_millis.filter(|millis| *millis != 0) {
        return Err(Unfit::Restarts { interface, millis });
    }
    let is_virtual = has_no_wire(link);
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

/// Queries the kernel.
fn query(interface: &str) -> io::Result<InterfaceProperties> {
    let (family, flags) = (AddressFamily::Netlink, SockFlag::SOCK_CLOEXEC);
    let kernel = socket(family, SockType::Raw, flags, SockProtocol::NetlinkRoute)?;
    let (fd, to_kernel) = (kernel.as_raw_fd(), NetlinkAddr::new(0, 0));
    sendto(fd, &netlink::request(interface), &to_kernel, MsgFlags::empty())?;
    let mut bytes = vec![0; 16 << 10];
    let length = recv(fd, &mut bytes, MsgFlags::empty())?;
    let link = bytes.get(..length).and_then(netlink::answer);
    link.ok_or_else(|| io::Error::other("invalid RTM_GETLINK response"))
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoEcho { interface } => {
                write!(
                    f,
                    "{interface}: the driver has no IFF_ECHO; frames that are not sent are "
                )?;
                f.write_str("detected by missing samples")
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

    fn link(kind: &str, qdisc: &str, queue: u32) -> InterfaceProperties {
        let restart_millis = (kind == "can").then_some(0);
        let (kind, qdisc) = (kind.to_owned(), qdisc.to_owned());
        InterfaceProperties { flags: IFF_UP | IFF_ECHO, qdisc, queue, kind, restart_millis }
    }

    #[test]
    fn promise_10_queue_longer_than_a_cycle_is_refused() {
        assert!(judge("can0", &link("can", "pfifo_fast", 11), 11).is_ok());
        let refused = judge("can0", &link("can", "pfifo_fast", 12), 11).unwrap_err().to_string();
        let reason = "can0: txqueuelen must be at most 11, the frames of one cycle, got 12";
        assert!(refused.starts_with(reason), "{refused}");
        assert!(refused.ends_with("(ip link set can0 txqueuelen 11)"), "{refused}");
        assert!(judge("slcan0", &link("", "pfifo_fast", 12), 11).is_err(), "no kind, but a queue");
    }

    #[test]
    fn interface_without_a_queue_is_accepted() {
        assert_eq!(judge("vcan0", &link("vcan", "noqueue", 1_000), 11).unwrap(), []);
        let remarks = judge("vcan0", &link("vcan", "tbf", 1_000), 11).unwrap();
        let (interface, qdisc) = ("vcan0".to_owned(), "tbf".to_owned());
        assert_eq!(remarks, [Remark::VirtualQueue { interface, qdisc }]);
    }

    #[test]
    fn hazard_23_automatic_restart_is_refused() {
        let restarts =
            InterfaceProperties { restart_millis: Some(100), ..link("can", "pfifo_fast", 10) };
        let refused = judge("can0", &restarts, 11).unwrap_err().to_string();
        assert!(refused.contains("restart-ms must be 0, got 100"), "{refused}");
    }

    #[test]
    fn hazard_24_interface_that_is_down_is_refused() {
        let down = InterfaceProperties { flags: IFF_ECHO, ..link("can", "pfifo_fast", 10) };
        let refused = judge("can0", &down, 11).unwrap_err().to_string();
        assert_eq!(refused, "can0: the interface is down (ip link set can0 up)");
    }

    #[test]
    fn driver_without_echo_gives_a_remark() {
        let silent = InterfaceProperties { flags: IFF_UP, ..link("can", "pfifo_fast", 10) };
        let interface = "can0".to_owned();
        assert_eq!(judge("can0", &silent, 11).unwrap(), [Remark::NoEcho { interface }]);
    }
}
