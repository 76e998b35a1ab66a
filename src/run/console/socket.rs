//! The socket's place in the file system: who may connect, and what may be replaced.

use std::ffi::OsStr;
use std::ffi::OsString;
use std::fs;
use std::fs::DirBuilder;
use std::fs::File;
use std::fs::Permissions;
use std::io;
use std::os::unix::fs::DirBuilderExt;
use std::os::unix::fs::FileTypeExt;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::path::PathBuf;

use tokio::net::UnixListener;
use tokio::net::UnixStream;

/// Read and write for this user and group alone.
const RIGHTS: u32 = 0o660;

/// Place of the service's socket.
const OF_SERVICE: &str = "/run/frhc/node.sock";

/// Place of a node's socket unless configured otherwise.
///
/// A variable that is empty or names a relative path is ignored, as the XDG base directories demand.
pub(crate) fn default_socket() -> PathBuf {
    default_of(|name| std::env::var_os(name))
}

fn default_of(variable: impl Fn(&str) -> Option<OsString>) -> PathBuf {
    let folder = |name| variable(name).map(PathBuf::from).filter(|folder| folder.is_absolute());
    let service = folder("RUNTIME_DIRECTORY").map(|folder| folder.join("node.sock"));
    let user = || folder("XDG_RUNTIME_DIR").map(|folder| folder.join("frhc/node.sock"));
    service.or_else(user).unwrap_or_else(|| PathBuf::from(OF_SERVICE))
}

/// Places at which a node may listen that nobody has configured: the user's own, then the service.
pub(crate) fn usual_sockets() -> Vec<PathBuf> {
    let mut places = vec![default_socket(), PathBuf::from(OF_SERVICE)];
    places.dedup();
    places
}

/// The socket, removed when dropped.
#[derive(Debug)]
pub(crate) struct Socket {
    path: PathBuf,
    pub(super) listener: UnixListener,
}

impl Socket {
    /// Listens at `path`. A socket that refuses connections is replaced, and nothing else.
    ///
    /// # Errors
    /// When a node listens there, something other than a socket is there, or the folder cannot be written.
    pub(crate) async fn bind(path: PathBuf) -> io::Result<Self> {
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        let folder = folder.unwrap_or(Path::new("."));
        fs::create_dir_all(folder)?;
        // Held until the socket is in its place: of two nodes that start together one is refused.
        let lock = File::open(folder)?;
        lock.try_lock().map_err(|_| in_use("another node is starting here"))?;
        make_room(&path).await?;
        let listener = listen_at(folder, &path)?;
        Ok(Self { path, listener })
    }
}

impl Drop for Socket {
    fn drop(&mut self) {
        if let Err(error) = fs::remove_file(&self.path) {
            tracing::debug!(%error, "control socket not removed");
        }
    }
}

fn in_use(reason: &str) -> io::Error {
    io::Error::new(io::ErrorKind::AddrInUse, reason)
}

/// Removes a socket that refuses connections.
async fn make_room(path: &Path) -> io::Result<()> {
    let kind = match fs::symlink_metadata(path) {
        Ok(found) => found.file_type(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error),
    };
    if !kind.is_socket() {
        let reason = "not a socket: remove it, or name another place in [node] socket";
        return Err(io::Error::new(io::ErrorKind::AlreadyExists, reason));
    }
    match UnixStream::connect(path).await {
        Err(error) if error.kind() == io::ErrorKind::ConnectionRefused => fs::remove_file(path),
        // The queue of those who wait to connect is full: it is alive.
        Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
            Err(in_use("another node listens here and is busy"))
        }
        Ok(_) => Err(in_use("another node listens here")),
        Err(error) => Err(error),
    }
}

/// A socket made in a folder that only this user enters, and linked to its place with its final rights.
fn listen_at(folder: &Path, path: &Path) -> io::Result<UnixListener> {
    let private = folder.join(format!(".{}", std::process::id()));
    // Left by a process of this number that was killed here.
    clear(&private);
    DirBuilder::new().mode(0o700).create(&private)?;
    let made = private.join(OsStr::new("s"));
    let listener = UnixListener::bind(&made).and_then(|listener| {
        fs::set_permissions(&made, Permissions::from_mode(RIGHTS))?;
        // Unlike a renaming this replaces nothing.
        fs::hard_link(&made, path)?;
        Ok(listener)
    });
    clear(&private);
    listener
}

/// Removes the private folder, if it is there.
fn clear(private: &Path) {
    fs::remove_file(private.join("s")).ok();
    fs::remove_dir(private).ok();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_absolute_folders_are_places_of_the_socket() {
        let place = |runtime: Option<&str>, user: Option<&str>| {
            default_of(|name| {
                if name == "RUNTIME_DIRECTORY" { runtime } else { user }.map(OsString::from)
            })
        };
        assert_eq!(place(Some("/run/frhc"), Some("/u")), Path::new("/run/frhc/node.sock"));
        assert_eq!(place(None, Some("/run/user/7")), Path::new("/run/user/7/frhc/node.sock"));
        for wrong in [None, Some(""), Some("frhc"), Some("./here")] {
            assert_eq!(place(wrong, wrong), Path::new("/run/frhc/node.sock"), "{wrong:?}");
        }
    }

    use std::os::unix::fs::symlink;
    use std::os::unix::net::UnixListener as Blocking;
    use std::os::unix::net::UnixStream as Stream;

    /// A folder of this test alone.
    fn folder(name: &str) -> PathBuf {
        let folder = crate::scratch::path(name);
        fs::create_dir(&folder).unwrap();
        folder
    }

    fn bind(path: &Path) -> io::Result<Socket> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(Socket::bind(path.to_path_buf()))
    }

    #[test]
    fn socket_appears_with_its_final_rights_and_leaves_nothing() {
        let folder = folder("rights");
        let path = folder.join("node.sock");
        let socket = bind(&path).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, RIGHTS);
        Stream::connect(&path).unwrap();
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 1);
        drop(socket);
        assert_eq!(fs::read_dir(&folder).unwrap().count(), 0);
        fs::remove_dir(&folder).unwrap();
    }

    #[test]
    fn file_or_link_at_the_sockets_place_is_kept() {
        let folder = folder("kept");
        let (file, link) = (folder.join("results.csv"), folder.join("link"));
        fs::write(&file, "1,2,3").unwrap();
        symlink(&file, &link).unwrap();
        for path in [&file, &link, &folder] {
            let refused = bind(path).unwrap_err().to_string();
            assert!(refused.starts_with("not a socket"), "{refused}");
        }
        assert_eq!(fs::read_to_string(&link).unwrap(), "1,2,3");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn socket_that_refuses_connections_is_replaced() {
        let folder = folder("stale");
        let path = folder.join("node.sock");
        drop(Blocking::bind(&path).unwrap());
        bind(&path).unwrap();
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn node_with_a_full_backlog_is_not_replaced() {
        let folder = folder("backlog");
        let path = folder.join("node.sock");
        let living = Blocking::bind(&path).unwrap();
        assert_eq!(bind(&path).unwrap_err().to_string(), "another node listens here");
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let mut waiting = Vec::new();
        while let Ok(stream) = runtime.block_on(UnixStream::connect(&path)) {
            waiting.push(stream);
        }
        let refused = bind(&path).unwrap_err().to_string();
        assert_eq!(refused, "another node listens here and is busy");
        drop((living, waiting));
        fs::remove_dir_all(&folder).unwrap();
    }
}
