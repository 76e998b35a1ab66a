//! Abort of the process by a panic on any thread (ADR 14).
//!
//! A release build aborts by its profile. The hook does so in every build, so that tests behave like a release.
//! Unwinding would keep the other threads alive, including the one that sends the heartbeat.

use std::{panic, process};

use crate::{print, stderr};

/// Makes every panic abort the process, so that SYNC, heartbeat and RPDOs end together. The drives then stop by their own
/// timers (promise 2).
pub fn abort() {
    panic::set_hook(Box::new(|panic| {
        print::error(&format!("{panic}\nthe drives stop by their own timers"));
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

    const PANICKING: &str = "panics::tests::panicking_process_of_the_test_below";

    #[test]
    #[ignore = "aborts its process: the test below runs it in a separate one"]
    fn panicking_process_of_the_test_below() {
        abort();
        // The process aborts before `join` returns.
        thread::spawn(|| panic!("on another thread")).join().ok();
    }

    #[test]
    fn hazard_27_panic_on_any_thread_aborts_the_process() {
        let this = std::env::current_exe().unwrap();
        let args = ["--exact", PANICKING, "--ignored", "--nocapture", "--test-threads=1"];
        let ended = Command::new(this).args(args).output().unwrap();
        let signal = ended.status.signal().map(|signal| Signal::try_from(signal).unwrap());
        assert_eq!(signal, Some(Signal::SIGABRT), "{ended:?}");
        let stderr = String::from_utf8(ended.stderr).unwrap();
        assert!(stderr.contains("on another thread") && stderr.contains("drives stop"), "{stderr}");
    }

    #[test]
    fn hazard_27_release_profile_aborts_on_panic() {
        let manifest: toml::Table = include_str!("../../Cargo.toml").parse().unwrap();
        let profiles = &manifest["profile"];
        assert_eq!(profiles["release"]["panic"].as_str(), Some("abort"));
        for profile in ["dist", "newcomer"] {
            assert_eq!(profiles[profile]["inherits"].as_str(), Some("release"), "{profile}");
            assert!(profiles[profile].get("panic").is_none(), "{profile}");
        }
    }
}
