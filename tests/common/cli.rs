//! Runs a command of the program until it exits, in a separate folder.

use std::ffi::OsStr;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Exit code and output of a command.
pub(crate) struct CommandOutput {
    pub(crate) code: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

pub(crate) fn frhc<S: AsRef<OsStr>>(args: &[S]) -> CommandOutput {
    let output = Command::new(crate::common::program()).args(args).output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let code = output.status.code().unwrap();
    CommandOutput { code, stdout: text(output.stdout), stderr: text(output.stderr) }
}

/// Runs a command whose person types this.
pub(crate) fn typed(command: &mut Command, stdin: &str) -> CommandOutput {
    let command = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // It may end before it has read all.
    _ = child.stdin.take().unwrap().write_all(stdin.as_bytes());
    let output = child.wait_with_output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let code = output.status.code().unwrap();
    CommandOutput { code, stdout: text(output.stdout), stderr: text(output.stderr) }
}

/// Runs a command with this stdout.
pub(crate) fn onto(stdout: impl Into<Stdio>, args: &[String]) -> CommandOutput {
    let mut command = Command::new(crate::common::program());
    let command = command.args(args).stdin(Stdio::null()).stdout(stdout).stderr(Stdio::piped());
    let output = command.output().unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    CommandOutput { code: output.status.code().unwrap(), stdout: String::new(), stderr }
}

/// Creates an empty folder for one test.
pub(crate) fn folder(suite: &str, name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(suite).join(name);
    fs::remove_dir_all(&folder).ok();
    fs::create_dir_all(&folder).unwrap();
    folder
}
