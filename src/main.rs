//! The `frhc` program: see [`frhc::cli`].
#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    frhc::cli::main()
}
