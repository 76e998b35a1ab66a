//! Scales, locks and alignment while the node runs: on every shipped hand controller, in contact, in both modes, no torque jumps.

use nalgebra::Isometry3;

use crate::common::prelude::*;
use controller::adjustment::AdjustmentError;
use controller::switches::CommandMode;
use node::RequestError;
use remote::site::Virtual;
use testbench::comparison;
use units::adjustment::{Adjustment, LockAxis, Quantity};

/// Maximum change of a torque in one cycle, in % of the joint's capacity.
const MAX_STEP_PERCENT: f64 = 2.0;

/// Adjustments, each with its inverse.
const ADJUSTMENTS: [(&str, &str); 6] = [
    ("scale motion 0.5", "scale motion 1"),
    ("scale force 0.2", "scale force 1"),
    ("scale rotation 0.1", "scale rotation 1"),
    ("lock x on", "lock x off"),
    ("lock y on", "lock y off"),
    ("lock rz on", "lock rz off"),
];

/// Time at which the object is pressed into the wall, in s, and for how long torques are compared.
const PRESSED_S: f64 = 5.0;
const COMPARED_S: f64 = 0.6;

/// A bench that follows a scenario from its boot on.
#[derive(Clone)]
struct Rig {
    bench: Bench<()>,
    capacities: [f64; 6],
    last: Record,
}

impl Rig {
    fn new(config: &Config, scenario: Scenario, mode: CommandMode) -> Self {
        let mut bench = started(config, scenario, ());
        bench.ask(Request::Command(mode)).unwrap();
        let calibration = &config.controller.calibration;
        let capacities = calibration.coupling().capacities(&calibration.max_torques()).into();
        let last = bench.cycle();
        Self { bench, capacities, last }
    }

    /// Runs until `seconds`; returns the largest step of a torque, as a share of its capacity.
    fn until(&mut self, seconds: f64) -> f64 {
        let mut largest: f64 = 0.0;
        while self.bench.elapsed().as_secs_f64() < seconds {
            largest = self.cycle().max(largest);
        }
        largest
    }

    /// Runs a cycle; returns the largest step of a torque.
    fn cycle(&mut self) -> f64 {
        let before = std::mem::replace(&mut self.last, self.bench.cycle());
        assert_eq!(self.last.cause, None);
        let steps = (self.last.output.tau - before.output.tau).abs();
        let shares = steps.iter().zip(self.capacities).map(|(step, capacity)| step / capacity);
        shares.fold(0.0, f64::max)
    }

    fn adjust(&mut self, text: &str) -> Result<Mode, RequestError> {
        self.bench.ask(Request::Adjust(text.parse().unwrap()))
    }

    /// Returns the reason why an adjustment is refused.
    fn refused(&mut self, text: &str) -> AdjustmentError {
        match self.adjust(text) {
            Err(RequestError::Adjustment(refused)) => refused,
            other => panic!("{text}: {other:?}"),
        }
    }

    fn x_b_m(&self) -> Isometry3<f64> {
        self.last.x_b_m
    }
}

/// Returns a rig whose operator presses the object into the wall.
fn pressed(config: &Config, mode: CommandMode) -> Rig {
    let script = match mode {
        CommandMode::Rate => scenario("contact_10s"),
        CommandMode::Pose => free_script(&moved_to(2.0, "to_m = [0.08, 0.0, 0.0]")),
    };
    let mut rig = Rig::new(config, script, mode);
    rig.until(PRESSED_S);
    let force = rig.last.f_s.force.norm();
    assert!(rig.last.mode == Mode::Engaged && force > 1.5, "{mode:?}: {force} N");
    rig
}

/// Returns a script in pose mode that is engaged at 2 s without contact, with these entries after it.
fn free_script(entries: &str) -> Scenario {
    let switch = |at: f64, levels: &str| format!("[[switch]]\nat_s = {at:?}\n{levels}\n");
    let begin = [
        switch(1.2, "deadman = true"),
        switch(1.3, "reflection = true"),
        switch(1.4, "reflection = false"),
        switch(1.5, "reference = true"),
        switch(1.6, "reference = false"),
    ];
    let arm = "[[console]]\nat_s = 0.3\nrequest = \"arm\"\n";
    let text = format!("seconds = 20.0\n[hand]\ntremor_mm = 0.0\n{arm}{}{entries}", begin.concat());
    script(&text)
}

fn moved_to(at: f64, to: &str) -> String {
    format!("[[move]]\nat_s = {at:?}\nduration_s = 1.0\n{to}\n")
}

/// Returns kraft_like without anything to touch.
fn free() -> Config {
    let config = config(KRAFT);
    let remote = Virtual { wall: None, block: None, sphere: None, ..config.remote.clone() };
    config.with_remote(remote)
}

