//! `frhc measure sign` beside a node that is played: its control socket, and the drives that it tries.

use std::io::{BufRead, BufReader, Write};
use std::os::unix::net::UnixListener;
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::thread;

use controller::JointVector;
use measure::sign;
use serde_json::{Value, json};
use units::drive::PerMille;

use crate::common::cli::typed;
use crate::common::prelude::*;

/// What a played drive does when it is tried.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Drive {
    /// Moves with the torque that the description says.
    Right,
    /// Moves against it.
    Reversed,
    /// Stands.
    Stuck,
    /// Moves another joint's encoder.
    Other(u8),
    /// Needs a tenth of its torque.
    Easy,
}

/// Arm of one's own, with a node that is played.
struct Arm {
    file: PathBuf,
    /// Requests so far.
    asked: Arc<Mutex<Vec<String>>>,
}

impl Arm {
    /// Plays a node whose drives do this, joint 1 first. The deadman is closed at the first request, and opened during it.
    fn with(test: &str, drives: [Drive; 6]) -> Self {
        let folder = folder("measure_sign", test);
        let socket = std::env::temp_dir().join(format!("frhc-{test}-{}.sock", std::process::id()));
        _ = fs::remove_file(&socket);
        let eds = Path::new(env!("CARGO_MANIFEST_DIR")).join("eds");
        let text = text(KRAFT).replace("\"../eds/", &format!("\"{}/", eds.display()));
        let text = text.replacen(
            "[node]\n",
            &format!("[node]\nsocket = {:?}\n", socket.display().to_string()),
            1,
        );
        let file = folder.join("my_arm.toml");
        fs::write(&file, text).unwrap();
        let asked = Arc::<Mutex<Vec<String>>>::default();
        let (listener, log) = (UnixListener::bind(&socket).unwrap(), Arc::clone(&asked));
        let config = Config::load(&file).unwrap();
        thread::spawn(move || {
            let mut trial = Value::Null;
            for client in listener.incoming() {
                let mut client = client.unwrap();
                let mut line = String::new();
                BufReader::new(&client).read_line(&mut line).unwrap();
                let request: Value = serde_json::from_str(&line).unwrap();
                let ask = request["ask"].as_str().unwrap();
                let mut answer = json!({ "ok": true, "mode": "measuring" });
                if ask == "status" {
                    let q = rest(&config);
                    answer["status"] = json!({ "mode": "measuring", "q": q, "trial": trial });
                } else {
                    log.lock().unwrap().push(ask.to_owned());
                }
                let words: Vec<_> = ask.split(' ').collect();
                if let ["try", joint, share] = *words {
                    let asked = log.lock().unwrap();
                    let tries = asked.iter().filter(|it| it.starts_with("try")).count();
                    let (joint, share) = (joint.parse().unwrap(), share.parse().unwrap());
                    let drive = drives[usize::from(joint) - 1];
                    match tries {
                        1 => {
                            let closed = "the deadman is closed: release it first";
                            answer = json!({ "ok": false, "error": closed });
                        }
                        2 => trial = ended(joint, share, "let-go", &[Value::Null, Value::Null]),
                        _ => trial = report(&config, joint, share, drive),
                    }
                }
                writeln!(client, "{answer}").unwrap();
            }
        });
        Self { file, asked }
    }

    /// Runs `frhc measure sign` with these answers of a person.
    fn measure(&self, more: &[&str], stdin: &str) -> CommandOutput {
        let mut command = Command::new(crate::common::program());
        let command = command.args(["measure", "sign", "--config"]).arg(&self.file).args(more);
        typed(command, stdin)
    }

    fn last_asked(&self) -> Option<String> {
        self.asked.lock().unwrap().last().cloned()
    }
}

fn rest(config: &Config) -> [f64; 6] {
    config.joints.each_ref().map(|joint| joint.rest.unwrap().position())
}

/// Returns what a trial of this drive leads to.
fn report(config: &Config, number: u8, share: u16, drive: Drive) -> Value {
    let joint = Joint::new(number).unwrap();
    let breakaway = sign::breakaway(config, joint, &JointVector::from(rest(config)));
    let scale = if drive == Drive::Easy { 0.1 } else { 1.0 };
    let answer = |way: f64| {
        // Lifted against its weight, or turned against its friction; a weight that lies does not move down.
        let is_down = breakaway.weight * way < -breakaway.friction;
        let torque = scale * (breakaway.weight.abs() + 1.5 * breakaway.friction);
        let bound = f64::from(share) * breakaway.capacity / 1e3;
        if drive == Drive::Stuck || is_down || torque > bound {
            return json!({ "torque": 0, "counts": 0 });
        }
        let mut tau = JointVector::zeros();
        tau[joint.index()] = torque * way;
        let PerMille(torque) = *joint.entry(&config.controller.calibration.targets(&tau));
        let sense = if drive == Drive::Reversed { -1 } else { 1 };
        json!({ "torque": torque, "counts": 300 * sense * i32::from(torque.signum()) })
    };
    let mut report = ended(number, share, "done", &[answer(1.0), answer(-1.0)]);
    if let Drive::Other(other) = drive {
        report["end"] = json!("other-moved");
        report["moved_instead"] = json!(other);
    }
    report
}

