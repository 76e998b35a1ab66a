//! Commanded side that replays the recorded answers.

use crate::source::{Source, answer};
use inputs::Input;
use remote::stated::Misfit;
use remote::{Command, Remote, RemoteSample, SideError};
use units::spatial::CommandMode;
use units::time::Instant;

/// Commanded side of a recorded session.
#[derive(Debug)]
pub(super) struct ReplayedRemote(pub(super) Source);

impl Remote for ReplayedRemote {
    fn exchange(&mut self, _: Instant, _: &Command) -> Option<RemoteSample> {
        let sensed = self
            .0
            .take("exchanges a command for a sample", answer!(Input::Sensed(sensed) => *sensed));
        sensed.flatten()
    }

    /// Returns one reason for each recorded one. The node only checks whether the list is empty.
    fn misfits(&mut self, _: Instant, _: CommandMode) -> Vec<Misfit> {
        let count = self.0.take(
            "asks whether the commanded side fits",
            answer!(Input::Misfits(reasons) => reasons.len()),
        );
        vec![Misfit::Unknown; count.unwrap_or(0)]
    }

    /// Returns a reason if one was recorded. Sessions of earlier versions have no answer: each change was accepted.
    fn mode_misfit(&mut self, _: CommandMode) -> Option<Misfit> {
        let count = self.0.take_if_next(answer!(Input::Misfits(reasons) => reasons.len()));
        count.filter(|count| *count > 0).map(|_| Misfit::Unknown)
    }

    fn error(&mut self) -> Option<SideError> {
        let error = self.0.take(
            "asks for a fault of the commanded side",
            answer!(Input::SideError(error) => *error),
        );
        error.flatten()
    }
}
