//! Settings of an end: a small TOML file.

use std::env;
use std::net::{Ipv6Addr, UdpSocket};
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::Spanned;

use crate::failure::Failure;
use crate::role::Role;

/// Default UDP port, that of zenoh.
const PORT: u16 = 7_447;

/// Valid values of `in_flight`: maximum number of messages that are not echoed yet.
const IN_FLIGHT: std::ops::RangeInclusive<usize> = 8..=1_024;

/// Keys of the file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default = "first_arm")]
    arm: u16,
    keys: PathBuf,
    listen: Option<Spanned<Vec<Spanned<String>>>>,
    connect: Option<Spanned<Vec<Spanned<String>>>>,
    socket: Option<PathBuf>,
    in_flight: Option<Spanned<usize>>,
}

/// Returns the default number of the arm, as in the node's file.
const fn first_arm() -> u16 {
    1
}

/// Settings of an end.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Settings {
    /// Number of the arm.
    pub arm: u16,
    /// Folder of the keys.
    pub keys: PathBuf,
    /// Addresses, as HOST:PORT, at which this end listens.
    pub listen: Vec<String>,
    /// Addresses, as HOST:PORT, to which this end connects.
    pub connect: Vec<String>,
    /// Unix socket: that of the node for a near end, the end's own for a far end.
    pub socket: PathBuf,
    /// Maximum number of messages that are not echoed.
    pub in_flight: usize,
}

impl Settings {
    /// Reads a file.
    ///
    /// # Errors
    /// Returns file, line, key and reason if the file cannot be read or a key is invalid.
    pub fn load(role: Role, file: &Path) -> Result<Self, Failure> {
        let shown = file.display();
        let text = std::fs::read_to_string(file)
            .map_err(|error| Failure::configuration(format!("{shown}: {error}")))?;
        let settings = Self::read(role, &text);
        let mut settings = settings.map_err(|(offset, reason)| {
            let line = text.bytes().take(offset).filter(|byte| *byte == b'\n').count() + 1;
            let key = toml_input::key_at(&text, offset);
            let key = if key.is_empty() { key } else { format!("{key}: ") };
            Failure::configuration(format!("{shown}:{line}: {key}{reason}"))
        })?;
        let folder = file.parent().unwrap_or(Path::new(""));
        settings.keys = folder.join(&settings.keys);
        Ok(settings)
    }

    /// Reads the text of a file; an error has its place in it.
    fn read(role: Role, text: &str) -> Result<Self, (usize, String)> {
        let file: File = toml::from_str(text).map_err(|error| {
            let offset = error.span().map_or(0, |span| span.start);
            (offset, error.message().replace('`', "\""))
        })?;
        let listen = file.listen.as_ref().map(addresses).transpose()?;
        let connect = file.connect.as_ref().map(addresses).transpose()?;
        let in_flight = match &file.in_flight {
            None => 128,
            Some(given) if IN_FLIGHT.contains(given.get_ref()) => *given.get_ref(),
            Some(given) => {
                let (least, most) = IN_FLIGHT.into_inner();
                let reason = format!("must be within {least} to {most}, got {}", given.get_ref());
                return Err((given.span().start, reason));
            }
        };
        let listen = match (listen, &connect) {
            (Some(listen), _) => listen,
            (None, Some(_)) => Vec::new(),
            (None, None) => vec![format!("{}:{PORT}", any_address())],
        };
        Ok(Self {
            arm: file.arm,
            keys: file.keys,
            listen,
            connect: connect.unwrap_or_default(),
            socket: file.socket.unwrap_or_else(|| default_socket(role)),
            in_flight,
        })
    }
}

/// Returns the addresses of a list, each with a port.
fn addresses(list: &Spanned<Vec<Spanned<String>>>) -> Result<Vec<String>, (usize, String)> {
    if list.get_ref().is_empty() {
        return Err((list.span().start, "must have an address; leave the key out for none".into()));
    }
    let checked = |text: &Spanned<String>| {
        address(text.get_ref()).map_err(|reason| (text.span().start, reason))
    };
    list.get_ref().iter().map(checked).collect()
}

