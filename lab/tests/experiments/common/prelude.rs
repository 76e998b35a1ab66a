//! Imports of most tests, by `use crate::common::prelude::*;`.

pub(crate) use std::fs;
pub(crate) use std::path::{Path, PathBuf};
pub(crate) use std::process::Command;

pub(crate) use super::ROOT;
pub(crate) use super::bench::{script, started};
pub(crate) use super::cli::{folder, frhc};
pub(crate) use super::shipped::{JPL, KRAFT, KRAFT_500HZ, SIXR, changed, config};
pub(crate) use config::Config;
pub(crate) use node::record::{Mode, Record};
pub(crate) use testbench::bench::Bench;
pub(crate) use units::numbering::Joint;
