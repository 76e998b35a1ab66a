//! The program as a user runs it: command lines, files, output and exit codes.
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

mod bench_tools;
mod calib;
mod calib_friction;
mod calib_table;
mod config_merge;
mod dcf;
mod decode;
mod documented;
mod eds;
mod eds_check;
mod eds_damaged;
mod ended;
mod explain;
mod exports;
mod gain_check;
mod irregular_files;
mod layouts;
mod long_work;
mod measure;
mod measure_sign;
mod messages;
mod no_switch_box;
mod orderly_stop;
mod plan;
mod readme;
mod refused;
mod refused_eds;
mod replay;
mod report;
mod robot_process;
mod robot_refused;
mod robot_sensor;
mod robots;
mod sessions;
mod shown_demo;
mod signals;
mod stability;
mod stated;
mod terminal;
mod view;
mod walls;
