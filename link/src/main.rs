//! The process: see the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    frhc_link::main()
}
