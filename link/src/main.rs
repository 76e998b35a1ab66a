//! Process of `frhc-link`; the library has its parts.

use std::process::ExitCode;

fn main() -> ExitCode {
    frhc_link::main()
}