/// Returns how far the object went from `start`, in its frame of then.
fn way(start: &Isometry3<f64>, rig: &Rig) -> Isometry3<f64> {
    start.inverse() * rig.x_b_m()
}

#[test]
fn scale_of_motion_shortens_the_ways_that_follow() {
    let script =
        [moved_to(2.0, "to_m = [0.02, 0.0, 0.0]"), moved_to(4.0, "to_m = [0.04, 0.0, 0.0]")];
    let mut rig = Rig::new(&free(), free_script(&script.concat()), CommandMode::Pose);
    rig.until(1.9);
    let start = rig.x_b_m();
    rig.until(3.4);
    let first = way(&start, &rig).translation.vector;
    rig.adjust("scale motion 0.25").unwrap();
    let kept = rig.x_b_m();
    rig.until(4.0);
    let during = (kept.inverse() * rig.x_b_m()).translation.vector.norm();
    assert!(during < 1e-4, "the object moved by {during} m while the scale changed");
    let middle = rig.x_b_m();
    rig.until(6.0);
    let second = way(&middle, &rig).translation.vector;
    let ratio = second.norm() / first.norm();
    assert!((ratio - 0.25).abs() < 0.02, "{first} {second}");
}

#[test]
fn locked_axis_takes_no_command_and_released_follows_again() {
    let script =
        [moved_to(2.0, "to_m = [0.02, 0.02, 0.0]"), moved_to(4.0, "to_m = [0.0, 0.0, 0.0]")];
    for mode in [CommandMode::Rate, CommandMode::Pose] {
        let config = free();
        let travelled = |is_locked: bool| {
            let mut rig = Rig::new(&config, free_script(&script.concat()), mode);
            rig.until(1.0);
            if is_locked {
                rig.adjust("lock x on").unwrap();
                rig.adjust("lock y on").unwrap();
                rig.adjust("lock z on").unwrap();
            }
            rig.until(1.9);
            let start = rig.x_b_m();
            rig.until(3.2);
            way(&start, &rig).translation.vector.norm()
        };
        let (locked, free) = (travelled(true), travelled(false));
        assert!(locked < 1e-4 && free > 5e-3, "{mode:?}: {locked} m, {free} m");
    }
}

#[test]
fn alignment_turns_the_object_to_the_grip_where_it_is() {
    let turn = moved_to(2.5, "to_rad = [0.3, -0.2, 0.4]");
    let mut rig = Rig::new(&free(), free_script(&turn), CommandMode::Pose);
    rig.until(1.9);
    rig.adjust("scale rotation 0.1").unwrap();
    rig.until(4.5);
    let apart = |rig: &Rig| rig.x_b_m().rotation.angle_to(&rig.last.output.x_0_g.rotation);
    let (before, place) = (apart(&rig), rig.x_b_m().translation.vector);
    assert!(before > 0.05, "{before} rad");
    rig.adjust("align").unwrap();
    let mut fastest: f64 = 0.0;
    loop {
        let from = rig.x_b_m().rotation;
        rig.cycle();
        fastest = fastest.max(from.angle_to(&rig.x_b_m().rotation) / 1e-3);
        if !rig.last.output.adjusted.is_aligning {
            break;
        }
        assert!(rig.bench.elapsed().as_secs_f64() < 15.0);
    }
    rig.until(rig.bench.elapsed().as_secs_f64() + 0.5);
    assert!(apart(&rig) < 0.01, "{} rad", apart(&rig));
    assert!(fastest < 0.6, "{fastest} rad/s");
    let drift = (rig.x_b_m().translation.vector - place).norm();
    assert!(drift < 1e-3, "{drift} m");
}

#[test]
fn alignment_ends_with_the_deadman() {
    let entries = [
        moved_to(2.0, "to_rad = [0.3, 0.0, 0.0]"),
        "[[switch]]\nat_s = 4.0\ndeadman = false\n".to_owned(),
    ];
    let mut rig = Rig::new(&free(), free_script(&entries.concat()), CommandMode::Pose);
    rig.until(1.7);
    rig.adjust("scale rotation 0.1").unwrap();
    rig.until(3.9);
    rig.adjust("align").unwrap();
    rig.until(3.95);
    assert!(rig.last.output.adjusted.is_aligning);
    rig.until(4.1);
    let held = rig.x_b_m().rotation;
    assert!(!rig.last.output.adjusted.is_aligning && rig.last.mode == Mode::Armed);
    rig.until(5.0);
    assert!(held.angle_to(&rig.x_b_m().rotation) < 0.01);
}

