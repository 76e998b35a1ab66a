//! Interfaces that are made and removed by one test.

use crate::common::process::Process;

/// An interface that is removed at the end of a test.
#[derive(Debug)]
pub(crate) struct Interface(&'static str);

impl Interface {
    /// A vcan that is up, and takes CAN FD.
    pub(crate) fn vcan(name: &'static str) -> Self {
        ip(&format!("link add {name} type vcan"));
        ip(&format!("link set {name} mtu 72 up"));
        Self(name)
    }

    /// One end of a cable, and the name of the other; both are up.
    pub(crate) fn cable(name: &'static str, other: &str) -> Self {
        ip(&format!("link add {name} type vxcan peer name {other}"));
        ip(&format!("link set {name} up"));
        ip(&format!("link set {other} up"));
        Self(name)
    }
}

impl Drop for Interface {
    fn drop(&mut self) {
        // The test may have taken it away.
        Process::start("ip", &["link", "del", self.0]).wait();
    }
}

/// `ip`, which must succeed.
pub(crate) fn ip(words: &str) {
    Process::start("ip", &words.split(' ').collect::<Vec<_>>()).wait().succeeds();
}
