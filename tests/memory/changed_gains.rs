//! Every gain of the controller, changed by a millionth: a replay names the first intermediate of the law that depends on it.

use std::cell::RefCell;
use std::io::Cursor;
use std::ops::Range;
use std::rc::Rc;

use crate::common::prelude::*;
use config::files::Files;
use config::trust::Trust;
use inputs::intermediates::Digest;
use inputs::{Input, InputSink, InputWriter};
use replay::{End, Replay};
use testbench::bench::Course;
use testbench::side::Side;

const SCENARIO: &str = "config/scenarios/teleoperation.toml";

/// The first intermediate that differs, for each number of a key; `-` where the session does not exercise it.
const FIRST: &[(&str, &str)] = &[
    ("rate_gain_per_s", "command command command - - command"),
    ("pose_gain", "command command command command command command"),
    ("wrench_gain", "f_g_task f_g_task f_g_task f_g_task f_g_task f_g_task"),
    ("deadband_m", "f_g_centring f_g_centring f_g_centring"),
    ("deadband_rad", "f_g_centring f_g_centring f_g_centring"),
    ("centring_n", "f_g_centring f_g_centring f_g_centring"),
    ("centring_nm", "f_g_centring f_g_centring f_g_centring"),
    ("contact_fade_n", "ledger"),
    ("damping_ns_per_m", "f_g_damping f_g_damping f_g_damping"),
    ("damping_nms_per_rad", "f_g_damping f_g_damping f_g_damping"),
    // The assist wrench, the task wrench and the joints stay within their limits, and the joints off their stops.
    ("assist_fraction", "-"),
    ("max_force_n", "-"),
    ("max_moment_nm", "-"),
    // No joint torque rises as fast as it may.
    ("torque_rise_s", "-"),
    ("ramp_s", "f_g_centring"),
    ("share", "ledger"),
    ("margin", "-"),
    ("push", "-"),
    ("max_energy_j", "energy"),
    // Bounds of the passivity damper, which is not needed at this wall; a threshold that no force is a millionth away from.
    ("max_damping_ns_per_m lever_m contact_threshold_n", "-"),
    ("contact_release_s", "energy"),
];

/// Inputs of a node, and the digests of its law.
#[derive(Clone)]
struct Recording(Rc<RefCell<InputWriter<Vec<u8>>>>);

impl InputSink for Recording {
    fn is_recording(&self) -> bool {
        true
    }

    fn on_input(&self, input: Input) {
        self.0.borrow_mut().write(&input).unwrap();
    }
}

/// Records the scenario.
fn recorded(config: &Config) -> Vec<u8> {
    let recording = Recording(Rc::new(RefCell::new(InputWriter::begin(Vec::new()).unwrap())));
    let scenario = script(&fs::read_to_string(SCENARIO).unwrap());
    let cycles = u64::try_from(config.period.as_micros()).unwrap();
    let cycles = 60_000_000 / cycles;
    let course = Course { scenario, seed: 1, speed: None };
    let mut bench =
        Bench::recorded(config, Side::from_config(config), course, (), recording.clone());
    bench.bring_up().unwrap();
    for _ in 0..cycles {
        let record = bench.cycle();
        recording.on_input(Input::Intermediates(record.cycle, Digest::from_output(&record.output)));
    }
    drop(bench);
    Rc::into_inner(recording.0).unwrap().into_inner().into_inner()
}

/// Returns the first intermediate that differs with this configuration; `-` if none does, and no frame.
fn first_difference(config: &Config, inputs: &[u8]) -> &'static str {
    let inputs = Cursor::new(inputs.to_vec());
    let mut replay = Replay::of_inputs(config, inputs).unwrap().unwrap();
    while replay.outcome().end.is_none() {
        replay.step();
        if let Some((cycle, name)) = replay.outcome().intermediate {
            assert!(cycle <= replay.outcome().last_cycle + 1);
            return name;
        }
    }
    let end = &replay.outcome().end;
    assert!(matches!(end, Some(End::Complete)), "no intermediate, but {end:?}");
    "-"
}

/// Returns the places of the numbers of each key in the tables of the controller, in their order.
fn gains(text: &str) -> Vec<(&str, Vec<Range<usize>>)> {
    let (mut gains, mut is_controller, mut line_begin) = (Vec::new(), false, 0);
    for line in text.split_inclusive('\n') {
        let code = line.split('#').next().unwrap();
        if code.starts_with('[') {
            is_controller = code.starts_with("[controller");
        }
        if let Some((key, value)) = code.split_once('=').filter(|_| is_controller) {
            let begin = line_begin + code.len() - value.len();
            let is_number = |one: &char| one.is_ascii_digit() || *one == '.';
            let mut places: Vec<Range<usize>> = Vec::new();
            for (place, _) in value.char_indices().filter(|(_, one)| is_number(one)) {
                let place = begin + place;
                match places.last_mut().filter(|last| last.end == place) {
                    Some(last) => last.end += 1,
                    None => places.push(place..place + 1),
                }
            }
            if !places.is_empty() {
                gains.push((key.trim(), places));
            }
        }
        line_begin += line.len();
    }
    gains
}

#[test]
fn gain_changed_by_a_millionth_is_named_by_its_intermediate() {
    let files = Files::on_disk(Trust::Any);
    let config = Config::load_from(&files, Path::new(KRAFT)).unwrap();
    let inputs = recorded(&config);
    assert_eq!(first_difference(&config, &inputs), "-");
    let text = fs::read_to_string(KRAFT).unwrap();
    let mut found = Vec::new();
    for (key, places) in gains(&text) {
        let first = places.into_iter().map(|place| {
            let changed = text[place.clone()].parse::<f64>().unwrap() * (1.0 + 1e-6);
            let text = format!("{}{changed}{}", &text[..place.start], &text[place.end..]);
            let mut copies = files.copies();
            copies.insert(KRAFT.into(), text.into_bytes().into());
            let changed = Config::load_from(&Files::copied(copies), Path::new(KRAFT)).unwrap();
            first_difference(&changed, &inputs)
        });
        let first = first.collect::<Vec<_>>().join(" ");
        found.push((key, first));
    }
    let expected = FIRST
        .iter()
        .flat_map(|(keys, first)| keys.split(' ').map(|key| (key, (*first).to_owned())));
    assert_eq!(found, expected.collect::<Vec<_>>());
}
