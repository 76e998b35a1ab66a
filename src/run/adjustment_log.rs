//! Log of adjustments: changes of scales, locks and alignment by console or button, and refused presses of buttons.

use std::time::Duration;

use crate::log_time;
use controller::adjustment::AdjustmentState;
use node::record::{Record, RefusedPress};
use telemetry::token_bucket::TokenBucket;
use units::adjustment::{LockAxis, Quantity};
use units::time::Instant;

/// Mean interval between lines, so that a bouncing contact cannot fill a disk.
const LINE_EVERY: Duration = Duration::from_millis(500);

/// Burst of lines.
const LINES_AT_ONCE: u32 = 20;

/// Log of adjustments, with the last logged state.
#[derive(Debug)]
pub(super) struct AdjustmentLog {
    before: Option<AdjustmentState>,
    bucket: TokenBucket,
}

impl AdjustmentLog {
    pub(super) const fn new() -> Self {
        Self { before: None, bucket: TokenBucket::new(LINE_EVERY, LINES_AT_ONCE) }
    }

    /// Logs the changes of a cycle.
    pub(super) fn log(&mut self, record: &Record) {
        let now = record.output.adjusted;
        let before = self.before.replace(now).unwrap_or(now);
        let is_changed = before.scale != now.scale
            || before.locked != now.locked
            || before.is_aligning != now.is_aligning;
        if is_changed {
            self.write(record.at, || {
                changes(&before, &now).for_each(|line| tracing::info!("{line}"));
            });
        }
        if let Some(RefusedPress { adjustment, refused }) = record.refused_press {
            self.write(record.at, || tracing::warn!("button: {adjustment}: refused: {refused}"));
        }
    }

    fn write(&mut self, at: Instant, lines: impl FnOnce()) {
        if self.bucket.take(at) {
            log_time::stamp_with(at, lines);
        }
    }
}

/// Returns a line for each difference.
fn changes(before: &AdjustmentState, now: &AdjustmentState) -> impl Iterator<Item = String> {
    let scales = Quantity::ALL.into_iter().filter_map(|quantity| {
        let [before, now] = [before, now].map(|adjusted| adjusted.scale.factor(quantity));
        (before.to_bits() != now.to_bits())
            .then(|| format!("scale of {quantity}: {before} to {now}"))
    });
    let locks = LockAxis::ALL.into_iter().filter_map(|axis| {
        let [before, now] = [before, now].map(|adjusted| axis.entry(&adjusted.locked));
        (before != now).then(|| format!("axis {axis}: {}", if now { "locked" } else { "released" }))
    });
    let aligning = (before.is_aligning != now.is_aligning).then(|| {
        let text =
            if now.is_aligning { "aligning the object with the grip" } else { "alignment ended" };
        text.to_owned()
    });
    scales.chain(locks).chain(aligning).collect::<Vec<_>>().into_iter()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scratch::any_record;
    use controller::scaling::Scale;

    #[test]
    fn each_change_is_a_line() {
        let before = any_record().output.adjusted;
        let mut now = before;
        now.scale = Scale { motion: 0.5, ..Scale::ONE };
        (now.locked[5], now.is_aligning) = (true, true);
        let lines: Vec<_> = changes(&before, &now).collect();
        assert_eq!(
            lines,
            ["scale of motion: 1 to 0.5", "axis rz: locked", "aligning the object with the grip"]
        );
        let back: Vec<_> = changes(&now, &before).collect();
        assert_eq!(back, ["scale of motion: 0.5 to 1", "axis rz: released", "alignment ended"]);
        assert_eq!(changes(&now, &now).count(), 0);
    }

    #[test]
    fn lines_are_limited_in_rate() {
        let mut log = AdjustmentLog::new();
        let mut record = any_record();
        let mut written = 0;
        for cycle in 0..1_000 {
            record.at = Instant::from_micros(cycle * 1_000);
            log.write(record.at, || written += 1);
        }
        assert!((20..=22).contains(&written), "{written}");
    }
}