/// Returns a trial that has ended.
fn ended(joint: u8, bound: u16, end: &str, answers: &[Value; 2]) -> Value {
    json!({
        "joint": joint, "bound": bound, "state": "ended", "end": end, "moved_instead": null, "answers": answers,
    })
}

/// All drives right, but for one.
fn but(joint: usize, drive: Drive) -> [Drive; 6] {
    let mut drives = [Drive::Right; 6];
    drives[joint - 1] = drive;
    drives
}

#[test]
fn right_signs_are_kept_and_the_node_boots_at_the_end() {
    let arm = Arm::with("right", [Drive::Right; 6]);
    let first = arm.measure(&[], "\nelevation\n\n\n\n\n");
    assert_eq!(first.code, 0, "{}{}", first.stdout, first.stderr);
    for joint in 1..=6 {
        assert!(first.stdout.contains(&format!("  joint {joint}: right\n")), "{}", first.stdout);
    }
    let once =
        |text: &str| assert_eq!(first.stdout.matches(text).count(), 1, "{text}: {}", first.stdout);
    once("  Release the deadman first.\n");
    once("  let go: once more; hold the deadman\n");
    once("joint 1 (azimuth): its drive pushes both ways, with at most ");
    once("Which joint has moved? Enter for elevation, else its name:");
    assert_eq!(arm.last_asked().as_deref(), Some("reset"));
    let kept = fs::read_to_string(arm.file.with_extension("measured.toml")).unwrap();
    assert!(kept.contains("[sign]") && kept.contains("\"joint 6\""), "{kept}");
    let asked = arm.asked.lock().unwrap().len();
    let again = arm.measure(&[], "");
    assert!(
        again.code == 0 && again.stdout.starts_with("6 signs are measured already"),
        "{}",
        again.stdout
    );
    assert_eq!(arm.asked.lock().unwrap().len(), asked, "nothing is pushed again");
    let one = arm.measure(&["--again", "--joint", "roll"], "\n");
    assert_eq!(one.code, 0, "{}", one.stderr);
    assert!(one.stdout.contains("Not measured yet: joints 1, 2, 3, 4 and 5"), "{}", one.stdout);
    let none = arm.measure(&["--joint", "tail"], "");
    assert!(
        none.code == 2 && none.stderr.contains("no joint \"tail\"; the joints are azimuth,"),
        "{}",
        none.stderr
    );
}

#[test]
fn hazard_53_wrong_drive_ends_with_its_key_and_all_drives_off() {
    for (name, drive, code, wanted) in [
        (
            "reversed",
            Drive::Reversed,
            5,
            "joint 3 (elbow), node 3: a positive torque (6071h) lowers its position (6064h)",
        ),
        ("easy", Drive::Easy, 5, "overcomes its weight, where"),
        ("other", Drive::Other(4), 5, "joint 3 (elbow): "),
        ("stuck", Drive::Stuck, 1, "joint 3 (elbow): not proven: it does not move with"),
    ] {
        let arm = Arm::with(name, but(3, drive));
        let ended = arm.measure(&[], "\n\n\n\n\n\n");
        assert_eq!(ended.code, code, "{name}: {}{}", ended.stdout, ended.stderr);
        assert!(ended.stderr.contains(wanted), "{name}: {}", ended.stderr);
        assert_eq!(arm.last_asked().as_deref(), Some("disarm"), "{name}");
        let left = "all drives are off; the torque limit of joint 3 (node 3) may still be reduced";
        assert!(ended.stderr.contains(left), "{name}: {}", ended.stderr);
        let kept = fs::read_to_string(arm.file.with_extension("measured.toml")).unwrap();
        assert!(kept.contains("joint 2") && !kept.contains("joint 3"), "{name}: {kept}");
    }
}

#[test]
fn hazard_53_joint_that_a_person_sees_moving_instead_is_a_swapped_node() {
    let arm = Arm::with("swapped", [Drive::Right; 6]);
    let swapped = arm.measure(&[], "\n\nroll\n");
    assert_eq!(swapped.code, 5, "{}", swapped.stderr);
    let key = "roll moved instead: node_id is wrong: those of \"elbow\" (3) and \"roll\" (6) may be swapped";
    assert!(swapped.stderr.contains(key), "{}", swapped.stderr);
    let nobody = arm.measure(&[], "");
    assert_eq!(nobody.code, 1, "{}", nobody.stderr);
    assert!(
        nobody.stderr.contains("not proven: nobody says which joint has moved"),
        "{}",
        nobody.stderr
    );
}

#[test]
fn absent_node_is_exit_4() {
    let arm = Arm::with("absent", [Drive::Right; 6]);
    let text = fs::read_to_string(&arm.file).unwrap();
    let place = text.find("socket = ").unwrap();
    fs::write(&arm.file, text[..place].to_owned() + &text[place..].replacen(".sock", ".none", 1))
        .unwrap();
    let absent = arm.measure(&[], "");
    assert_eq!(absent.code, 4, "{}", absent.stderr);
}
