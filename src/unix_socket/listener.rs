//! Listening Unix socket and its file: permissions, replacement of a stale one, removal at the end.

use std::ffi::{OsStr, OsString};
use std::fs::{self, DirBuilder, File, Metadata, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{
    DirBuilderExt, FileTypeExt, MetadataExt, OpenOptionsExt, PermissionsExt, chown,
};
use std::path::{Path, PathBuf};

use nix::libc::{EPROTOTYPE, O_NOFOLLOW};
use nix::unistd::Group;
use socket2::{Domain, SockAddr, Socket, Type};

/// Permissions: read and write for this user and group only.
const PERMISSIONS: u32 = 0o660;

/// Permission bits of a folder: every user may write it; a file in it can be replaced by its owner alone.
const WRITABLE_BY_OTHERS: u32 = 0o002;
const STICKY: u32 = 0o1000;

/// File of a listening socket. Dropping it removes the file, unless another one is at its path by then.
#[derive(Debug)]
pub struct SocketFile {
    path: PathBuf,
    identity: Identity,
}

/// Listens at `path` with a socket that `bind` binds to the path it gets. Its file belongs to `group`, if the system has that
/// group. Replaces a stale socket, which refuses connections, and no other file.
///
/// # Errors
/// When another process listens there, or the file is not a socket. When this user cannot write the folder, or any
/// user can. When this process is not a member of the group.
pub fn listen<L>(
    path: PathBuf,
    group: Option<&str>,
    bind: impl FnOnce(&Path) -> io::Result<L>,
) -> io::Result<(L, SocketFile)> {
    let folder = path.parent().filter(|folder| *folder != Path::new(""));
    let folder = folder.unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    refuse_open_folder(folder)?;
    // Held until the socket exists: of two processes that start together one is refused.
    let _lock = StartLock::take(start_lock_of(folder, &path))?;
    remove_stale(&path)?;
    let (listener, identity) = listen_at(folder, &path, group, bind)?;
    Ok((listener, SocketFile { path, identity }))
}

/// Listens at `path` with a SEQPACKET socket, as [`listen`] does; `backlog` connections may wait to be accepted.
///
/// # Errors
/// As [`listen`].
pub fn listen_for_messages(
    path: PathBuf,
    group: Option<&str>,
    backlog: i32,
) -> io::Result<(Socket, SocketFile)> {
    listen(path, group, |path| {
        let socket = Socket::new(Domain::UNIX, Type::SEQPACKET, None)?;
        socket.bind(&SockAddr::unix(path)?)?;
        socket.listen(backlog)?;
        Ok(socket)
    })
}

/// Refuses a folder in which any user can put another socket in place of this one, and so pass for the node.
fn refuse_open_folder(folder: &Path) -> io::Result<()> {
    let mode = fs::metadata(folder)?.permissions().mode();
    if mode & WRITABLE_BY_OTHERS == 0 || mode & STICKY != 0 {
        return Ok(());
    }
    let reason = format!(
        "folder {}: every user may write it, and replace the socket: chmod o-w it, or set another path",
        folder.display()
    );
    Err(io::Error::new(io::ErrorKind::PermissionDenied, reason))
}

impl Drop for SocketFile {
    fn drop(&mut self) {
        if !is_at(&self.path, self.identity) {
            tracing::warn!("{}: not the socket of this process, kept", self.path.display());
        } else if let Err(error) = fs::remove_file(&self.path) {
            tracing::debug!(%error, "{}: not removed", self.path.display());
        }
    }
}

/// Device and inode of a file.
type Identity = (u64, u64);

fn identity(file: &Metadata) -> Identity {
    (file.dev(), file.ino())
}

fn is_at(path: &Path, file: Identity) -> bool {
    fs::symlink_metadata(path).is_ok_and(|found| identity(&found) == file)
}

/// Lock of the processes that start on one socket: a file that its owner alone can open, and so lock. Removed when dropped.
#[derive(Debug)]
struct StartLock {
    path: PathBuf,
    _file: File,
}

/// Returns the path of the lock that processes starting on `socket` share.
fn start_lock_of(folder: &Path, socket: &Path) -> PathBuf {
    let mut name = OsString::from(".");
    name.push(socket.file_name().unwrap_or(OsStr::new("node.sock")));
    name.push(".lock");
    folder.join(name)
}

impl StartLock {
    fn take(path: PathBuf) -> io::Result<Self> {
        loop {
            let mut options = OpenOptions::new();
            options.write(true).create(true).truncate(false).mode(0o600);
            // A link of another user leads to no file.
            let opened = options.custom_flags(O_NOFOLLOW).open(&path);
            let named = |error: io::Error| {
                io::Error::new(error.kind(), format!("{}: {error}", path.display()))
            };
            let file = opened.map_err(named)?;
            file.try_lock().map_err(|_| in_use("another process is starting on this socket"))?;
            // A process that ends its start removes the file: another one may have the path since it was opened.
            if is_at(&path, identity(&file.metadata()?)) {
                return Ok(Self { path, _file: file });
            }
        }
    }
}

impl Drop for StartLock {
    fn drop(&mut self) {
        fs::remove_file(&self.path).ok();
    }
}

fn in_use(reason: &str) -> io::Error {
    io::Error::new(io::ErrorKind::AddrInUse, reason)
}

/// Removes a socket that refuses connections.
fn remove_stale(path: &Path) -> io::Result<()> {
    let kind = match fs::symlink_metadata(path) {
        Ok(found) => found.file_type(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error),
    };
    if !kind.is_socket() {
        let reason = "not a socket: remove it, or set another path";
        return Err(io::Error::new(io::ErrorKind::AlreadyExists, reason));
    }
    let probe = Socket::new(Domain::UNIX, Type::STREAM.nonblocking(), None)?;
    match probe.connect(&SockAddr::unix(path)?) {
        Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => fs::remove_file(path),
        // The backlog is full, so a process listens.
        Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
            Err(in_use("another process listens on this socket and is busy"))
        }
        // Of another type, so a process listens.
        Err(error) if error.raw_os_error() == Some(EPROTOTYPE) => Err(listened()),
        Ok(()) => Err(listened()),
        Err(error) => Err(error),
    }
}

