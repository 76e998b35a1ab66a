//! The `frhc` program: see [`frhc`].
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    frhc::main()
}
