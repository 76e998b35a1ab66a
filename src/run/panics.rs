//! A panic anywhere ends the whole process, at once (ADR 14).
//!
//! In a release build the profile sees to that; here it is so in every build, or what is tested were not what
//! runs: a panicking thread would leave the others alive, the heartbeat among them.

use std::panic;
use std::process;

use crate::print;
use crate::stderr;

/// From now on every panic, on any thread, aborts: SYNC, heartbeat and torques end together, and the drives
/// stop by their own timers (promise 2).
pub fn abort() {
    panic::set_hook(Box::new(|panic| {
        print::error(&format!("{panic}\nthe drives stop by themselves"));
        stderr::flush();
        process::abort();
    }));
}

#[cfg(test)]
mod tests {
    use std::os::unix::process::ExitStatusExt;
    use std::process::Command;
    use std::thread;

    use nix::sys::signal::Signal;

    use super::*;

    const VICTIM: &str = "panics::tests::a_victim_for_the_test_below";

    #[test]
    #[ignore = "it aborts the process: the test below runs it in one of its own"]
    fn a_victim_for_the_test_below() {
        abort();
        // Whoever would wait for the panicking thread, as a scope does, has no time to.
        thread::spawn(|| panic!("on another thread")).join().ok();
    }

    #[test]
    fn hazard_27_a_panic_on_any_thread_ends_the_process_and_all_its_threads() {
        let this = std::env::current_exe().unwrap();
        let args = ["--exact", VICTIM, "--ignored", "--nocapture", "--test-threads=1"];
        let ended = Command::new(this).args(args).output().unwrap();
        let signal = ended.status.signal().map(|signal| Signal::try_from(signal).unwrap());
        assert_eq!(signal, Some(Signal::SIGABRT), "{ended:?}");
        let told = String::from_utf8(ended.stderr).unwrap();
        assert!(told.contains("on another thread") && told.contains("drives stop"), "{told}");
    }

    #[test]
    fn hazard_27_a_release_build_aborts_by_its_profile() {
        let manifest: toml::Table = include_str!("../../Cargo.toml").parse().unwrap();
        assert_eq!(manifest["profile"]["release"]["panic"].as_str(), Some("abort"));
    }
}
