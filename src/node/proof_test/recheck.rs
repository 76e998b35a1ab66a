//! Reading back of the settings that the proof test relies on, while the node runs: one object per second.
//!
//! Watchdogs, stop options and limits of a drive may change during a run: by another SDO client, or by a fault of the
//! drive. A value that differs stops the node. An object that cannot be read is logged once, counted, and read again.

mod run;

use std::time::Duration;

use canopen::master::Master;
use canopen::master::event::Event;
use canopen::master::read_back::{ObjectRead, ReadBack};
use canopen::plan::NodePlan;
use units::numbering::NodeIndex;
use units::time::Instant;

/// Time between two readings.
const READ_INTERVAL: Duration = Duration::from_secs(1);

/// Settings to read back, one after the other.
#[derive(Clone, Debug, Default)]
pub(crate) struct Recheck {
    entries: Vec<Entry>,
    /// Index of the next entry.
    next: usize,
    due: Option<Instant>,
}

/// One setting of one drive.
#[derive(Clone, Copy, Debug)]
struct Entry {
    node: NodeIndex,
    setting: ObjectRead,
    /// True if its last reading failed.
    is_unread: bool,
}

impl Recheck {
    /// Returns the settings of the drives of `plans`, except objects that a drive lacks. Drives take turns, so that each is
    /// read once in as many seconds as there are drives.
    pub(super) fn new(plans: &[NodePlan], master: &Master) -> Self {
        let of_drive = |(node, plan): (NodeIndex, &NodePlan)| -> Vec<Entry> {
            let missing = master.missing_objects(node);
            let held = plan.protections().into_iter().filter(|it| !missing.contains(&it.object));
            let settings = held.filter_map(|check| ObjectRead::from_check(&check));
            let nameplate = master.nameplate(node).iter().filter(|held| held.may_change());
            let settings = settings.chain(nameplate.map(ObjectRead::held));
            settings.map(|setting| Entry { node, setting, is_unread: false }).collect()
        };
        let drives: Vec<_> = NodeIndex::each(plans).map(of_drive).collect();
        let most = drives.iter().map(Vec::len).max().unwrap_or(0);
        let turn = |at: usize| drives.iter().filter_map(move |entries| entries.get(at).copied());
        Self { entries: (0..most).flat_map(turn).collect(), next: 0, due: None }
    }

    /// Returns the drive and the setting to be read now. The first reading is due one interval after the first call.
    fn due(&mut self, now: Instant) -> Option<(NodeIndex, ObjectRead)> {
        let due = *self.due.get_or_insert(now + READ_INTERVAL);
        let Entry { node, setting, .. } = *self.entries.get(self.next)?;
        (now >= due).then_some((node, setting))
    }

    /// Advances to the next entry, after a reading was requested.
    fn advance(&mut self, now: Instant) {
        self.due = Some(now + READ_INTERVAL);
        self.next = (self.next + 1).checked_rem(self.entries.len()).unwrap_or(0);
    }

    /// Takes an event; returns whether it is expected: an unchanged object, or one that could not be read before either.
    pub(super) fn on_event(&mut self, event: &Event) -> bool {
        let Event::ReadBack { node, object, read } = event else { return false };
        let is_it = |entry: &&mut Entry| entry.node == *node && entry.setting.object == *object;
        let Some(entry) = self.entries.iter_mut().find(is_it) else { return false };
        match read {
            ReadBack::Unchanged => {
                entry.is_unread = false;
                true
            }
            ReadBack::Unread(_) => std::mem::replace(&mut entry.is_unread, true),
            ReadBack::Changed { .. } | ReadBack::Value(_) => false,
        }
    }

    /// Returns the number of settings whose last reading failed.
    pub(super) fn unread(&self) -> u32 {
        self.entries.iter().map(|entry| u32::from(entry.is_unread)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::frame::Channel;
    use canopen::object::Object;
    use canopen::sdo::SdoError;
    use canopen::testing::plans::elbow;

    const SECOND: Duration = Duration::from_secs(1);

    fn recheck(drives: usize) -> Recheck {
        let plans = vec![elbow(); drives];
        let master = Master::new(plans.iter().cloned().map(|plan| (Channel(0), plan)).collect());
        Recheck::new(&plans, &master)
    }

    fn read(recheck: &mut Recheck, seconds: u32) -> Vec<(NodeIndex, Object)> {
        let mut settings = Vec::new();
        for millis in 0..seconds * 1_000 {
            let now = Instant::ZERO + Duration::from_millis(millis.into());
            if let Some((node, setting)) = recheck.due(now) {
                recheck.advance(now);
                settings.push((node, setting.object));
            }
        }
        settings
    }

    #[test]
    fn each_setting_of_each_drive_is_read_once_per_round() {
        let mut recheck = recheck(6);
        let all = recheck.entries.len();
        assert_eq!(all, 78, "thirteen per drive");
        let mut round = read(&mut recheck, 79);
        let first: Vec<NodeIndex> = round.iter().take(6).map(|(node, _)| *node).collect();
        assert_eq!((first, round.len()), ([0, 1, 2, 3, 4, 5].map(NodeIndex).to_vec(), all));
        round.sort_unstable();
        round.dedup();
        assert_eq!(round.len(), all);
    }

    #[test]
    fn unreadable_setting_is_logged_once_and_counted() {
        let mut recheck = recheck(1);
        let object = Object::rpdo_communication(1, 5);
        let event = |read| Event::ReadBack { node: NodeIndex(0), object, read };
        let unread = event(ReadBack::Unread(SdoError::Timeout));
        assert!(!recheck.on_event(&unread), "logged");
        assert!(recheck.on_event(&unread));
        assert_eq!(recheck.unread(), 1);
        assert!(!recheck.on_event(&event(ReadBack::Changed { expected: 5, found: 0 })));
        assert!(recheck.on_event(&event(ReadBack::Unchanged)));
        assert_eq!(recheck.unread(), 0);
        assert!(!recheck.on_event(&unread), "logged again");
    }

    #[test]
    fn recheck_without_drives_reads_nothing() {
        assert_eq!(read(&mut recheck(0), 5), []);
        let mut late = recheck(1);
        assert_eq!(late.due(Instant::ZERO), None);
        assert!(late.due(Instant::ZERO + SECOND).is_some());
    }
}
