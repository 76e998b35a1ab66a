//! Connection of a far side to the node over a Unix socket of type SEQPACKET: a packet is a message. The connection is
//! retried when it ends. Only [`FarSocket::wait`] blocks.
#![forbid(unsafe_code)]

use std::fs;
use std::io::{self, ErrorKind, Read};
use std::os::fd::AsFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::FileTypeExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use nix::libc::{ENOBUFS, EPROTOTYPE, MSG_DONTWAIT, MSG_NOSIGNAL};
use nix::poll::{PollFd, PollFlags, ppoll};
use nix::sys::time::TimeSpec;
use socket2::{Domain, SockAddr, Socket, Type};
use thiserror::Error;

use units::time::Instant;

/// Maximum number of messages taken in one period.
const MAX_MESSAGES: usize = 16;

/// Length of the receive buffer, in bytes. Messages of the contract are shorter; truncated ones are rejected.
const MAX_LENGTH: usize = 512;

/// Time until the next attempt to connect.
const RETRY_AFTER: Duration = Duration::from_millis(100);

/// Time until the next attempt after a connection that the node closed immediately, or that failed.
const REFUSED_RETRY_AFTER: Duration = Duration::from_secs(2);

/// Maximum length of a socket's path, in bytes (unix(7)).
const MAX_PATH: usize = 107;

/// Reason why a path cannot be that of the node's socket.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct Unusable(String);

/// Change of the connection.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SocketEvent {
    /// No node listens.
    Absent(PathBuf),
    /// Absent folder of the socket: no node has started yet, or the path is wrong.
    NoFolder(PathBuf),
    /// First message of the node.
    Connected(PathBuf),
    /// Connection that the node closed before it sent a message.
    Refused(PathBuf),
    /// Connection that the node closed.
    Closed,
    /// Failed connection, with the system's error.
    Failed(PathBuf, String),
}

impl SocketEvent {
    /// Writes the line.
    pub fn log(&self) {
        match self {
            Self::Absent(path) => {
                tracing::info!("{}: waits for a node; none listens there yet", path.display());
            }
            Self::NoFolder(path) => tracing::warn!(
                "{}: waits for a node; the folder does not exist, is the path the node's?",
                path.display()
            ),
            Self::Connected(path) => tracing::info!("{}: connected to a node", path.display()),
            Self::Refused(path) => tracing::warn!(
                "{}: the node closed the connection at once; is another far side connected? Tries again every {} s",
                path.display(),
                REFUSED_RETRY_AFTER.as_secs()
            ),
            Self::Closed => tracing::warn!("the node closed the connection"),
            Self::Failed(path, error) => tracing::warn!("{}: {error}", path.display()),
        }
    }
}

/// Connection to the node, retried when it ends.
#[derive(Debug)]
pub struct FarSocket {
    path: PathBuf,
    address: SockAddr,
    connection: Option<Connection>,
    /// Earliest time of the next attempt.
    retry_at: Instant,
    events: Vec<SocketEvent>,
    /// Newest event: the same one is reported once.
    newest: Option<SocketEvent>,
}

/// Connected socket.
#[derive(Debug)]
struct Connection {
    socket: Socket,
    /// Set if the node has sent a message.
    is_confirmed: bool,
}

impl FarSocket {
    /// Checks the path, and connects if a node listens.
    ///
    /// # Errors
    /// Returns an error if the path is too long, is not a socket, or is a socket without access for this user.
    pub fn open(path: &Path) -> Result<Self, Unusable> {
        let address = address(path)?;
        check_file(path)?;
        let mut link = Self {
            path: path.to_path_buf(),
            address,
            connection: None,
            retry_at: Instant::ZERO,
            events: Vec::new(),
            newest: None,
        };
        match link.connect() {
            Ok(()) => Ok(link),
            Err(error) if is_absent(&error) => Ok(link),
            Err(error) => Err(Unusable(refusal(path, &error))),
        }
    }

    /// Takes the received messages, at most 16, and reconnects when it is time.
    pub fn receive(&mut self, now: Instant, mut take: impl FnMut(&[u8])) {
        if self.connection.is_none() && now >= self.retry_at {
            self.retry(now);
        }
        let mut buffer = [0; MAX_LENGTH];
        for _ in 0..MAX_MESSAGES {
            let Some(connection) = &mut self.connection else { return };
            match connection.socket.read(&mut buffer) {
                Ok(0) => return self.lose(now, None),
                Ok(length) => {
                    if !std::mem::replace(&mut connection.is_confirmed, true) {
                        self.report(SocketEvent::Connected(self.path.clone()));
                    }
                    take(buffer.get(..length).unwrap_or_default());
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) => return self.lose(now, Some(&error)),
            }
        }
    }

    /// Waits until a message is there or the connection has ended, for at most `span`.
    pub fn wait(&self, span: Duration) {
        let span = Some(TimeSpec::from_duration(span));
        let socket = self.connection.as_ref().map(|connection| connection.socket.as_fd());
        let mut waits: Vec<_> =
            socket.into_iter().map(|socket| PollFd::new(socket, PollFlags::POLLIN)).collect();
        // An interruption is a shorter wait.
        ppoll(&mut waits, span, None).ok();
    }

