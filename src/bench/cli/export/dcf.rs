//! `frhc export dcf`: the configuration of each node as a DCF file, for other masters and configuration tools.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;
use clap::Args;

use canopen::eds::{Commissioning, Eds};
use canopen::frame::Channel;
use canopen::plan::NodePlan;
use canopen_tools::concise;
use canopen_tools::dcf::{self, DcfError};
use config::Config;
use run::config_arg::ConfigArg;
use run::exit::{Failure, Kind, OrFail};
use run::results::{self, Force};
use run::{print, stopping};

/// `frhc export dcf`.
#[derive(Debug, Args)]
pub struct Dcf {
    #[command(flatten)]
    config: ConfigArg,
    /// Folder of the files; created if absent.
    #[arg(short, long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    force: Force,
    /// Write concise DCFs (CiA 302-3, 1F22h) instead: binary, `.cdcf`.
    #[arg(long)]
    concise: bool,
}

/// File to write.
struct File {
    name: String,
    content: Vec<u8>,
}

/// Generates every file before writing the first.
pub(super) fn run(args: &Dcf) -> Result<(), Failure> {
    let config = Config::load(&args.config.config).or_fail(Kind::Configuration)?;
    let mut taken = HashSet::new();
    let mut files = Vec::new();
    for (node, (channel, plan)) in nodes(&config).into_iter().zip(config.node_plans()) {
        let name = file_name(&config, &node, channel, &plan, args.concise, &mut taken);
        let content = render(&config, &node, channel, &plan, &name, args.concise);
        let content =
            content.map_err(|error| format!("{}, node {}: {error}", plan.name, plan.node.raw()));
        let content = content.map_err(|error| Failure::new(Kind::Configuration, error))?;
        files.push(File { name, content });
    }
    write(&args.out, &files, args.force)?;
    stopping::cautions(&config).iter().for_each(|line| print::note(line));
    for file in &files {
        print::line(&args.out.join(&file.name).display().to_string());
    }
    Ok(())
}

/// Node's name and EDS.
struct Node<'a> {
    name: &'a str,
    eds: &'a Eds,
}

/// Returns the nodes in the order of the plans.
fn nodes(config: &Config) -> Vec<Node<'_>> {
    config.data_sheets().map(|(name, eds)| Node { name, eds }).collect()
}

fn render(
    config: &Config,
    node: &Node<'_>,
    channel: Channel,
    plan: &NodePlan,
    file_name: &str,
    is_concise: bool,
) -> Result<Vec<u8>, DcfError> {
    if is_concise {
        return Ok(concise::encode(&dcf::downloads(node.eds, plan)?));
    }
    let bus = config.buses.get(usize::from(channel.0));
    let commissioning = Commissioning {
        node: Some(plan.node),
        node_name: node.name.to_owned(),
        bitrate: bus.map(|bus| bus.bitrate / 1_000),
        network: Some(u32::from(channel.0) + 1),
        network_name: bus.map(|bus| bus.name.clone()).unwrap_or_default(),
        is_manager: false,
        serial: None,
    };
    dcf::write(node.eds, plan, &commissioning, file_name)
}

/// Returns `3_elbow.dcf`; appends the bus if the name is taken.
fn file_name(
    config: &Config,
    node: &Node<'_>,
    channel: Channel,
    plan: &NodePlan,
    is_concise: bool,
    taken: &mut HashSet<String>,
) -> String {
    let extension = if is_concise { "cdcf" } else { "dcf" };
    let name = format!("{}_{}", plan.node.raw(), plain(node.name));
    let short = format!("{name}.{extension}");
    if taken.insert(short.to_lowercase()) {
        return short;
    }
    let bus = config.buses.get(usize::from(channel.0)).map_or("", |bus| bus.name.as_str());
    let long = format!("{name}_{}_{}.{extension}", plain(bus), channel.0);
    taken.insert(long.to_lowercase());
    long
}

/// Replaces characters that are unsafe in file names.
fn plain(name: &str) -> String {
    let plain = |c: char| if c.is_alphanumeric() || c == '-' { c } else { '_' };
    name.chars().take(100).map(plain).collect()
}

/// Writes all files or, after a failure, none.
fn write(folder: &Path, files: &[File], force: Force) -> Result<(), Failure> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string()).or_fail(Kind::File)?;
    let files = files.iter().map(|file| (folder.join(&file.name), &file.content));
    results::export_all(&files.collect::<Vec<_>>(), force)
}
