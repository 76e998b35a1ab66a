//! Process of the far side, which answers until the node requests the figures.

use std::io::{BufRead, Write};
use std::sync::mpsc::channel;
use std::time::Duration;

use contract::FarEnd;

use crate::Outcome;
use crate::end::{End, now};
use crate::figures::Direction;
use crate::options::Options;
use crate::role::Role;

/// Age of the newest command after which the far side holds (docs/link.md).
const HOLD_AFTER: Duration = Duration::from_millis(100);

/// Runs until a line "from to" (µs) arrives on standard input, and prints the figures of messages sent in that time.
pub(crate) fn run(options: &Options) -> Outcome<()> {
    let far = FarEnd::new(0, now().as_micros(), HOLD_AFTER);
    let mut end = End::open(options, Role::Far(Box::new(far)))?;
    let (sender, lines) = channel();
    std::thread::spawn(move || {
        for line in std::io::stdin().lock().lines().map_while(Result::ok) {
            // The loop below may have ended first.
            drop(sender.send(line));
        }
    });
    writeln!(std::io::stdout(), "ready")?;
    let line = loop {
        end.cycle(true)?;
        match lines.try_recv() {
            Ok(line) => break line,
            Err(std::sync::mpsc::TryRecvError::Empty) => {}
            Err(std::sync::mpsc::TryRecvError::Disconnected) => return Ok(()),
        }
    };
    let (from, to) = line.split_once(' ').ok_or("expected: from to")?;
    let figures = Direction::from_record(&end.record, (from.parse()?, to.parse()?))?;
    writeln!(std::io::stdout(), "{}", figures.line())?;
    Ok(())
}
