//! Socket of the link: it listens, and has one peer at a time. Only [`Door::wait`] waits.

use std::io;
use std::os::fd::{AsFd, AsRawFd};
use std::time::Duration;

use nix::errno::Errno;
use nix::libc::POLLRDHUP;
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::socket::{
    MsgFlags, UnixCredentials, getsockopt, recv, send, sockopt::PeerCredentials,
};
use nix::sys::time::TimeSpec;
use socket2::Socket;

/// Requested send buffer, in bytes: the kernel raises it to its minimum, which is a few messages. No backlog of commands.
const SEND_BUFFER: usize = 1;

/// Accepted connection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// First connection: its process is the peer from now on.
    Peer(UnixCredentials),
    /// Further connection beside that of a peer: it was closed.
    Second(UnixCredentials),
}

/// Result of one attempt to receive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reception {
    /// Message of this length.
    Message(usize),
    /// No message yet.
    Nothing,
    /// End of the connection: the peer has closed it, or its process has ended.
    Closed,
}

/// Listening socket with at most one peer.
#[derive(Debug)]
pub struct Door {
    listener: Socket,
    peer: Option<Socket>,
}

impl Door {
    /// Takes a listening SEQPACKET socket.
    ///
    /// # Errors
    /// When the socket cannot be made non-blocking.
    pub fn new(listener: Socket) -> io::Result<Self> {
        listener.set_nonblocking(true)?;
        Ok(Self { listener, peer: None })
    }

    /// Returns whether a peer is connected.
    pub const fn has_peer(&self) -> bool {
        self.peer.is_some()
    }

    /// Returns the socket of the peer, not blocking.
    pub const fn peer(&self) -> Option<&Socket> {
        self.peer.as_ref()
    }

    /// Waits until a connection or, if `reads`, a message is there, for at most `span`.
    pub fn wait(&self, span: Duration, reads: bool) {
        let span = Some(TimeSpec::from_duration(span));
        let listener = readable(&self.listener);
        // An interruption is a shorter wait.
        match self.peer.as_ref().filter(|_| reads) {
            Some(peer) => ppoll(&mut [listener, readable(peer)], span, None).ok(),
            None => ppoll(&mut [listener], span, None).ok(),
        };
    }

    /// Accepts a connection, if there is one; returns the user and process at its other end.
    pub fn accept(&mut self) -> Option<Arrival> {
        let (socket, _) = self.listener.accept().ok()?;
        let who = getsockopt(&socket, PeerCredentials).ok()?;
        if self.peer.is_some() {
            return Some(Arrival::Second(who));
        }
        socket.set_nonblocking(true).ok()?;
        socket.set_send_buffer_size(SEND_BUFFER).ok()?;
        self.peer = Some(socket);
        Some(Arrival::Peer(who))
    }

    /// Sends a message; returns whether the peer's queue had room for it.
    pub fn send(&self, message: &[u8]) -> bool {
        let flags = MsgFlags::MSG_DONTWAIT | MsgFlags::MSG_NOSIGNAL;
        self.peer.as_ref().is_some_and(|peer| send(peer.as_raw_fd(), message, flags).is_ok())
    }

    /// Receives a message. One that is longer than the buffer fills it.
    pub fn receive(&mut self, buffer: &mut [u8]) -> Reception {
        let Some(peer) = &self.peer else { return Reception::Nothing };
        let found = match recv(peer.as_raw_fd(), buffer, MsgFlags::MSG_DONTWAIT) {
            Ok(0) if is_closed(peer) => Reception::Closed,
            Ok(length) => Reception::Message(length),
            Err(Errno::EAGAIN | Errno::EINTR) => Reception::Nothing,
            Err(_) => Reception::Closed,
        };
        if found == Reception::Closed {
            self.peer = None;
        }
        found
    }
}

fn readable(socket: &Socket) -> PollFd<'_> {
    PollFd::new(socket.as_fd(), PollFlags::POLLIN)
}

/// Returns whether the peer has closed its end: an empty message reads as the end does.
fn is_closed(peer: &Socket) -> bool {
    // nix does not know this flag, and returns no flags where it is set.
    let asked = PollFlags::from_bits_retain(POLLRDHUP);
    let mut sockets = [PollFd::new(peer.as_fd(), asked)];
    let polled = ppoll(&mut sockets, Some(TimeSpec::from_duration(Duration::ZERO)), None);
    let ended = PollFlags::POLLHUP | PollFlags::POLLERR;
    polled.is_err() || sockets.iter().any(|one| one.revents().is_none_or(|it| it.intersects(ended)))
}
