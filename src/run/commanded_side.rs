//! Commanded side of `frhc run`: a virtual object in this process, or a robot in another process.

use std::path::PathBuf;

use crate::console::default_socket;
use crate::exit::{Failure, Kind, OrFail};
use crate::socket_name::socket_name;
use anyhow::Context;
use config::{Agreement, Config};
use remote::link::{self, LinkSettings, LinkSide, LinkThread};
use remote::site::VirtualSite;
use remote::stated::Misfit;
use remote::{Command, Remote, RemoteSample, RobotJoints, SideError};
use units::spatial::CommandMode;
use units::time::Instant;
use unix_socket::SocketFile;

/// Group whose members may connect as the far side, if the system has this group.
const GROUP: &str = "frhc-link";

/// Maximum number of connections waiting to be accepted or refused.
const BACKLOG: i32 = 4;

/// Receiver of the commands.
#[derive(Debug)]
pub(crate) enum CommandedSide {
    /// Object in a scene of this process.
    Virtual(Box<VirtualSite>),
    /// Robot in another process.
    Link(Box<LinkSide>),
}

/// Returns the path of the link's socket: the configured one, or `link.sock` beside the control socket.
pub fn socket_of(config: &Config) -> PathBuf {
    let console = || config.socket.clone().unwrap_or_else(default_socket);
    let given = config.far_side.socket.clone();
    given.unwrap_or_else(|| console().with_file_name("link.sock"))
}

/// Opens the commanded side of a configuration. A link also has a thread, which is not started yet, and a socket file.
///
/// # Errors
/// When the socket of the link cannot be created.
pub(crate) fn open(
    config: &Config,
) -> Result<(CommandedSide, Option<(LinkThread, SocketFile)>), Failure> {
    let Some(agreement) = &config.far_side.agreement else {
        let site = VirtualSite::new(&config.remote, config.period);
        return Ok((CommandedSide::Virtual(Box::new(site)), None));
    };
    let path = socket_of(config);
    let (side, thread, file) = listen(config, agreement, path.clone())
        .with_context(|| {
            socket_name(
                "link",
                &path,
                "remote.link.socket",
                config.far_side.socket.as_deref(),
                config,
            )
        })
        .or_fail(Kind::Bus)?;
    tracing::info!("far side of arm {} expected at {}", config.far_side.arm, path.display());
    Ok((CommandedSide::Link(Box::new(side)), Some((thread, file))))
}

fn listen(
    config: &Config,
    agreement: &Agreement,
    path: PathBuf,
) -> anyhow::Result<(LinkSide, LinkThread, SocketFile)> {
    let (socket, file) = unix_socket::listen_for_messages(path, Some(GROUP), BACKLOG)?;
    let settings = LinkSettings {
        arm: config.far_side.arm,
        session: getrandom::u64().context("no random session")?,
        period: config.period,
        round_trip: agreement.round_trip,
        stated: agreement.stated,
    };
    let (side, thread) = link::link(socket, &settings)?;
    Ok((side, thread, file))
}

impl CommandedSide {
    fn as_remote(&mut self) -> &mut dyn Remote {
        match self {
            Self::Virtual(site) => site.as_mut(),
            Self::Link(side) => side.as_mut(),
        }
    }
}

impl Remote for CommandedSide {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        self.as_remote().exchange(now, command)
    }

    fn begin_epoch(&mut self) {
        self.as_remote().begin_epoch();
    }

    fn end_epoch(&mut self) {
        self.as_remote().end_epoch();
    }

    fn misfits(&mut self, now: Instant, mode: CommandMode) -> Vec<Misfit> {
        self.as_remote().misfits(now, mode)
    }

    fn mode_misfit(&mut self, mode: CommandMode) -> Option<Misfit> {
        self.as_remote().mode_misfit(mode)
    }

    fn error(&mut self) -> Option<SideError> {
        self.as_remote().error()
    }

    fn joints(&self) -> Option<RobotJoints> {
        match self {
            Self::Virtual(site) => site.joints(),
            Self::Link(side) => side.joints(),
        }
    }
}
