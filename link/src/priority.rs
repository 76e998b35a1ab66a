//! Priority of this process: above ordinary work, below the node's cycle.

use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// Priority of 99. The node's cycle, and that of `frhc robot`, have 80.
const PRIORITY: u8 = 60;

/// Asks for SCHED_FIFO for the calling thread and those that it starts; a refusal is a warning.
pub fn ask() {
    let fifo = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let priority = ThreadPriorityValue::try_from(PRIORITY).map(ThreadPriority::Crossplatform);
    let is_granted = priority.is_ok_and(|priority| {
        set_thread_priority_and_policy(thread_native_id(), priority, fifo).is_ok()
    });
    if is_granted {
        tracing::info!("priority: SCHED_FIFO {PRIORITY}");
    } else {
        tracing::warn!(
            "priority: SCHED_FIFO {PRIORITY} refused; messages may be milliseconds late on a busy machine (LimitRTPRIO={PRIORITY})"
        );
    }
}
