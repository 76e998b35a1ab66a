//! One raw CAN socket: configured before it receives, read with the kernel's receive stamp and overflow count.

use std::io::{self, IoSliceMut};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};

use nix::cmsg_space;
use nix::errno::Errno;
use nix::sys::socket::sockopt::RxqOvfl;
use nix::sys::socket::{ControlMessageOwned, MsgFlags, recvmsg, setsockopt};
use nix::sys::time::TimeSpec;
use socket2::{SockAddr, Type};
use socketcan::addr::{AF_CAN, CAN_RAW};
use socketcan::id::{CAN_EFF_FLAG, CAN_RTR_FLAG, CAN_SFF_MASK};
use socketcan::{
    CanAddr, CanFilter, CanFrame, CanSocket, EmbeddedFrame, Socket as _, SocketOptions, StandardId,
};
use thiserror::Error;

use crate::arrival::Arrivals;
use crate::clock::{self, Reading};
use crate::{BusError, BusEvent, SendError, raw_frame};
use canopen::frame::Frame;
use canopen::listening::Pattern;

/// Send buffer in bytes: about one cycle of frames. A larger one would store stale torques.
const SEND_BUFFER: usize = 8 << 10;

/// Maximum frames read after the end of a wait, or for one confirmation: the capacity of a socket's buffer.
pub(super) const BACKLOG: usize = 256;

/// Reasons why a bus cannot be opened.
#[derive(Debug, Error)]
pub enum OpenError {
    /// Kernel without CAN support.
    #[error(
        "{interface}: the kernel has no CAN support (scripts/with_vcan.sh runs a kernel that has)"
    )]
    NoCan { interface: String },
    /// Interface that does not exist.
    #[error(
        "{0}: no such interface; `ip link` lists those that exist, and scripts/vcan_setup.sh creates virtual ones"
    )]
    Absent(String),
    /// Any other error of the kernel.
    #[error("{interface}: {error}")]
    Failed { interface: String, error: io::Error },
    /// More buses than a node can have.
    #[error("at most 8 buses, got {0}")]
    TooMany(usize),
}

/// Raw socket bound to one interface.
#[derive(Debug)]
pub(super) struct Socket {
    raw: CanSocket,
    /// Buffer for stamps and counts, so that reading does not allocate.
    control: Vec<u8>,
    arrivals: Arrivals,
    /// Total number of frames lost for lack of buffer space.
    lost: u32,
}

/// Frame or fault read from a socket, with its receive time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ReadResult {
    /// Receive time since boot, in ns.
    pub(super) arrived: u64,
    /// Frame or error; `None` if it does not concern a CANopen node.
    pub(super) event: Option<BusEvent>,
    /// Set if frames before this one were lost.
    pub(super) has_overrun: bool,
}

/// Frames that a socket receives.
#[derive(Clone, Copy, Debug)]
pub(super) struct Purpose<'a> {
    /// Receive filters.
    pub(super) filters: &'a [CanFilter],
    /// Set to receive error frames.
    pub(super) receives_errors: bool,
    /// Set to receive this socket's own frames.
    pub(super) receives_own: bool,
}

impl Socket {
    /// Opens a raw CAN socket, bound to `interface` once its options are set.
    ///
    /// # Errors
    /// When there is no such interface, or the kernel refuses a socket or an option.
    pub(super) fn open(interface: &str, purpose: &Purpose<'_>) -> Result<Self, OpenError> {
        Self::opened(interface, purpose).map_err(|error| open_error(interface, error))
    }

    fn opened(interface: &str, purpose: &Purpose<'_>) -> io::Result<Self> {
        let address = CanAddr::from_iface(interface)?;
        let raw = socket2::Socket::new_raw(AF_CAN.into(), Type::RAW, Some(CAN_RAW.into()))?;
        let raw = CanSocket::from(OwnedFd::from(raw));
        raw.set_filters(purpose.filters)?;
        if purpose.receives_errors {
            raw.set_error_filter_accept_all()?;
        }
        raw.set_recv_own_msgs(purpose.receives_own)?;
        raw.set_recv_timestamp(true)?;
        setsockopt(&raw, RxqOvfl, &1)?;
        raw.as_raw_socket().set_send_buffer_size(SEND_BUFFER)?;
        raw.as_raw_socket().bind(&SockAddr::from(address))?;
        raw.set_nonblocking(true)?;
        let control = cmsg_space!(TimeSpec, u32);
        Ok(Self { raw, control, arrivals: Arrivals::since(Reading::now()), lost: 0 })
    }

    /// Passes a frame to the driver; does not wait.
    pub(super) fn send(&self, frame: &Frame) -> Result<(), SendError> {
        let id = StandardId::new(frame.cob_id).ok_or(SendError::Down)?;
        let frame = if frame.is_remote() {
            CanFrame::new_remote(id, usize::from(frame.length()))
        } else {
            CanFrame::new(id, frame.data())
        };
        let frame = frame.ok_or(SendError::Down)?;
        self.raw.write_frame(&frame).map_err(|error| {
            match error.raw_os_error().map(Errno::from_raw) {
                Some(Errno::EAGAIN | Errno::ENOBUFS) => SendError::Full,
                _ => SendError::Down,
            }
        })
    }

    /// Reads one frame; `None` if no frame waits. `now` is a reading of the clocks before this call, which dates a frame
    /// that came after it.
    ///
    /// # Errors
    /// When the interface is down or missing.
    pub(super) fn read(&mut self, now: Reading) -> Result<Option<ReadResult>, BusError> {
        let mut bytes = [0; raw_frame::SIZE];
        let mut parts = [IoSliceMut::new(&mut bytes)];
        let (fd, control) = (self.raw.as_raw_fd(), Some(self.control.as_mut_slice()));
        let (mut stamp, mut lost) = (None, self.lost);
        let length = match recvmsg::<()>(fd, &mut parts, control, MsgFlags::empty()) {
            Ok(message) => {
                for control in message.cmsgs().into_iter().flatten() {
                    if let ControlMessageOwned::ScmTimestampns(at) = control {
                        stamp = Some(clock::nanos_of(at));
                    } else if let ControlMessageOwned::RxqOvfl(count) = control {
                        lost = count;
                    }
                }
                message.bytes
            }
            Err(Errno::EAGAIN) => {
                self.found_empty(now);
                return Ok(None);
            }
            Err(Errno::EINTR) => return Ok(None),
            Err(_) => return Err(BusError::Down),
        };
        let has_overrun = lost != std::mem::replace(&mut self.lost, lost);
        let arrived = self.arrivals.time_of(stamp, now);
        let event = bytes.get(..length).and_then(raw_frame::read);
        Ok(Some(ReadResult { arrived, event, has_overrun }))
    }

    /// Returns whether a clock was set since the socket was last empty.
    pub(super) fn is_before_a_step(&self, now: Reading) -> bool {
        self.arrivals.are_before_a_step(now)
    }

    /// Records that the socket was empty at `at` or later.
    pub(super) fn found_empty(&mut self, at: Reading) {
        self.arrivals.found_empty(at);
    }
}

impl AsFd for Socket {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.raw.as_fd()
    }
}

/// Filters data frames with 11 bits: the mask has both flags, the identifier has none.
pub(super) fn data_frames(pattern: &Pattern) -> CanFilter {
    let mask = u32::from(pattern.mask) & CAN_SFF_MASK;
    CanFilter::new(pattern.cob_id.into(), mask | CAN_EFF_FLAG | CAN_RTR_FLAG)
}

/// Filters remote frames with 11 bits.
pub(super) fn remote_frames() -> CanFilter {
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
