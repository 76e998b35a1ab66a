//! Temporary folders and a record for tests.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;
use std::{env, fs, process};

use crate::sources::Sources;
use bus::{Bus, SendError, Wake};
use canopen::frame::Telegram;
use config::Config;
use config::files::{self, Copies};
use node::Node;
use node::record::Record;
use remote::site::VirtualSite;
use telemetry::manifest::SessionKind;
use units::time::Instant;

/// Returns the path of a folder that does not exist; every call returns another.
pub(crate) fn path(name: &str) -> PathBuf {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let number = NEXT.fetch_add(1, Ordering::Relaxed);
    let path = env::temp_dir().join(format!("frhc-{}-{number}-{name}", process::id()));
    fs::remove_dir_all(&path).ok(); // left by an earlier process with this id
    path
}

/// Bus that receives nothing, and on which time passes only in waits.
#[derive(Debug)]
struct SilentBus(Instant);

impl Bus for SilentBus {
    fn now(&self) -> Instant {
        self.0
    }

    fn wall(&self) -> Duration {
        Duration::ZERO
    }

    fn send_at(&mut self, _: Instant, _: Telegram) -> Result<(), SendError> {
        Ok(())
    }

    fn wait(&mut self, _: Instant, _: Instant, until: Instant) -> Wake {
        self.0 = self.0.max(until);
        Wake { now: self.0, received: None }
    }
}

/// Returns the record of the first cycle of a node that has not booted.
pub(crate) fn any_record() -> Record {
    let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
    let site = VirtualSite::new(&config.remote, config.period);
    Node::new(&config, SilentBus(Instant::default()), site).cycle()
}

/// Writes a configuration with these keys in `[node]` into `folder`; returns its path.
pub(crate) fn configuration(folder: &Path, keys: &str) -> PathBuf {
    let shipped = files::read(Path::new("config/kraft_like.toml")).unwrap();
    let text = String::from_utf8(shipped).unwrap();
    let text = text.replace("\"../eds/", concat!("\"", env!("CARGO_MANIFEST_DIR"), "/../../eds/"));
    let file = folder.join("arm.toml");
    fs::create_dir_all(folder).unwrap();
    fs::write(&file, text.replacen("[node]\n", &format!("[node]\n{keys}\n"), 1)).unwrap();
    file
}

/// Returns the sources of a session that copies no file.
pub(crate) fn no_sources() -> Sources {
    Sources {
        kind: SessionKind::Run,
        configuration: PathBuf::from("arm.toml"),
        robot: None,
        scenario: None,
        case: None,
        without_passivity: false,
        copies: Copies::new(),
        is_anonymous: false,
    }
}
