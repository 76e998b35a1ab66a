//! `frhc explain`: one controller cycle with every intermediate value of Fig. 3, the fault table, or a robot arm.

mod input;
mod rendered;
mod robot;

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};

use crate::explain::input::Flags;
use crate::explain::rendered::{json, text};
use crate::explain::robot::Robot;
use crate::faults::{self, Faults};
use config::Config;
use config::overlay::Setting;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use testbench::explanation;
use testbench::world;

/// `frhc explain`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct Explain {
    #[command(subcommand)]
    topic: Option<Topic>,
    /// Configuration [default: config/DEVICE.toml of the question's device, or config/kraft_like.toml].
    #[arg(short, long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Value of a key in place of the file's, as controller.assist_fraction=0.2; repeatable.
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<Setting>,
    /// Joint positions in rad or m: six comma-separated numbers.
    #[arg(long, value_name = "Q,...", value_parser = parse_six, allow_hyphen_values = true)]
    q: Option<[f64; 6]>,
    /// Joint positions one cycle earlier [default: those of --q].
    #[arg(long, value_name = "Q,...", value_parser = parse_six, allow_hyphen_values = true)]
    q_before: Option<[f64; 6]>,
    /// Joint positions when the reference was set [default: those of --q].
    #[arg(long, value_name = "Q,...", value_parser = parse_six, allow_hyphen_values = true)]
    q_reference: Option<[f64; 6]>,
    /// Wrench on the object at the sensor, payload removed, in N and N·m.
    #[arg(long, value_name = "F,...", value_parser = parse_six, allow_hyphen_values = true)]
    wrench: Option<[f64; 6]>,
    /// Control mode, rate or pose [default: as configured].
    #[arg(long)]
    mode: Option<String>,
    /// Variant of the control law, consistent or paper1997 [default: as configured].
    #[arg(long)]
    preset: Option<String>,
    /// Compute with the deadman switch released.
    #[arg(long)]
    no_deadman: bool,
    /// Compute with force reflection off.
    #[arg(long)]
    no_reflection: bool,
    /// Include the layers beyond the paper's control law (passivity, soft stops, ...).
    #[arg(long)]
    layers: bool,
    /// Print one JSON object; each value has its unit, frame and equation.
    #[arg(long)]
    json: bool,
    /// JSON object with the same inputs and more, such as gains, or a file with one. `-` reads stdin, which is
    /// also read if it is not a terminal and --q is absent.
    #[arg(value_name = "QUESTION")]
    question: Option<OsString>,
}

/// Other topics of `explain`.
#[derive(Debug, Subcommand)]
enum Topic {
    /// Prints the fault table: for each cause the reaction in each mode, who acts first, and how to reset it.
    Faults(Faults),
    /// Prints pose, Jacobian, gravity torques and mass matrix of a robot arm at given joint positions.
    Robot(Robot),
}

/// Computes the cycle and prints it.
pub(super) fn run(args: &Explain) -> Result<(), Failure> {
    match &args.topic {
        Some(Topic::Faults(args)) => {
            faults::run(args);
            return Ok(());
        }
        Some(Topic::Robot(args)) => return robot::run(args),
        None => {}
    }
    if args.question.as_deref().is_some_and(|question| question == "faults") {
        return Err(Failure::new(Kind::Usage, "`explain faults` accepts no options of `explain`"));
    }
    let mut input = input::read(args.question.as_deref(), args.flags())?;
    let question = &mut input.question;
    question.q = args.q.or(question.q);
    question.q_before = args.q_before.or(question.q_before);
    question.q_reference = args.q_reference.or(question.q_reference);
    question.f_s = args.wrench.or(question.f_s);
    question.mode = args.mode.clone().or_else(|| question.mode.take());
    question.preset = args.preset.clone().or_else(|| question.preset.take());
    question.deadman = if args.no_deadman { Some(false) } else { question.deadman };
    question.reflection = if args.no_reflection { Some(false) } else { question.reflection };
    question.layers |= args.layers;

    let device = input.device.as_deref().unwrap_or("kraft_like");
    let shipped = || Path::new("config").join(device).with_extension("toml");
    let file = args.config.clone().unwrap_or_else(shipped);
    let config = Config::load_with(&file, &args.set).or_fail(Kind::Configuration)?;
    let start = world::start(&config.plant());
    let explanation =
        explanation::explain(&config, &start, &input.question).or_fail(Kind::Usage)?;
    for (key, replacement) in input.question.keys_of_the_configuration() {
        print::note(&format!(
            "{key} of a question goes in the next release: use --set {replacement}"
        ));
    }
    print::line(&if args.json { json(&explanation) } else { text(&explanation) });
    Ok(())
}

impl Explain {
    /// Returns the part of the question that the flags contain.
    fn flags(&self) -> Flags {
        let numbers = [self.q_before, self.q_reference, self.wrench];
        let names = [&self.mode, &self.preset];
        let switches = [self.no_deadman, self.no_reflection, self.layers];
        let is_any = numbers.iter().any(Option::is_some)
            || names.iter().any(|name| name.is_some())
            || switches.contains(&true);
        match (self.q, is_any) {
            (Some(_), _) => Flags::Position,
            (None, true) => Flags::Some,
            (None, false) => Flags::Absent,
        }
    }
}

/// Parses six comma-separated numbers.
fn parse_six(text: &str) -> Result<[f64; 6], String> {
    let number =
        |part: &str| part.trim().parse().map_err(|_| format!("expected a number, got \"{part}\""));
    let numbers: Vec<f64> = text.split(',').map(number).collect::<Result<_, _>>()?;
    let found = numbers.len();
    numbers.try_into().map_err(|_| format!("expected six numbers, got {found}"))
}
