//! `frhc --help`: the commands in groups, each under what one does with them.

use clap::Command;

/// Greatest length of a line.
const WIDTH: usize = 100;

/// Column in which descriptions begin.
const INDENT: usize = 14;

/// Groups of commands in their order. A build without the simulation has fewer.
const GROUPS: [(&str, &[&str]); 6] = [
    ("Run an arm", &["check", "plan", "commission", "run", "ctl"]),
    ("Try without hardware", &["demo", "sim", "robot", "explain", "campaign"]),
    ("Watch a running node", &["top", "view"]),
    (
        "Recorded sessions and logs",
        &["sessions", "report", "replay", "plot", "signals", "export", "decode"],
    ),
    ("Devices on a bus", &["scan", "sdo", "nmt", "lss"]),
    ("Calibrate", &["measure", "calib", "config"]),
];

/// Gives a command a help with its subcommands in groups.
pub(super) fn in_groups(command: Command) -> Command {
    let listed = listed(&command);
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{listed}Options:\n{{options}}\n\n{{after-help}}"
    );
    command.help_template(template)
}

/// Returns the groups with the commands that there are.
fn listed(command: &Command) -> String {
    let mut text = String::new();
    for (title, names) in GROUPS {
        let commands = names.iter().filter_map(|name| command.find_subcommand(name));
        let rows: String = commands.map(row).collect();
        if !rows.is_empty() {
            text.push_str(&format!("{title}:\n{rows}\n"));
        }
    }
    text
}

/// Returns the name and the description of a command, in lines that fit.
fn row(command: &Command) -> String {
    let about = command.get_about().map(ToString::to_string).unwrap_or_default();
    let mut lines = vec![format!("  {:width$}", command.get_name(), width = INDENT - 3)];
    for word in about.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= WIDTH => {
                line.push(' ');
                line.push_str(word);
            }
            Some(_) | None => lines.push(format!("{:INDENT$}{word}", "")),
        }
    }
    lines.iter().map(|line| format!("{line}\n")).collect()
}

#[cfg(all(test, feature = "simulation"))]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn every_command_is_in_one_group() {
        let command = super::super::Cli::command();
        let mut names: Vec<_> = command.get_subcommands().map(Command::get_name).collect();
        let mut grouped: Vec<_> =
            GROUPS.iter().flat_map(|(_, names)| names.iter().copied()).collect();
        names.sort_unstable();
        grouped.sort_unstable();
        assert_eq!(names, grouped);
    }

    #[test]
    fn help_begins_with_what_runs_an_arm_and_fits() {
        let help = in_groups(super::super::Cli::command()).render_help().to_string();
        let place = |what: &str| help.find(what).unwrap();
        assert!(place("Run an arm:\n  check") < place("Try without hardware:\n  demo"), "{help}");
        assert!(place("Calibrate:") < place("Options:"), "{help}");
        assert!(place("Options:") < place("Exit codes:"), "{help}");
        let longest = help.lines().map(|line| line.chars().count()).max().unwrap();
        assert!(longest <= WIDTH, "{longest} in {help}");
    }
}
