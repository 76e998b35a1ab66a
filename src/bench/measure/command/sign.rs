//! `frhc measure sign`: the drives of a running node are tried one after the other.

use std::io::BufRead;
use std::sync::atomic::{AtomicBool, Ordering};

use serde_json::Value;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::command::SignArgs;
use crate::measured::Task;
use crate::sign::{self, Verdict};
use crate::words;
use config::Config;
use controller::JointVector;
use run::ctl::client::Client;
use run::exit::{Failure, Kind, OrFail};
use run::{print, signal_flag};
use telemetry::trial_status::TrialReport;
use units::numbering::Joint;
use units::wording::listed;

/// Tries all drives, or those that are not measured yet.
///
/// # Errors
/// When a sign is wrong (exit 5), not proven or refused (exit 1), or the node does not respond (exit 4).
pub(super) fn run(args: &SignArgs) -> Result<(), Failure> {
    let config = Config::load(&args.config).or_fail(Kind::Configuration)?;
    let mut measured = super::begin(&config, Task::Sign, args.again)?;
    let wanted = wanted(&config, args.joint.as_deref())?;
    let is_right = |joint: &Joint| measured.is_right(Task::Sign, &step(*joint));
    let (right, left): (Vec<_>, Vec<_>) = wanted.into_iter().partition(is_right);
    if !right.is_empty() {
        let path = measured.path().display();
        print::line(&format!(
            "{} signs are measured already ({path}; --again measures them anew).",
            right.len()
        ));
    }
    if left.is_empty() {
        return Ok(());
    }
    let is_ending = signal_flag::register([SIGHUP, SIGINT, SIGTERM])?;
    let at_arm = AtArm { client: Client::of(&config)?, is_ending, config };
    let q = at_arm.positions()?;
    print::line(
        "Lay the arm in its rest, with a support below it, and take your hands off. One drive after the other is switched on, \
         alone; it pushes while the deadman is held, and is off again when it is released.",
    );
    for joint in left {
        at_arm.try_joint(joint, &q).inspect_err(|_| at_arm.leave(joint))?;
        measured.add(Task::Sign, step(joint)).inspect_err(|_| at_arm.leave(joint))?;
        print::line(&format!("  joint {joint}: right"));
    }
    print::line("The node boots, and writes the planned torque limits again.");
    at_arm.client.ask("reset")?;
    let is_left = |joint: &Joint| !measured.is_right(Task::Sign, &step(*joint));
    let left: Vec<_> = Joint::ALL.into_iter().filter(is_left).collect();
    let path = measured.path().display();
    print::line(&match left.len() {
        0 => format!("All signs are as the configuration says: {path}"),
        _ => format!("Not measured yet: joints {}: {path}", listed(&left)),
    });
    Ok(())
}

/// Returns the joint that is called so, or all.
fn wanted(config: &Config, called: Option<&str>) -> Result<Vec<Joint>, Failure> {
    let Some(called) = called else { return Ok(Joint::ALL.to_vec()) };
    let mut joints = Joint::each(&config.joints);
    let found = joints
        .find(|(joint, parameters)| parameters.name == called || joint.to_string() == called)
        .map(|(joint, _)| joint);
    let names: Vec<_> = config.joints.iter().map(|joint| joint.name.as_str()).collect();
    let reason = || format!("no joint {called:?}; the joints are {}", names.join(", "));
    found.map(|joint| vec![joint]).ok_or_else(|| Failure::new(Kind::Usage, reason()))
}

/// Returns the name of the step of a joint in the file of measurements.
fn step(joint: Joint) -> String {
    format!("joint {joint}")
}

/// Node whose drives are tried.
struct AtArm {
    config: Config,
    client: Client,
    is_ending: std::sync::Arc<AtomicBool>,
}

impl AtArm {
    /// Returns the positions of the arm, in rad or m.
    fn positions(&self) -> Result<JointVector, Failure> {
        let status = self.client.status()?;
        let q = status.get("q").and_then(Value::as_array).into_iter().flatten();
        let q: Vec<_> = q.filter_map(Value::as_f64).collect();
        if q.len() < self.config.joints.len() {
            let reason = "the node is booting, or a zero is unknown: run `frhc ctl zero` first (docs/zero.md)";
            return Err(Failure::new(Kind::Negative, reason));
        }
        Ok(JointVector::from_iterator(q))
    }

