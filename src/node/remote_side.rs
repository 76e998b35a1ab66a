//! The commanded side: the robot or virtual object, and its newest valid sample.

use crate::link::Link;
use config::Config;
use remote::Remote;
use units::spatial::Motion;
use units::time::Instant;

/// The commanded side.
#[derive(Clone, Debug)]
pub(super) struct RemoteSide<R> {
    pub(super) remote: R,
    pub(super) link: Link,
}

impl<R: Remote> RemoteSide<R> {
    /// Sends `Hold` and takes the first sample.
    pub(super) fn new(config: &Config, now: Instant, remote: R) -> Self {
        let mut side = Self { remote, link: Link::new(config.link.max_age) };
        side.exchange(now, &Motion::Hold);
        side
    }

    /// Sends a command and takes the sample received with it, if any.
    pub(super) fn exchange(&mut self, now: Instant, command: &Motion) {
        let sensed = self.remote.exchange(now, command);
        self.link.update(now, sensed);
    }
}
