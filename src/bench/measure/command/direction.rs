//! `frhc measure direction`: a person moves the arm of a running node.

use std::sync::atomic::Ordering;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::command::DirectionArgs;
use crate::direction::{Answer, Direction, Event, Motion};
use crate::feed::{Feed, Reading};
use crate::measured::Task;
use crate::words::{found, question, wrong};
use config::Config;
use run::exit::{Failure, Kind, OrFail};
use run::viewer_args::ViewerArgs;
use run::{print, signal_flag};

/// Measures directions.
///
/// # Errors
/// When the configuration is wrong (exit 5), or cannot be judged.
pub(super) fn run(args: &DirectionArgs) -> Result<(), Failure> {
    let config = Config::load(&args.config).or_fail(Kind::Configuration)?;
    let mut measured = super::begin(&config, Task::Direction, args.again)?;
    let motions: Vec<_> = Motion::all()
        .filter(|motion| !measured.is_right(Task::Direction, &motion.name()))
        .collect();
    let skipped = Motion::all().count() - motions.len();
    if skipped > 0 {
        let path = measured.path().display();
        print::line(&format!(
            "{skipped} motions are measured already ({path}; --again measures them anew)."
        ));
    }
    let sockets = match &args.socket {
        Some(socket) => vec![socket.clone()],
        None => ViewerArgs { socket: None, config: Some(args.config.clone()) }.sockets()?,
    };
    let is_ending = signal_flag::register([SIGHUP, SIGINT, SIGTERM])?;
    let mut feed = Feed::connect(sockets)?;
    let mut direction = Direction::new(&config.controller.arm, motions);
    let mut has_begun = false;
    loop {
        if is_ending.load(Ordering::Relaxed) {
            let left: Vec<_> = direction.left().map(Motion::name).collect();
            let reason = format!("not proven: {}; the same command goes on there", left.join(", "));
            return Err(Failure::new(Kind::Interrupted, reason));
        }
        if print::has_failed() {
            // Nobody reads the questions: `print::finish` says why.
            return Ok(());
        }
        let Some(Reading { at, q }) = feed.next(&config)? else { continue };
        if !has_begun {
            has_begun = true;
            print::line(
                "Nothing moves by itself. Turn one joint alone where a joint is asked for; keep the arm still in between.",
            );
        }
        match direction.take(at, &q) {
            None => {}
            Some(Event::Ask(motion)) => print::line(&question(&config, motion, &q)),
            Some(Event::Answered(motion, Answer::Right)) => {
                measured.add(Task::Direction, motion.name())?;
                print::line(&format!("  {}: right", motion.name()));
            }
            Some(Event::Answered(motion, answer)) => {
                print::line(&format!("  {}: {}; once more", motion.name(), found(&config, answer)));
            }
            Some(Event::Wrong(motion, answer)) => {
                return Err(Failure::new(Kind::Drive, wrong(&config, motion, answer)));
            }
            Some(Event::Done) => {
                let path = measured.path().display();
                print::line(&format!("All directions are as the configuration says: {path}"));
                return Ok(());
            }
        }
    }
}
