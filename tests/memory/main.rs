//! Tests of node, master and drives on the in-memory bus, and of the pure rooms: they start no process and open no socket.
#![allow(
    clippy::expect_used,
    clippy::float_cmp,
    clippy::indexing_slicing,
    clippy::panic,
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "what a test cannot do without has failed the test; figures are to be seen"
)]

#[path = "../common/mod.rs"]
mod common;

mod adjustments;
mod arm_course;
mod arms;
mod boot;
mod boot_variants;
mod both_kinds;
mod bus_hazards;
mod campaign;
mod changed_gains;
mod config;
mod config_sections;
mod control_events;
mod control_law;
mod controller_steps;
mod coupling;
mod cycle_thread;
mod delayed_link;
mod disarm_answer;
mod drive_hazards;
mod energy;
mod far_pump;
mod far_side;
mod far_side_fit;
mod far_side_replay;
mod faults;
mod friction_sweep;
mod gain_sets;
mod golden;
mod gripper;
mod held_torque;
mod hold;
mod homing;
mod hostile_link;
mod late_torques;
mod link;
mod link_age;
mod linked_node;
mod lossy;
mod lss;
mod mode_check;
mod model;
mod net_ft;
mod no_switch_box;
mod operator;
mod operators;
mod oracles;
mod other_clients;
mod plausibility;
mod position_scale;
mod power_off;
mod proof_replies;
mod quirks;
mod real_drives;
mod recorder_rings;
mod robot_site;
mod robots;
mod scenarios;
mod sdo;
mod sdo_queue;
mod stated;
mod status_keys;
mod stiff_wall;
mod stop_times;
mod stored_offsets;
mod telemetry;
mod teleoperation;
mod torque_curve;
mod trial;
mod worked_example;
mod wrong_facts;
mod zero;
