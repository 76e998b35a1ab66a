//! The time before each line of a process on a bus: seconds since the origin of its run, as in `fault.json` and, with
//! the origin added, in `bus.log`.

use std::cell::Cell;
use std::io;
use std::io::Write;
use std::sync::OnceLock;

use units::time::Instant;

/// The process's own, once its buses are open.
static CLOCK: OnceLock<Clock> = OnceLock::new();

type Clock = Box<dyn Fn() -> Instant + Send + Sync>;

thread_local! {
    /// The time of the event that this thread is writing about.
    static MOMENT: Cell<Option<Instant>> = const { Cell::new(None) };
}

/// Starts the time of all lines.
pub fn start(clock: impl Fn() -> Instant + Send + Sync + 'static) {
    CLOCK.get_or_init(|| Box::new(clock));
}

/// Writes lines about something that happened at `moment`, maybe some milliseconds ago.
pub(super) fn at(moment: Instant, write: impl FnOnce()) {
    MOMENT.set(Some(moment));
    write();
    MOMENT.set(None);
}

/// `1.447025 s`.
pub fn seconds(moment: Instant) -> String {
    format!("{:.6} s", moment.since(Instant::ZERO).as_secs_f64())
}

/// Puts the time before each line, if there is a clock.
#[allow(missing_debug_implementations, reason = "a writer has none")]
pub struct Stamped(pub Box<dyn Write>);

impl Write for Stamped {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match MOMENT.get().or_else(|| CLOCK.get().map(|clock| clock())) {
            None => self.0.write_all(bytes)?,
            Some(moment) => {
                // In one piece: lines of several threads must not mix.
                let line = [seconds(moment).as_bytes(), b" ", bytes].concat();
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
    use std::io::Read;
    use std::io::pipe;

    use super::*;

    #[test]
    fn lines_about_an_event_carry_its_time() {
        let (mut read, write) = pipe().unwrap();
        let mut stamped = Stamped(Box::new(write));
        at(Instant::from_micros(1_447_025), || stamped.write_all(b" WARN mode\n").unwrap());
        stamped.write_all(b" INFO before the buses are open\n").unwrap();
        drop(stamped);
        let mut text = String::new();
        read.read_to_string(&mut text).unwrap();
        assert_eq!(text, "1.447025 s  WARN mode\n INFO before the buses are open\n");
    }
}
