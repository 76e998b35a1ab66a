//! Imports of most tests, by `use crate::common::prelude::*;`.
#![allow(unused_imports, reason = "each test binary uses a part of this")]

pub(crate) use std::fs;
pub(crate) use std::path::{Path, PathBuf};
pub(crate) use std::process::{Command, Stdio};
pub(crate) use std::time::Duration;

pub(crate) use serde_json::Value;

pub(crate) use super::bench::{MS, Wire, bench_of, scenario, script, started, until};
pub(crate) use super::cli::{CommandOutput, folder, frhc};
pub(crate) use super::process::{Candump, Process, Scratch};
pub(crate) use super::shipped::{
    ELBOW, JPL, KRAFT, KRAFT_500HZ, KRAFT_500HZ_TEXT, KRAFT_TEXT, PUMA, SIXR, changed, config,
    in_each_joint, parse, refusal, text,
};
pub(crate) use bus::Bus;
pub(crate) use canopen::NodeId;
pub(crate) use canopen::drive::State;
pub(crate) use canopen::eds::Eds;
pub(crate) use canopen::frame::{Channel, Frame, Telegram};
pub(crate) use canopen::master::event::Event;
pub(crate) use canopen::object::Object;
pub(crate) use config::Config;
pub(crate) use config::shipped::HAND_CONTROLLERS;
pub(crate) use memory_bus::Memory;
pub(crate) use node::Request;
pub(crate) use node::cause::Cause;
pub(crate) use node::record::{Mode, Record};
pub(crate) use sim::quirks::Quirk;
pub(crate) use sim::scenario::Scenario;
pub(crate) use sim::world::World;
pub(crate) use testbench::bench::Bench;
pub(crate) use testbench::world;
pub(crate) use units::numbering::Joint;
pub(crate) use units::spatial::{Motion, Twist, Wrench};
pub(crate) use units::time::Instant;