    /// Returns the non-blocking socket of the present connection.
    pub fn socket(&self) -> Option<&Socket> {
        self.connection.as_ref().map(|connection| &connection.socket)
    }

    /// Sends a message; drops it if the node does not read or is not connected.
    pub fn send(&mut self, now: Instant, message: &[u8]) {
        let Some(connection) = &self.connection else { return };
        let sent = connection.socket.send_with_flags(message, MSG_DONTWAIT | MSG_NOSIGNAL);
        let is_full = |error: &io::Error| {
            matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::Interrupted)
                || error.raw_os_error() == Some(ENOBUFS)
        };
        if let Err(error) = sent
            && !is_full(&error)
        {
            self.lose(now, Some(&error));
        }
    }

    /// Returns whether the node has sent a message over the present connection.
    pub fn is_connected(&self) -> bool {
        self.connection.as_ref().is_some_and(|connection| connection.is_confirmed)
    }

    /// Returns the changes since the last call.
    pub fn events(&mut self) -> impl Iterator<Item = SocketEvent> {
        self.events.drain(..)
    }

    fn connect(&mut self) -> io::Result<()> {
        let socket = Socket::new(Domain::UNIX, Type::SEQPACKET.nonblocking(), None)?;
        socket.connect(&self.address)?;
        self.connection = Some(Connection { socket, is_confirmed: false });
        Ok(())
    }

    fn retry(&mut self, now: Instant) {
        match self.connect() {
            Ok(()) => {}
            Err(error) if is_absent(&error) => {
                self.retry_at = now + RETRY_AFTER;
                let path = self.path.clone();
                let is_missing = error.kind() == ErrorKind::NotFound && !has_folder(&path);
                self.report(if is_missing {
                    SocketEvent::NoFolder(path)
                } else {
                    SocketEvent::Absent(path)
                });
            }
            Err(error) => {
                self.retry_at = now + REFUSED_RETRY_AFTER;
                self.report(SocketEvent::Failed(self.path.clone(), error.to_string()));
            }
        }
    }

    /// Ends the connection; `error` is that of the socket, `None` at its end of file.
    fn lose(&mut self, now: Instant, error: Option<&io::Error>) {
        let Some(Connection { is_confirmed, .. }) = self.connection.take() else { return };
        let is_closed = error.is_none_or(|error| {
            matches!(error.kind(), ErrorKind::BrokenPipe | ErrorKind::ConnectionReset)
        });
        self.retry_at = now + if is_confirmed { RETRY_AFTER } else { REFUSED_RETRY_AFTER };
        self.report(match (is_confirmed, error) {
            (_, Some(error)) if !is_closed => {
                SocketEvent::Failed(self.path.clone(), error.to_string())
            }
            (false, _) => SocketEvent::Refused(self.path.clone()),
            (true, _) => SocketEvent::Closed,
        });
    }

    fn report(&mut self, event: SocketEvent) {
        if self.newest.as_ref() != Some(&event) {
            self.newest = Some(event.clone());
            self.events.push(event);
        }
    }
}

/// Returns the socket address of `path`; an error above [`MAX_PATH`] bytes.
fn address(path: &Path) -> Result<SockAddr, Unusable> {
    let length = path.as_os_str().as_bytes().len();
    let shown = path.display();
    if length > MAX_PATH {
        return Err(Unusable(format!(
            "{shown}: too long for a socket: at most {MAX_PATH} bytes, got {length}; set a shorter path"
        )));
    }
    SockAddr::unix(path).map_err(|error| Unusable(format!("{shown}: {error}")))
}

/// Checks that the file at `path`, if there is one, is a socket.
fn check_file(path: &Path) -> Result<(), Unusable> {
    match fs::metadata(path) {
        Ok(found) if !found.file_type().is_socket() => {
            Err(Unusable(format!("{}: not a socket; set the node's", path.display())))
        }
        // Other errors are those of connecting.
        Ok(_) | Err(_) => Ok(()),
    }
}

/// Returns whether the folder of a path exists; that of a bare name is the present one.
fn has_folder(path: &Path) -> bool {
    path.parent().is_none_or(|folder| folder.as_os_str().is_empty() || folder.exists())
}

/// Returns whether connecting failed because no node listens yet, or because it is busy.
fn is_absent(error: &io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::NotFound | ErrorKind::ConnectionRefused | ErrorKind::WouldBlock
    )
}

/// Returns the text of an error of connecting, with a remedy.
fn refusal(path: &Path, error: &io::Error) -> String {
    let reason = if error.kind() == ErrorKind::PermissionDenied {
        "permission denied; this user must be in the group of the socket, frhc-link".to_owned()
    } else if error.raw_os_error() == Some(EPROTOTYPE) {
        "not a socket for a far side, but of another type; is it that of `frhc ctl`?".to_owned()
    } else {
        error.to_string()
    };
    format!("{}: {reason}", path.display())
}

#[cfg(test)]
mod tests;
