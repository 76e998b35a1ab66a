//! Requests of a program that leads its user through several of them.

use std::time::Duration;

use serde_json::Value;
use tokio::time::sleep;

use crate::console::{ConsoleCommand, default_sockets};
use crate::ctl::{Connection, granted};
use crate::exit::{Failure, Kind, OrFail};
use config::Config;
use node::safety::Refusal;

/// Time between two looks at the node.
const PAUSE: Duration = Duration::from_millis(50);

/// Control socket of a running node.
#[derive(Debug)]
pub struct Client(Connection);

impl Client {
    /// Returns the socket of a configuration, or the default ones. Connects with the first request.
    ///
    /// # Errors
    /// When the runtime of the connections cannot be started (exit 4).
    pub fn of(config: &Config) -> Result<Self, Failure> {
        let paths = config.socket.clone().map_or_else(default_sockets, |socket| vec![socket]);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        Ok(Self(Connection { paths, runtime: runtime.or_fail(Kind::System)? }))
    }

    /// Sends a request in the words of the protocol.
    ///
    /// # Errors
    /// When no node responds (exit 4), or it refuses the request (exit 1).
    pub fn ask(&self, request: &str) -> Result<(), Failure> {
        let command = ConsoleCommand::try_from(request.to_owned());
        let command = command.map_err(|reason| Failure::new(Kind::Usage, reason))?;
        granted(&self.0.request(command)?, false).map(|_| ())
    }

    /// Sends a request as [`ask`](Self::ask). Returns false if it is refused because the deadman is closed.
    ///
    /// # Errors
    /// As [`ask`](Self::ask), for any other reason.
    pub fn ask_released(&self, request: &str) -> Result<bool, Failure> {
        let closed = [Refusal::DeadmanClosed, Refusal::DeadmanNotSettled].map(|it| it.to_string());
        match self.ask(request) {
            Ok(()) => Ok(true),
            Err(refused) if closed.contains(&refused.to_string()) => Ok(false),
            Err(failure) => Err(failure),
        }
    }

    /// Waits between two looks at the node.
    pub fn pause(&self) {
        self.0.runtime.block_on(async { sleep(PAUSE).await });
    }

    /// Returns the status, empty while the node boots.
    ///
    /// # Errors
    /// When no node responds (exit 4).
    pub fn status(&self) -> Result<Value, Failure> {
        Ok(self.0.status()?.get("status").cloned().unwrap_or_default())
    }
}