#[test]
fn refusals_name_their_reason_and_change_nothing() {
    let config = comparison::surrounded(&config(KRAFT), &scenario("contact_10s"));
    let mut rate = pressed(&config, CommandMode::Rate);
    let before = rate.last.output.adjusted;
    assert_eq!(rate.refused("align"), AdjustmentError::NotPose);
    let AdjustmentError::OutOfBounds { quantity, low, high, value } =
        rate.refused("scale motion 1.5")
    else {
        panic!()
    };
    assert_eq!((quantity, low, high, value), (Quantity::Motion, 0.1, 1.0, 1.5));
    let f_m = rate.last.output.f_m_task.components();
    let pushed = LockAxis::ALL
        .into_iter()
        .max_by(|a, b| a.entry(&f_m).abs().total_cmp(&b.entry(&f_m).abs()))
        .unwrap();
    let yields = config.controller.bounds.yields;
    assert!(pushed.entry(&yields), "{pushed} of {yields:?}");
    assert_eq!(
        rate.refused(&format!("lock {pushed} on")),
        AdjustmentError::HoldsContact { axis: pushed }
    );
    rate.until(PRESSED_S + 0.1);
    assert_eq!(rate.last.output.adjusted, before);

    let mut pose = pressed(&config, CommandMode::Pose);
    assert_eq!(pose.refused("align"), AdjustmentError::InContact);
    pose.adjust(&format!("lock {pushed} on")).unwrap();

    let mut idle = Rig::new(&config, scenario("contact_10s"), CommandMode::Pose);
    assert_eq!(idle.refused("align"), AdjustmentError::NotCommanding);
    let mut locked = Rig::new(&free(), free_script(""), CommandMode::Pose);
    locked.until(2.0);
    locked.adjust("lock ry on").unwrap();
    assert_eq!(locked.refused("align"), AdjustmentError::Locked { axis: LockAxis::Ry });
}

#[test]
fn buttons_of_the_switch_box_adjust_and_take_back() {
    let text = fs::read_to_string(KRAFT).unwrap();
    let buttons = "[[switches.button]]\nbit = 4\npress = \"scale motion 0.5\"\n[[switches.button]]\nbit = 6\npress = \"lock rz on\"\n\
                   [[switches.button]]\nbit = 7\npress = \"align\"\n";
    let config = parse(KRAFT, &format!("{text}\n{buttons}"));
    let levels = |at: f64, bits: &str| format!("[[switch]]\nat_s = {at:?}\nbuttons = {bits}\n");
    let none = "[false, false, false, false]";
    let presses = [
        levels(2.0, "[true, false, true, false]"),
        levels(2.2, none),
        levels(3.0, "[true, false, false, true]"),
        levels(3.2, none),
        levels(4.0, "[false, true, false, false]"),
        levels(4.2, none),
    ];
    let mut rig = Rig::new(&config, free_script(&presses.concat()), CommandMode::Rate);
    rig.until(2.5);
    let adjusted = rig.last.output.adjusted;
    assert_eq!((adjusted.scale.motion, adjusted.locked[5]), (0.5, true));
    let mut refused = None;
    while rig.bench.elapsed().as_secs_f64() < 3.5 {
        rig.cycle();
        refused = refused.or(rig.last.refused_press);
    }
    let adjusted = rig.last.output.adjusted;
    assert_eq!((adjusted.scale.motion, adjusted.locked[5]), (1.0, true));
    let refused = refused.unwrap();
    assert_eq!(
        (refused.adjustment, refused.refused),
        (Adjustment::Align, AdjustmentError::NotPose)
    );
    rig.until(5.0);
    let left = rig.last.output.adjusted;
    assert_eq!((left.scale, left.locked), (adjusted.scale, adjusted.locked), "no adjustment");
}

#[test]
fn no_adjustment_in_contact_steps_a_torque() {
    let mut table = String::new();
    for name in HAND_CONTROLLERS {
        let config = comparison::surrounded(&config(name), &scenario("contact_10s"));
        for mode in [CommandMode::Rate, CommandMode::Pose] {
            let start = pressed(&config, mode);
            let contact = start.last.f_s.force.norm();
            let [changed, taken_back] = [1.0, 2.0].map(|windows| PRESSED_S + windows * COMPARED_S);
            let alone = start.clone().until(taken_back);
            for (text, back) in ADJUSTMENTS {
                let mut rig = start.clone();
                if let Err(RequestError::Adjustment(refused)) = rig.adjust(text) {
                    assert!(matches!(refused, AdjustmentError::HoldsContact { .. }));
                    continue;
                }
                let first = rig.until(changed);
                rig.adjust(back).unwrap();
                let [there, again, alone] =
                    [first, rig.until(taken_back), alone].map(|share| 100.0 * share);
                let row = format!(
                    "{name} {mode:?} {contact:.1} N, {text}: {there:.2} %, {back}: {again:.2} %, neither: {alone:.2} %"
                );
                assert!(there.max(again) <= MAX_STEP_PERCENT, "{row}");
                table += &format!("{row}\n");
            }
        }
    }
    println!("{table}");
}