    /// Tries a drive with one bound after the other, until its joint has moved.
    fn try_joint(&self, joint: Joint, q: &JointVector) -> Result<(), Failure> {
        let parameters = joint.entry(&self.config.joints);
        let breakaway = sign::breakaway(&self.config, joint, q);
        let bounds = sign::bounds(&breakaway);
        for bound in &bounds {
            let (bound, is_last) = (*bound, bounds.last() == Some(bound));
            print::line(&words::push(parameters, joint, &breakaway, bound));
            let report = self.try_once(joint, bound)?;
            print::line(&words::answers(parameters, &report));
            match sign::judge(parameters, &breakaway, &report, is_last) {
                Verdict::Unclear => {}
                Verdict::Right => return self.confirm(joint),
                verdict @ (Verdict::Reversed | Verdict::OtherTorque { .. }) => {
                    let reason = words::wrong_sign(&self.config, joint, verdict);
                    return Err(Failure::new(Kind::Drive, reason));
                }
            }
        }
        Err(Failure::new(Kind::Negative, words::not_proven(&self.config, joint, &breakaway)))
    }

    /// Tries a drive within a bound, as often as the deadman is released before its end.
    fn try_once(&self, joint: Joint, bound: u16) -> Result<TrialReport, Failure> {
        loop {
            self.begin(joint, bound)?;
            let report = self.ended(joint, bound)?;
            match report.end.as_deref() {
                Some("done") => return Ok(report),
                Some("let-go") => print::line("  let go: once more; hold the deadman"),
                _ => {
                    let kind = match report.moved_instead {
                        Some(_) => Kind::Drive,
                        None => Kind::Negative,
                    };
                    return Err(Failure::new(kind, words::aborted(&self.config, joint, &report)));
                }
            }
        }
    }

    /// Begins a trial once the deadman is released.
    fn begin(&self, joint: Joint, bound: u16) -> Result<(), Failure> {
        let mut is_told = false;
        while !self.client.ask_released(&format!("try {joint} {bound}"))? {
            if !std::mem::replace(&mut is_told, true) {
                print::line("  Release the deadman first.");
            }
            self.check_end()?;
            self.client.pause();
        }
        Ok(())
    }

    /// Checks that neither a signal nor a closed output ends the command.
    fn check_end(&self) -> Result<(), Failure> {
        if self.is_ending.load(Ordering::Relaxed) || print::has_failed() {
            return Err(Failure::new(Kind::Interrupted, "interrupted: the same command goes on"));
        }
        Ok(())
    }

    /// Awaits the end of a trial.
    fn ended(&self, joint: Joint, bound: u16) -> Result<TrialReport, Failure> {
        loop {
            self.check_end()?;
            let status = self.client.status()?;
            if let Some(cause) = status.get("stopped_by").and_then(Value::as_str) {
                return Err(Failure::new(Kind::Negative, format!("the node has stopped: {cause}")));
            }
            let report = status.get("trial").cloned().unwrap_or_default();
            let report: Option<TrialReport> = serde_json::from_value(report).or_fail(Kind::Bus)?;
            let Some(report) = report else {
                return Err(Failure::new(Kind::Negative, "the node has booted: begin again"));
            };
            if (report.joint, report.bound) != (joint.number(), bound) {
                let reason = "another client tries drives of this node: let it end first";
                return Err(Failure::new(Kind::Negative, reason));
            }
            if report.end.is_some() {
                return Ok(report);
            }
            self.client.pause();
        }
    }

    /// Asks which joint has moved: a drive of another joint with the same node-id answers as this one.
    fn confirm(&self, joint: Joint) -> Result<(), Failure> {
        let name = &joint.entry(&self.config.joints).name;
        print::line(&format!("  Which joint has moved? Enter for {name}, else its name:"));
        let mut answer = String::new();
        let read = std::io::stdin().lock().read_line(&mut answer).or_fail(Kind::System)?;
        if read == 0 {
            let reason =
                format!("joint {joint} ({name}): not proven: nobody says which joint has moved");
            return Err(Failure::new(Kind::Negative, reason));
        }
        let answer = answer.trim();
        if answer.is_empty() || answer == name {
            return Ok(());
        }
        Err(Failure::new(Kind::Drive, words::moved_instead(&self.config, joint, answer)))
    }

    /// Switches the drives off, and says what is left in which drive.
    fn leave(&self, joint: Joint) {
        let node = joint.entry(&self.config.joints).node.raw();
        let left = match self.client.ask("disarm") {
            Ok(()) => "all drives are off",
            Err(_) => "the node does not answer",
        };
        print::note(&format!(
            "{left}; the torque limit of joint {joint} (node {node}) may still be reduced, nothing is stored: `frhc ctl reset` \
             boots the drives and writes it again; then the same command goes on"
        ));
    }
}
