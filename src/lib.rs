//! `frhc`: the CANopen master of a force-reflecting hand controller.
//!
//! ARCHITECTURE.md has the map: rack, bench and lab, and the rooms of each. This crate makes a program of the commands of the rack
//! ([`run`]) and those of simulation and bench (`cli`, the feature `simulation`).
//!
//! | to read about | crate |
//! |---|---|
//! | commands, console, recordings, exit codes | [`run`](../run/index.html), [`cli`](../cli/index.html) |
//! | status, summaries, fault records; inputs for a replay | [`telemetry`](../telemetry/index.html), [`inputs`](../inputs/index.html) |
//! | **one cycle from SYNC to torque**, bring-up, mode, causes of stops | [`node`](../node/index.html) |
//! | checked values of a configuration | [`config`](../config/index.html) |
//! | SocketCAN | [`bus`](../bus/index.html) |
//! | virtual object, link to a robot, the robot's arm, messages between both | [`remote`](../remote/index.html), [`robot`](../robot/index.html), [`contract`](../contract/index.html) |
//! | **the paper, one equation a file** | [`controller`](../controller/index.html) |
//! | master, SDO, PDO, NMT, EDS, CiA 402 | [`canopen`](../canopen/index.html) |
//! | wrench, twist, Jacobian, time | [`units`](../units/index.html) |
//! | simulated drives, arm and operator; node and simulation in one process; fault campaigns | [`sim`](../sim/index.html), [`testbench`](../testbench/index.html), [`campaign`](../campaign/index.html) |
#![forbid(unsafe_code)]

mod program;

pub use program::{LogArgs, conclude, init_log, main, print_usage};