/// Returns an address with its port; an IPv6 address has brackets.
fn address(text: &str) -> Result<String, String> {
    let refused = |reason: &str| Err(format!("{text:?}: {reason}; expected HOST or HOST:PORT"));
    let (host, port) = match text.strip_prefix('[').map(|rest| rest.split_once(']')) {
        Some(Some((host, port))) if host.parse::<Ipv6Addr>().is_ok() => {
            (format!("[{host}]"), port.strip_prefix(':').or(port.is_empty().then_some("")))
        }
        Some(_) => return refused("no IPv6 address in brackets"),
        None => match text.split_once(':') {
            Some((_, port)) if port.contains(':') => {
                return refused("an IPv6 address needs brackets");
            }
            Some((host, port)) => (host.to_owned(), (!port.is_empty()).then_some(port)),
            None => (text.to_owned(), Some("")),
        },
    };
    let is_of_a_host = |symbol: char| symbol.is_ascii_alphanumeric() || "-.[]:".contains(symbol);
    if host.is_empty() || !host.chars().all(is_of_a_host) {
        return refused("no host");
    }
    match port {
        Some("") => Ok(format!("{host}:{PORT}")),
        Some(port) => match port.parse::<u16>() {
            Ok(number) if number > 0 => Ok(format!("{host}:{number}")),
            Ok(_) | Err(_) => refused("no port of 1 to 65535"),
        },
        None => refused("no port of 1 to 65535"),
    }
}

/// Returns the address of all interfaces, for IPv6 and IPv4, or for IPv4 only if the kernel has no IPv6.
fn any_address() -> &'static str {
    if UdpSocket::bind("[::]:0").is_ok() { "[::]" } else { "0.0.0.0" }
}

/// Returns the default socket of a role: that of a node started by hand, or a new one of this program.
fn default_socket(role: Role) -> PathBuf {
    let folder =
        |name: &str| env::var_os(name).map(PathBuf::from).filter(|folder| folder.is_absolute());
    let user = folder("XDG_RUNTIME_DIR").map(|folder| folder.join("frhc"));
    match role {
        Role::Near => user.unwrap_or("/run/frhc".into()).join("link.sock"),
        Role::Far => {
            let own = folder("RUNTIME_DIRECTORY").or(user);
            own.unwrap_or("/run/frhc-link".into()).join("far.sock")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Settings, (usize, String)> {
        Settings::read(Role::Far, text)
    }

    #[test]
    fn addresses_are_completed_and_the_rest_has_its_usual_value() {
        let settings =
            read("keys = \"keys\"\nsocket = \"/tmp/s\"\nconnect = [\"robot.lab\"]").unwrap();
        assert_eq!(settings.connect, ["robot.lab:7447"]);
        assert_eq!((settings.arm, settings.in_flight), (1, 128));
        assert!(settings.listen.is_empty(), "an end that connects need not listen");
        let settings = read("keys = \"keys\"").unwrap();
        assert!(["[::]:7447", "0.0.0.0:7447"].contains(&&*settings.listen[0]));
        for (given, complete) in [
            ("[fe80::1]", "[fe80::1]:7447"),
            ("[::]:1", "[::]:1"),
            ("10.0.0.2:7448", "10.0.0.2:7448"),
        ] {
            assert_eq!(address(given).unwrap(), complete);
        }
    }

    #[test]
    fn wrong_keys_are_named_with_their_place() {
        for (text, reason) in [
            ("arm = 1", "missing field \"keys\""),
            ("keys = \"k\"\nport = 1", "unknown field \"port\""),
            ("keys = \"k\"\narm = 70000", "70000"),
            ("keys = \"k\"\nlisten = []", "must have an address"),
            ("keys = \"k\"\nconnect = [\"::1\"]", "needs brackets"),
            ("keys = \"k\"\nconnect = [\"\"]", "no host"),
            ("keys = \"k\"\nconnect = [\"robot?rel=0\"]", "no host"),
            ("keys = \"k\"\nconnect = [\"robot:0\"]", "no port"),
            ("keys = \"k\"\nconnect = [\"robot:\"]", "no port"),
            ("keys = \"k\"\nconnect = [\"[robot]:1\"]", "no IPv6"),
            ("keys = \"k\"\nin_flight = 2", "must be within 8 to 1024, got 2"),
        ] {
            let (_, refused) = read(text).unwrap_err();
            assert!(refused.contains(reason), "{text}: {refused}");
        }
    }

    #[test]
    fn file_line_and_key_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("link.toml");
        std::fs::write(&file, "keys = \"k\"\nconnect = [\n  \"a\",\n  \"b:x\"]\n").unwrap();
        let failure = Settings::load(Role::Near, &file).unwrap_err();
        let expected = format!("{}:4: connect: \"b:x\": no port", file.display());
        assert!(failure.text().starts_with(&expected), "{}", failure.text());
    }
}