fn listened() -> io::Error {
    in_use("another process listens on this socket")
}

/// Creates the socket in a private folder, sets its permissions, and only then links it to `path`.
fn listen_at<L>(
    folder: &Path,
    path: &Path,
    group: Option<&str>,
    bind: impl FnOnce(&Path) -> io::Result<L>,
) -> io::Result<(L, Identity)> {
    let private = folder.join(format!(".{}", std::process::id()));
    // Left by a killed process with the same id.
    clear(&private);
    DirBuilder::new().mode(0o700).create(&private)?;
    let made = private.join(OsStr::new("s"));
    let listener = bind(&made).and_then(|listener| {
        group.map_or(Ok(()), |group| give(&made, group))?;
        fs::set_permissions(&made, Permissions::from_mode(PERMISSIONS))?;
        // A hard link, unlike a rename, never replaces a file.
        fs::hard_link(&made, path)?;
        Ok((listener, identity(&fs::symlink_metadata(&made)?)))
    });
    clear(&private);
    listener
}

/// Gives a file to a group, if the system has it.
fn give(file: &Path, name: &str) -> io::Result<()> {
    let Some(group) = Group::from_name(name)? else { return Ok(()) };
    chown(file, None, Some(group.gid.as_raw())).map_err(|error| {
        let reason = format!("group {name}: {error}: add this user to it");
        io::Error::new(error.kind(), reason)
    })
}

/// Removes the private folder, if it exists.
fn clear(private: &Path) {
    fs::remove_file(private.join("s")).ok();
    fs::remove_dir(private).ok();
}

