//! The program as a user runs it: command lines, files, output and exit codes.

#[path = "../common/mod.rs"]
mod common;

mod bench_tools;
mod calib;
mod calib_friction;
mod calib_table;
mod decode;
mod documented;
mod eds;
mod ended;
mod experiments;
mod explain;
mod exports;
mod layouts;
mod long_work;
mod messages;
mod no_switch_box;
mod plan;
mod readme;
mod refused;
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
