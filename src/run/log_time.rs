//! Timestamp of log lines of a command on a bus: seconds since the origin of the run, as in `fault.json`. `bus.log` has the
//! same times with the origin added.

use std::cell::Cell;
use std::io::{self, Write};
use std::sync::OnceLock;

use units::time::Instant;

/// Bus clock of this process; set once its buses are open.
static CLOCK: OnceLock<Clock> = OnceLock::new();

type Clock = Box<dyn Fn() -> Instant + Send + Sync>;

thread_local! {
    /// Time of the event that this thread is logging.
    static EVENT_TIME: Cell<Option<Instant>> = const { Cell::new(None) };
}

/// Sets the clock of all later lines; a second call has no effect.
pub fn set_clock(clock: impl Fn() -> Instant + Send + Sync + 'static) {
    CLOCK.get_or_init(|| Box::new(clock));
}

/// Returns the time on the bus, once [`set_clock`] was called.
pub(super) fn now() -> Option<Instant> {
    CLOCK.get().map(|clock| clock())
}

/// Runs `write` with its lines stamped `moment`: the time of an event may be some milliseconds ago.
pub(super) fn stamp_with(moment: Instant, write: impl FnOnce()) {
    EVENT_TIME.set(Some(moment));
    write();
    EVENT_TIME.set(None);
}

/// Formats a time on the bus, as `1.447025 s`.
pub fn format_seconds(moment: Instant) -> String {
    format!("{:.6} s", moment.since(Instant::ZERO).as_secs_f64())
}

/// Writer that prefixes each line with the time, once [`set_clock`] was called.
#[allow(missing_debug_implementations, reason = "a `dyn Write` has no Debug")]
pub struct TimestampedWriter(pub Box<dyn Write>);

impl Write for TimestampedWriter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match EVENT_TIME.get().or_else(now) {
            None => self.0.write_all(bytes)?,
            Some(moment) => {
                // One write, so that lines of several threads do not mix.
                let line = [format_seconds(moment).as_bytes(), b" ", bytes].concat();
                self.0.write_all(&line)?;
            }
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, pipe};

    use super::*;

    #[test]
    fn lines_about_an_event_carry_its_time() {
        let (mut read, write) = pipe().unwrap();
        let mut stamped = TimestampedWriter(Box::new(write));
        stamp_with(Instant::from_micros(1_447_025), || stamped.write_all(b" WARN mode\n").unwrap());
        stamped.write_all(b" INFO before the buses are open\n").unwrap();
        drop(stamped);
        let mut text = String::new();
        read.read_to_string(&mut text).unwrap();
        assert_eq!(text, "1.447025 s  WARN mode\n INFO before the buses are open\n");
    }
}