#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;
    use std::os::unix::net::{UnixListener, UnixStream};

    use tempfile::TempDir;

    use super::*;

    fn folder() -> TempDir {
        tempfile::tempdir().unwrap()
    }

    fn bind(path: &Path) -> io::Result<(UnixListener, SocketFile)> {
        listen(path.to_path_buf(), None, |path| UnixListener::bind(path))
    }

    #[test]
    fn hazard_37_socket_has_its_permissions_and_leaves_no_files() {
        let folder = folder();
        let folder = folder.path();
        let path = folder.join("node.sock");
        let socket = bind(&path).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, PERMISSIONS);
        UnixStream::connect(&path).unwrap();
        assert_eq!(fs::read_dir(folder).unwrap().count(), 1);
        drop(socket);
        assert_eq!(fs::read_dir(folder).unwrap().count(), 0);
    }

    #[test]
    fn shared_lock_on_the_folder_stops_no_start() {
        let folder = folder();
        let folder = folder.path();
        let path = folder.join("node.sock");
        // Any user may read the folder of the service's socket, and so lock it.
        let others = File::open(folder).unwrap();
        others.lock_shared().unwrap();
        drop(bind(&path).unwrap());
        let lock = start_lock_of(folder, &path);
        let starting = StartLock::take(lock.clone()).unwrap();
        assert_eq!(fs::metadata(&lock).unwrap().permissions().mode() & 0o777, 0o600);
        let refused = bind(&path).unwrap_err().to_string();
        assert_eq!(refused, "another process is starting on this socket");
        drop(starting);
        drop(bind(&path).unwrap());
    }

    #[test]
    fn ended_node_keeps_a_file_that_is_not_its_socket() {
        let folder = folder();
        let folder = folder.path();
        let path = folder.join("node.sock");
        let socket = bind(&path).unwrap();
        fs::remove_file(&path).unwrap();
        let others = bind(&path).unwrap();
        drop(socket);
        UnixStream::connect(&path).unwrap();
        fs::remove_file(&path).unwrap();
        fs::write(&path, "1,2,3").unwrap();
        drop(others);
        assert_eq!(fs::read_to_string(&path).unwrap(), "1,2,3");
    }

    #[test]
    fn hazard_37_folder_in_which_every_user_may_write_is_refused() {
        let folder = folder();
        let folder = folder.path();
        fs::set_permissions(folder, Permissions::from_mode(0o777)).unwrap();
        let refused = bind(&folder.join("node.sock")).unwrap_err().to_string();
        assert!(refused.contains("every user may write it"), "{refused}");
        assert_eq!(fs::read_dir(folder).unwrap().count(), 0);
        // As /tmp.
        fs::set_permissions(folder, Permissions::from_mode(0o1777)).unwrap();
        drop(bind(&folder.join("node.sock")).unwrap());
    }

    #[test]
    fn file_or_link_at_the_socket_path_is_kept() {
        let folder = folder();
        let folder = folder.path();
        let (file, link) = (folder.join("results.csv"), folder.join("link"));
        fs::write(&file, "1,2,3").unwrap();
        symlink(&file, &link).unwrap();
        for path in [&file, &link, &folder.to_path_buf()] {
            let refused = bind(path).unwrap_err().to_string();
            assert!(refused.starts_with("not a socket"), "{refused}");
        }
        assert_eq!(fs::read_to_string(&link).unwrap(), "1,2,3");
    }

    #[test]
    fn socket_that_refuses_connections_is_replaced() {
        let folder = folder();
        let folder = folder.path();
        let path = folder.join("node.sock");
        drop(UnixListener::bind(&path).unwrap());
        bind(&path).unwrap();
    }

    #[test]
    fn node_with_a_full_backlog_is_not_replaced() {
        let folder = folder();
        let folder = folder.path();
        let path = folder.join("node.sock");
        let living = UnixListener::bind(&path).unwrap();
        assert_eq!(bind(&path).unwrap_err().to_string(), "another process listens on this socket");
        let connected = || {
            let client = Socket::new(Domain::UNIX, Type::STREAM.nonblocking(), None).unwrap();
            client.connect(&SockAddr::unix(&path).unwrap()).map(|()| client)
        };
        let waiting: Vec<_> = std::iter::from_fn(|| connected().ok()).collect();
        let refused = bind(&path).unwrap_err().to_string();
        assert_eq!(refused, "another process listens on this socket and is busy");
        drop((living, waiting));
    }
}
