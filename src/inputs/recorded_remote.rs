//! Commanded side whose answers are recorded.

use crate::input::{Input, InputSink};
use remote::stated::Misfit;
use remote::{Command, Remote, RemoteSample, RobotJoints, SideError};
use units::spatial::CommandMode;
use units::time::Instant;

/// Commanded side `R`, whose answers are recorded by `S`.
#[derive(Clone, Debug)]
pub struct RecordedRemote<R, S> {
    pub(super) remote: R,
    sink: S,
}

impl<R, S> RecordedRemote<R, S> {
    pub(super) const fn new(remote: R, sink: S) -> Self {
        Self { remote, sink }
    }
}

impl<R, S: InputSink> RecordedRemote<R, S> {
    fn record(&self, misfits: &[Misfit]) {
        if self.sink.is_recording() {
            let texts = misfits.iter().map(ToString::to_string).collect();
            self.sink.on_input(Input::Misfits(texts));
        }
    }
}

impl<R: Remote, S: InputSink> Remote for RecordedRemote<R, S> {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        self.sink.record(self.remote.exchange(now, command), Input::Sensed)
    }

    fn begin_epoch(&mut self) {
        self.remote.begin_epoch();
    }

    fn end_epoch(&mut self) {
        self.remote.end_epoch();
    }

    fn misfits(&mut self, now: Instant, mode: CommandMode) -> Vec<Misfit> {
        let misfits = self.remote.misfits(now, mode);
        self.record(&misfits);
        misfits
    }

    fn mode_misfit(&mut self, mode: CommandMode) -> Option<Misfit> {
        let misfit = self.remote.mode_misfit(mode);
        self.record(misfit.as_slice());
        misfit
    }

    fn joints(&self) -> Option<RobotJoints> {
        self.remote.joints()
    }

    fn error(&mut self) -> Option<SideError> {
        self.sink.record(self.remote.error(), Input::SideError)
    }
}
