//! Response to a disarm, by the newest status: its mode, or the joints that may push at zero target torque.

use crate::console::Response;
use node::push::Push;
use node::record::{Mode, Record};
use telemetry::status::Status;
use units::numbering::Joint;
use units::wording::listed;

impl Response {
    /// Returns the response to a disarm that led to `granted`, from the newest record and its status, which are `None` before
    /// the first cycle. A record that `is_stale` shows the torque before the disarm.
    pub(super) fn to_disarm(
        granted: Mode,
        newest: Option<(&Record, &Status)>,
        is_stale: bool,
    ) -> Self {
        let Some((record, status)) = newest.filter(|_| granted != Mode::Boot) else {
            return Self::granted(granted);
        };
        if is_stale && !record.mode.allows_torque() {
            return Self::refused(
                &"zero torque is commanded, but the status is late: it is not known whether the drives apply none",
            );
        }
        let mode = record.mode;
        let note = status.stopped_by.as_ref().map(|cause| format!("stopped by {cause}"));
        if mode.allows_torque() || record.is_torque_free() {
            return Self { note, ..Self::granted(mode) };
        }
        let pushing = || Joint::each(&record.pushes).filter(|(_, push)| **push != Push::Excluded);
        let name =
            |joint: Joint| status.joints.get(joint.index()).map(|it| format!(" ({})", it.name));
        let parts = pushing().map(|(joint, push)| {
            format!("joint {joint}{} may push: {push}", name(joint).unwrap_or_default())
        });
        let parts: Vec<_> = parts.collect();
        let stopped_by = note.map(|note| format!(", {note}")).unwrap_or_default();
        Self {
            mode: Some(mode.name()),
            may_push: pushing().map(|(joint, _)| joint.number()).collect(),
            ..Self::refused(&format!(
                "{mode}{stopped_by}, but {}; do not reach in, and press the emergency stop",
                listed(&parts)
            ))
        }
    }
}
