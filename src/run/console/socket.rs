//! Path of the control socket.

use std::ffi::{OsStr, OsString};
use std::io;
use std::os::unix::ffi::OsStrExt;
use std::path::PathBuf;

use tokio::net::UnixListener;

use unix_socket::SocketFile;

/// Socket of the systemd service.
const SERVICE_SOCKET: &str = "/run/frhc/node.sock";

/// Returns the path of a node's socket if none is configured.
///
/// Ignores a variable that is empty or a relative path, as the XDG Base Directory Specification requires.
pub(crate) fn default_socket() -> PathBuf {
    default_of(|name| std::env::var_os(name))
}

fn default_of(variable: impl Fn(&str) -> Option<OsString>) -> PathBuf {
    let folder = |name| variable(name).map(PathBuf::from).filter(|folder| folder.is_absolute());
    // systemd.exec(5): with several folders, a list.
    let first = |name: &str| {
        let list = variable(name)?;
        let first = list.as_bytes().split(|byte| *byte == b':').next()?;
        Some(OsStr::from_bytes(first).to_owned())
    };
    let service = first("RUNTIME_DIRECTORY").map(PathBuf::from);
    let service = service.filter(|folder| folder.is_absolute());
    let service = service.map(|folder| folder.join("node.sock"));
    let user = || folder("XDG_RUNTIME_DIR").map(|folder| folder.join("frhc/node.sock"));
    service.or_else(user).unwrap_or_else(|| PathBuf::from(SERVICE_SOCKET))
}

/// Returns the paths that `ctl` tries if none is configured: the user's own node, then the service.
pub(crate) fn default_sockets() -> Vec<PathBuf> {
    let mut places = vec![default_socket(), PathBuf::from(SERVICE_SOCKET)];
    places.dedup();
    places
}

/// Listening socket, which removes its file when dropped.
#[derive(Debug)]
pub(crate) struct Socket {
    _file: SocketFile,
    pub(super) listener: UnixListener,
}

impl Socket {
    /// Listens at `path`, in an async runtime. Replaces a stale socket, which refuses connections, and no other file.
    ///
    /// # Errors
    /// When another node listens there, the file is not a socket, or the folder cannot be written.
    pub(crate) fn bind(path: PathBuf) -> io::Result<Self> {
        let (listener, file) = unix_socket::listen(path, None, |path| UnixListener::bind(path))?;
        Ok(Self { _file: file, listener })
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn relative_folders_are_ignored_for_the_socket() {
        let place = |runtime: Option<&str>, user: Option<&str>| {
            default_of(|name| {
                if name == "RUNTIME_DIRECTORY" { runtime } else { user }.map(OsString::from)
            })
        };
        assert_eq!(place(Some("/run/frhc"), Some("/u")), Path::new("/run/frhc/node.sock"));
        assert_eq!(place(Some("/run/frhc:/run/frhc-view"), None), Path::new("/run/frhc/node.sock"));
        assert_eq!(place(None, Some("/run/user/7")), Path::new("/run/user/7/frhc/node.sock"));
        for wrong in [None, Some(""), Some("frhc"), Some("./here")] {
            assert_eq!(place(wrong, wrong), Path::new("/run/frhc/node.sock"), "{wrong:?}");
        }
    }
}
