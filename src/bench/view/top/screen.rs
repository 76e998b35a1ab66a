//! Terminal in raw mode with its alternate screen; restored at every end of the process.

use std::io::{self, Stdout, Write};
use std::os::fd::AsFd;
use std::panic;

use nix::errno::Errno;
use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::time::TimeSpec;
use nix::sys::timerfd::{ClockId, Expiration, TimerFd, TimerFlags, TimerSetTimeFlags};
use nix::unistd::read;
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;
use ratatui::crossterm::cursor::Show;
use ratatui::crossterm::execute;
use ratatui::crossterm::terminal::{
    Clear, ClearType, EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};

use super::view::Scene;

/// Time between two drawings.
const DRAW_PERIOD_MS: i64 = 100;

/// Number of drawings in a second.
pub(super) const DRAWINGS_PER_S: u64 = 10;

/// Terminal in raw mode with its alternate screen; restored on drop.
#[derive(Debug)]
pub(super) struct Screen {
    terminal: Terminal<CrosstermBackend<Stdout>>,
    clock: TimerFd,
}

/// Reason why the wait for the next drawing has ended.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Event {
    /// Due time of the next drawing.
    Tick,
    /// Received signal.
    Signal,
    /// Keys were pressed.
    Keys(Vec<u8>),
    /// Terminal that is gone.
    HungUp,
}

impl Screen {
    /// Takes over the terminal, whose state a panic restores, too.
    ///
    /// # Errors
    /// Returns an error if the terminal or the timer cannot be set.
    pub(super) fn start() -> io::Result<Self> {
        let clock = TimerFd::new(ClockId::CLOCK_MONOTONIC, TimerFlags::TFD_CLOEXEC)?;
        let period = TimeSpec::new(0, DRAW_PERIOD_MS * 1_000_000);
        clock.set(Expiration::Interval(period), TimerSetTimeFlags::empty())?;
        let terminal = Terminal::new(CrosstermBackend::new(io::stdout()))?;
        // The message of a panic belongs on the main screen, and a release build ends without dropping anything.
        let report = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            restore();
            report(panic);
        }));
        enable_raw_mode()?;
        let screen = Self { terminal, clock };
        execute!(io::stdout(), EnterAlternateScreen, Clear(ClearType::All))?;
        Ok(screen)
    }

    /// Draws a scene in the present size of the terminal.
    ///
    /// # Errors
    /// Returns an error if the terminal cannot be written.
    pub(super) fn draw(&mut self, scene: &Scene<'_>) -> io::Result<()> {
        self.terminal.draw(|frame| scene.draw(frame.area(), frame.buffer_mut())).map(drop)
    }

    /// Waits for the next event: not longer than the period of drawings.
    ///
    /// # Errors
    /// Returns an error if the terminal or the timer cannot be read.
    pub(super) fn wait(&self) -> io::Result<Event> {
        let stdin = io::stdin();
        let mut sources = [
            PollFd::new(stdin.as_fd(), PollFlags::POLLIN),
            PollFd::new(self.clock.as_fd(), PollFlags::POLLIN),
        ];
        match poll(&mut sources, PollTimeout::NONE) {
            Err(Errno::EINTR) => return Ok(Event::Signal),
            other => other?,
        };
        let [keys, clock] = sources.map(|source| source.any().unwrap_or_default());
        if keys {
            let mut bytes = [0; 64];
            return Ok(match read(stdin.as_fd(), &mut bytes) {
                Ok(count) if count > 0 => Event::Keys(bytes.into_iter().take(count).collect()),
                Err(Errno::EINTR) => Event::Signal,
                Ok(_) | Err(_) => Event::HungUp,
            });
        }
        if clock {
            self.clock.wait()?;
        }
        Ok(Event::Tick)
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        restore();
    }
}

/// Restores the terminal as far as there still is one.
fn restore() {
    disable_raw_mode().unwrap_or_default();
    execute!(io::stdout(), LeaveAlternateScreen, Show).unwrap_or_default();
    io::stdout().flush().unwrap_or_default();
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Read;
    use std::process::{Command, Stdio};

    use nix::pty::{Winsize, openpty};
    use nix::sys::termios::{LocalFlags, tcgetattr};

    use super::*;

    const PANICKING: &str = "top::screen::tests::panicking_screen_of_the_test_below";

    #[test]
    #[ignore = "needs a terminal: the test below runs it on one"]
    fn panicking_screen_of_the_test_below() {
        let _screen = Screen::start().unwrap();
        panic!("on purpose");
    }

    #[test]
    fn panic_restores_the_terminal_before_its_message() {
        let size = Winsize { ws_row: 24, ws_col: 80, ws_xpixel: 0, ws_ypixel: 0 };
        let pty = openpty(&size, None).unwrap();
        let is_canonical = || {
            tcgetattr(&pty.master)
                .unwrap()
                .local_flags
                .contains(LocalFlags::ICANON | LocalFlags::ECHO)
        };
        assert!(is_canonical());
        let side = || Stdio::from(pty.slave.try_clone().unwrap());
        let mut command = Command::new(std::env::current_exe().unwrap());
        command.args(["--exact", PANICKING, "--ignored", "--nocapture", "--test-threads=1"]);
        let mut process = command.stdin(side()).stdout(side()).stderr(side()).spawn().unwrap();
        assert!(!process.wait().unwrap().success());
        assert!(is_canonical(), "raw mode is left");
        drop((command, pty.slave));
        let mut written = Vec::new();
        // Ends with EIO, as there is no other side any more.
        File::from(pty.master).read_to_end(&mut written).unwrap_err();
        let written = String::from_utf8_lossy(&written);
        let place =
            |part: &str| written.find(part).unwrap_or_else(|| panic!("{part:?}: {written}"));
        assert!(place("\u{1b}[?1049h") < place("\u{1b}[?1049l"));
        assert!(place("\u{1b}[?1049l") < place("on purpose"));
        place("\u{1b}[?25h");
    }
}
