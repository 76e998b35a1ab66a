//! The bounds of the gain checker against independently computed ones (`tests/oracles/stability.json`,
//! `ntrfc.json`): closed forms to rounding, searched suprema to a part in a million.
#![cfg(test)]

mod common;

use common::oracle;
use common::oracle::list;
use common::oracle::number;
use frhc::controller::stability::bounds;
use frhc::controller::stability::bounds::Held;
use frhc::controller::stability::bounds::Impedance;
use frhc::controller::stability::bounds::RateReflection;
use serde_json::Value;

/// Parts of the value by which a search may miss it.
const SEARCHED: f64 = 1e-5;

#[track_caller]
fn assert_close(ours: f64, reference: f64) {
    let off = (ours - reference).abs() / reference.abs().max(1e-9);
    assert!(off < SEARCHED, "{ours} is not {reference}");
}

fn cases(name: &str) -> Vec<Value> {
    list(&oracle::oracle("stability.json")[name]["cases"]).to_vec()
}

fn late(case: &Value) -> u32 {
    u32::try_from(case["delay_samples"].as_u64().unwrap()).unwrap()
}

#[test]
fn a_wall_of_spring_and_damper() {
    for case in cases("virtual_wall") {
        let wall = Impedance {
            stiffness: number(&case["K"]),
            damping: number(&case["B"]),
            ..Impedance::default()
        };
        let needed = wall.required_damping(number(&case["T"]));
        assert_close(needed, number(&case["b_required_formula"]));
    }
}

#[test]
fn a_spring_that_is_late() {
    for case in cases("spring_with_delay") {
        let spring =
            Impedance { stiffness: number(&case["K"]), late: late(&case), ..Impedance::default() };
        let needed = spring.required_damping(number(&case["T"]));
        assert_close(needed, number(&case["b_required_formula"]));
    }
}

#[test]
fn a_wall_with_filtered_velocity() {
    for case in cases("wall_filtered_velocity") {
        let wall = Impedance {
            stiffness: number(&case["K"]),
            damping: number(&case["B"]),
            filter: number(&case["tau"]),
            late: 0,
        };
        let needed = wall.required_damping(number(&case["T"]));
        assert_close(needed, number(&case["b_required_numeric"]));
    }
}

#[test]
fn encoder_steps() {
    for case in cases("quantisation") {
        let [b, period, friction, step] = ["b", "T", "fc", "Delta"].map(|key| number(&case[key]));
        let most = bounds::quantised_stiffness(b, period, friction, step);
        assert_close(most, number(&case["K_max"]));
    }
}

#[test]
fn the_slope_of_the_return_to_centre() {
    for case in cases("cfrtc_sampling") {
        let slope = Impedance { stiffness: number(&case["K_max"]), ..Impedance::default() };
        assert_close(slope.stiffness, 2.0 * number(&case["F0"]) / number(&case["DB"]));
        let needed = slope.required_damping(number(&case["T"]));
        assert_close(needed, number(&case["b_required"]));
    }
}

fn reflection(case: &Value) -> RateReflection {
    RateReflection {
        rate_gain: number(&case["K_V"]),
        wrench_gain: number(&case["K_T"]),
        accommodation: number(&case["K_FA"]),
        stiffness: number(&case["k_e"]),
    }
}

#[test]
fn reflection_in_rate_mode() {
    for case in cases("rate_mode_reflection_continuous") {
        let felt = reflection(&case).felt_stiffness();
        assert_close(felt, number(&case["felt_static_stiffness"]));
        let needed = reflection(&case).required_damping(0.0);
        assert_close(needed, number(&case["b_required_formula"]));
    }
    for case in cases("rate_mode_reflection_sampled") {
        let needed = reflection(&case).required_damping(number(&case["T"]));
        assert_close(needed, number(&case["b_required_formula"]));
    }
}

#[test]
fn a_hand_that_swings_with_the_object() {
    for case in cases("rate_mode_routh") {
        let [mass, damping, stiffness] = ["M", "b", "K_h"].map(|key| number(&case[key]));
        let [left, right] = reflection(&case).routh(&Held { mass, damping, stiffness });
        assert_eq!(left < right, case["routh_stable"].as_bool().unwrap(), "{case}");
    }
}

#[test]
fn accommodation_that_is_late() {
    for case in list(&oracle::oracle("ntrfc.json")["stability_bound"]["cases"]) {
        let limit = bounds::accommodation_limit(late(case));
        assert_close(limit, number(&case["max_KFA_ke_T"]));
    }
}
