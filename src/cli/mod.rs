//! (to come)
use std::process::ExitCode;
/// (to come)
pub fn main() -> ExitCode {
    ExitCode::SUCCESS
}
