//! Priority of this process: above ordinary work, below the node's cycle.

use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadPriorityValue, ThreadSchedulePolicy,
    set_thread_priority_and_policy, thread_native_id,
};

/// `SCHED_FIFO` priority, of 99 at most. The cycles of the node and of `frhc robot` have 80.
const PRIORITY: u8 = 60;

/// Requests SCHED_FIFO for the calling thread and threads that it starts. A refusal is a warning.
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
