//! `tc` on an interface: delayed frames, or a full queue. On vcan it acts only with `echo=1`; else the loopback bypasses
//! the queue.

use crate::common::process::Process;

/// The queue of an interface; restored at the end of a test.
#[derive(Debug)]
pub(crate) struct Shaper(String);

impl Shaper {
    /// Creates three bands, of which the third delays frames by `delay`; [`hold`](Self::hold) selects frames for it.
    pub(crate) fn with_delay(interface: &str, delay: &str) -> Self {
        tc(&format!("qdisc replace dev {interface} root handle 1: prio"));
        tc(&format!("qdisc replace dev {interface} parent 1:3 handle 30: netem delay {delay}"));
        Self(interface.to_owned())
    }

    /// Delays this frame from now on.
    pub(crate) fn hold(&self, id: u16) {
        let frame = format!("canid(sff 0x{id:03X})");
        let filter = format!("filter add dev {} parent 1: protocol all basic match", self.0);
        let words: Vec<&str> = filter.split(' ').chain([frame.as_str(), "flowid", "1:3"]).collect();
        Process::start("tc", &words).wait().succeeds();
    }

    /// Bounds the bus to a hundred kilobits per second, and its queue to four frames.
    pub(crate) fn of_a_slow_bus(interface: &str) -> Self {
        let queue = "tbf rate 100kbit burst 16 limit 64";
        tc(&format!("qdisc replace dev {interface} root {queue}"));
        Self(interface.to_owned())
    }
}

impl Drop for Shaper {
    fn drop(&mut self) {
        tc(&format!("qdisc del dev {} root", self.0));
    }
}

fn tc(words: &str) {
    Process::start("tc", &words.split(' ').collect::<Vec<_>>()).wait().succeeds();
}
