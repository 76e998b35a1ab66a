//! Measures one carrier of the link over the present network, and prints one row of the table in docs/carriers.md.
//!
//! ```text
//! carriers carrier=quic-mixed|quic-datagram|tls|udp rate=HZ seconds=S window=N limit=MS [label=TEXT]
//! ```
//!
//! Two processes, because zenoh's threads belong to the process and two sessions in one would share them. This one is the
//! node, and starts the far side. Both send the contract's messages and read one clock, so ages need no synchronization.
#![forbid(unsafe_code)]

mod carrier;
mod end;
mod far;
mod figures;
mod near;
mod options;
mod role;

use std::io::Write;
use std::process::ExitCode;

/// Errors end the measurement.
pub(crate) type Outcome<T> = Result<T, Box<dyn std::error::Error + Send + Sync>>;

fn main() -> ExitCode {
    zenoh::init_log_from_env_or("off");
    let run = options::Options::from_args(std::env::args().skip(1))
        .and_then(|options| if options.is_far { far::run(&options) } else { near::run(&options) });
    let Err(error) = run else { return ExitCode::SUCCESS };
    // Standard error may be closed; the exit status says it, too.
    drop(writeln!(std::io::stderr(), "carriers: {error}"));
    ExitCode::FAILURE
}
