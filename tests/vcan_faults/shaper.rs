//! What `tc` does to the frames of an interface: it holds them back, or has no room for them. On vcan
//! only where it was made with `echo=1`; else the loopback passes the queue by, and nothing happens.

use crate::common::process::Process;

/// The queue of an interface; as it was, when a test ends.
#[derive(Debug)]
pub(crate) struct Shaper(String);

impl Shaper {
    /// Three bands; what is in the third is late by `delay`. Nothing is, until [`hold`](Self::hold) says so.
    pub(crate) fn with_delay(interface: &str, delay: &str) -> Self {
        tc(&format!("qdisc replace dev {interface} root handle 1: prio"));
        tc(&format!("qdisc replace dev {interface} parent 1:3 handle 30: netem delay {delay}"));
        Self(interface.to_owned())
    }

    /// From now on this frame is late.
    pub(crate) fn hold(&self, id: u16) {
        let frame = format!("canid(sff 0x{id:03X})");
        let filter = format!("filter add dev {} parent 1: protocol all basic match", self.0);
        let words: Vec<&str> = filter.split(' ').chain([frame.as_str(), "flowid", "1:3"]).collect();
        Process::of("tc", &words).wait().succeeds();
    }

    /// From now on the bus takes a hundred kilobits per second and the queue four frames.
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
    Process::of("tc", &words.split(' ').collect::<Vec<_>>()).wait().succeeds();
}
