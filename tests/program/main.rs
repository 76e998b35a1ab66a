//! The program as a user starts it: command lines, files, exit codes, what it prints.

#[path = "../common/mod.rs"]
mod common;

mod bench_tools;
mod calib;
mod decode;
mod eds;
mod ended;
mod explain;
mod plan;
mod readme;
mod refused;
mod stability;
mod terminal;
