//! docs/first-torque.md: its commands in their order, and what they print, on drives whose facts the configuration does not know.

use std::process::Command;

use crate::common::cli::{CommandOutput, typed};
use crate::common::prelude::*;

/// A hand holds the deadman for 20 s, time and again. None is on the arm until the signs are measured; then one supports it, which a
/// simulated arm needs in place of its cradle.
fn operator() -> String {
    let presses = (0..30).map(|press| {
        let [on, off] = [10.0, 30.0].map(|at| at + 26.0 * f64::from(press));
        format!(
            "[[switch]]\nat_s = {on:.1}\ndeadman = true\n[[switch]]\nat_s = {off:.1}\ndeadman = false\n"
        )
    });
    let presses: String = presses.collect();
    format!(
        "seconds = 900.0\n[[hold]]\nat_s = 0.0\nholding = false\n[[hold]]\nat_s = 25.0\nholding = true\n{presses}"
    )
}

/// Returns an arm with other masses, friction and torque curves than the file says.
fn as_built(text: &str) -> String {
    let factor = |key: &str| match key {
        "mass_kg" => 1.2,
        "coulomb_friction_nm" => 1.4,
        _ => 1.0,
    };
    let line = |line: &str| {
        let Some((key, rest)) = line.split_once(" = ") else { return line.to_owned() };
        let (number, more) = rest.split_once(' ').unwrap_or((rest, ""));
        match (number.parse::<f64>(), factor(key)) {
            (Ok(number), factor) if factor > 1.0 => format!("{key} = {} {more}", number * factor),
            _ => line.to_owned(),
        }
    };
    let built = text.lines().map(line).collect::<Vec<_>>().join("\n");
    assert_ne!(built, text);
    built
}

/// Returns the commands of the page, each with the lines that it prints.
fn commands(page: &str) -> Vec<(String, Vec<String>)> {
    let (mut commands, mut is_open) = (Vec::<(String, Vec<String>)>::new(), false);
    for line in page.lines() {
        if let Some(language) = line.strip_prefix("```") {
            is_open = language == "console";
        } else if let (true, Some(command)) = (is_open, line.strip_prefix("$ ")) {
            commands.push((command.to_owned(), Vec::new()));
        } else if is_open {
            commands.last_mut().expect("a command comes first").1.push(line.to_owned());
        }
    }
    commands
}

/// Returns a line with each number as `#`, as digits and signs are not promised.
fn shape(line: &str) -> String {
    let mut shape = String::new();
    for character in line.trim_end().chars() {
        let is_digit = character.is_ascii_digit();
        if !(is_digit && shape.ends_with('#')) {
            shape.push(if is_digit { '#' } else { character });
        }
    }
    let shape = shape.replace("#.#", "#").replace("-#", "#");
    shape.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Runs a command as a person does who waits until the deadman is released, and the weight carried.
fn patiently(scratch: &Scratch, words: &[&str]) -> CommandOutput {
    loop {
        let mut process = Command::new(crate::common::program());
        process.args(words).current_dir(scratch.path(""));
        let output = typed(scratch.at_home(&mut process), "\n");
        let awaits = ["the deadman", "the arm is not carried yet"];
        if !awaits.iter().any(|reason| output.stderr.contains(reason)) {
            return output;
        }
        let mut candump = Candump::start("vcan0");
        let now = candump.mark().nanos;
        candump.until(|line| line.nanos > now + 500_000_000);
    }
}

/// Returns whether an output has the lines of the page, where `…` stands for any.
fn is_as_printed(page: &[String], output: &str) -> bool {
    let page: Vec<_> = page.iter().map(|line| shape(line)).collect();
    let output: Vec<_> = output.lines().map(shape).collect();
    let mut rest = &output[..];
    let parts: Vec<_> = page.split(|line| line == "…").collect();
    for (number, part) in parts.iter().enumerate().filter(|(_, part)| !part.is_empty()) {
        let Some(at) = rest.windows(part.len()).position(|lines| lines == *part) else {
            return false;
        };
        if number == 0 && at > 0 {
            return false;
        }
        rest = &rest[at + part.len()..];
    }
    rest.is_empty() || parts.last().is_some_and(|last| last.is_empty())
}

#[test]
fn commands_of_the_first_torque_print_what_the_page_says() {
    page_runs_with("config/drives/maxon_epos4.toml", |_| true);
}

/// What `check`, `commission` and the boot print names the drives' own timers and facts.
#[test]
fn first_torque_of_nanotec_drives_is_the_same_but_for_their_facts() {
    page_runs_with("config/drives/nanotec_cl4e.toml", |command| {
        ["measure", "ctl park", "ctl disarm"].iter().any(|it| command.contains(it))
    });
}

/// Runs the commands of the page with the drives of a file, and compares what those print that `is_compared`.
fn page_runs_with(file: &str, is_compared: impl Fn(&str) -> bool) {
    let scratch = Scratch::new("first-torque");
    let page = fs::read_to_string("docs/first-torque.md").unwrap();
    let eds = fs::canonicalize("eds").unwrap();
    let file = text(file)
        .replace("\n[switches]\n", "\n[switches]\ndeadman_at = \"apart\"\n")
        .replace("\"../../eds/", &format!("\"{}/", eds.display()));
    scratch.write("my_arm.toml", &file);
    let built = scratch.write("as_built.toml", &as_built(&file));
    let operator = scratch.write("operator.toml", &operator());
    let sim = scratch.frhc(&["sim", "--config", &built, "--scenario", &operator]);
    let (mut run, mut transcript, mut differs) = (None, String::new(), false);
    for (command, printed) in commands(&page) {
        let words: Vec<_> = command.split(' ').skip(1).collect();
        if let [background @ .., "&"] = &*words {
            let file = scratch.path("my_arm.toml");
            let args: Vec<_> = background
                .iter()
                .map(|it| if *it == "my_arm.toml" { &*file } else { it })
                .collect();
            run = Some(scratch.frhc(&args));
            transcript += &format!("$ {command}\n");
            continue;
        }
        let output = patiently(&scratch, &words);
        assert_eq!(output.code, 0, "{transcript}$ {command}\n{}{}", output.stdout, output.stderr);
        transcript += &format!("$ {command}\n{}", output.stdout);
        differs |= is_compared(&command) && !is_as_printed(&printed, &output.stdout);
    }
    run.unwrap().terminate().succeeds();
    sim.terminate().succeeds();
    assert!(!differs, "docs/first-torque.md differs from what the commands print:\n{transcript}");
}
