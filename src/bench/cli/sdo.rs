//! `frhc sdo`: reads or writes one object of one node.

use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::Context;
use clap::{Args, Subcommand};

use crate::live_bus::objects::{self, ObjectError, Target};
use crate::live_bus::{BusArgs, ForceArg, NodeArg, SelectedBus, node_arg, parsers};
use canopen::NodeId;
use canopen::eds::{Eds, EdsObject};
use canopen::object::Object;
use canopen::sdo::{Block, Content, MAX_BYTES, SdoOptions};
use canopen_tools::value::gateway_type::GatewayType;
use canopen_tools::value::{self, Octets, Value};
use config::files;
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results::{self, Force};

/// `frhc sdo`.
#[derive(Debug, Args)]
#[command(
    after_help = "Types: b u8..u64 i8..i64 x8..x64 r32 r64 vs us os d t td (CiA 309-3); with an EDS that of the object.\n\n\
        An SDO server handles one transfer at a time: do not use this on a node while another master configures \
        it. `write` is refused while a master sends SYNC, unless --force is given: a running node detects a second \
        master and stops.\n\n\
        Examples:\n  frhc sdo read 3 6041 u16 -i can0\n  frhc sdo read elbow 1008 --config config/kraft_like.toml\n  \
        frhc sdo write 3 6071 i16 -100 --verify -i can0\n  frhc sdo write 3 1F50:1 d @firmware.bin --block -i can0"
)]
pub struct Sdo {
    #[command(subcommand)]
    task: Task,
    #[command(flatten)]
    bus: BusArgs,
    /// EDS of the node, for types and limits.
    #[arg(long, value_name = "FILE", global = true)]
    eds: Option<PathBuf>,
    /// Time allowed for each response of the node.
    #[arg(long, value_name = "MS", global = true, default_value_t = 500,
        value_parser = clap::value_parser!(u64).range(1..=600_000))]
    timeout: u64,
    /// Use block transfer if the node supports it: faster for long values.
    #[arg(long, global = true)]
    block: bool,
    /// Print the value as one JSON object.
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Task {
    /// Prints the value of an object; integers in decimal and hexadecimal.
    #[command(after_help = "Example:\n  frhc sdo read 3 6041 u16 -i can0")]
    Read {
        #[command(flatten)]
        place: Place,
        /// Data type [default: that of the EDS, or raw bytes].
        #[arg(value_name = "TYPE")]
        data_type: Option<GatewayType>,
        /// Write the bytes to this file instead of stdout.
        #[arg(short, long, value_name = "FILE", conflicts_with = "json")]
        out: Option<PathBuf>,
        #[command(flatten)]
        force: Force,
    },
    /// Writes a value to an object.
    #[command(after_help = "Example:\n  frhc sdo write 3 6071 i16 -100 --verify -i can0")]
    Write {
        #[command(flatten)]
        place: Place,
        /// Data type (optional with an EDS) and value; for os and d also @FILE, or - for stdin.
        #[arg(value_names = ["TYPE", "VALUE"], num_args = 1..=2, required = true, allow_negative_numbers = true)]
        value: Vec<String>,
        /// Read the value back and compare.
        #[arg(long)]
        verify: bool,
        #[command(flatten)]
        force: ForceArg,
    },
}

/// Node and object.
#[derive(Clone, Debug, Args)]
struct Place {
    /// Node-id 1 to 127, decimal or as 0x10; with a configuration also the name of a joint.
    #[arg(value_parser = node_arg::node)]
    node: NodeArg,
    /// Object as INDEX or INDEX:SUB with the index in hexadecimal: 6041, 0x1018:4 or 1A00sub1.
    #[arg(value_parser = parsers::object)]
    object: Object,
}

/// Reads or writes one object. Rejects an invalid value before opening the bus.
pub(super) fn run(args: &Sdo) -> Result<(), Failure> {
    let Place { node, object } = match &args.task {
        Task::Read { place, .. } | Task::Write { place, .. } => place,
    };
    let bus = args.bus.select_for([node])?;
    let own = args.eds.as_deref().map(load).transpose()?;
    let node = bus.node(node)?;
    let eds = own.as_ref().or_else(|| bus.eds(node));
    let described = eds.and_then(|eds| eds.object(*object));
    let described_type = described.and_then(|object| GatewayType::of_number(object.data_type));
    let timeout = Duration::from_millis(args.timeout);
    // The session queues frames that the driver does not accept, so no pause between them is needed.
    let block = Block::default().every(Duration::ZERO);
    let options =
        if args.block { SdoOptions::best(timeout, block) } else { SdoOptions::segmented(timeout) };
    let target = Target { node, object: *object, options };
    match &args.task {
        Task::Read { data_type, out, force, .. } => {
            out.as_deref().map_or(Ok(()), |path| results::ensure_free(path, *force))?;
            let data_type = data_type.or(described_type).unwrap_or(GatewayType::Domain);
            let mut session = bus.open()?;
            let content = objects::read(&mut session, target).map_err(|error| fail(&bus, error))?;
            if let Some(path) = out {
                return results::export(path, content.bytes(), *force);
            }
            let bytes = trimmed(&content, data_type);
            let read = data_type.decode(bytes).map_err(|error| {
                let Target { node, object, .. } = target;
                Failure::new(Kind::Drive, format!("node {}: {object}: {error}", node.raw()))
            })?;
            show(args.json, target, data_type, &read, bytes);
        }
        Task::Write { value, verify, force, .. } => {
            let (data_type, text) = parse_type(value, described_type)?;
            let value = parse_value(data_type, text)?;
            check_limits(text, &value, described, node)?;
            let bytes = data_type.encode(&value);
            if bytes.len() > MAX_BYTES {
                let reason =
                    format!("value must have at most {MAX_BYTES} bytes, got {}", bytes.len());
                return Err(Failure::new(Kind::Usage, reason));
            }
            let mut session = bus.open_to_command(*force)?;
            let written = objects::write(&mut session, target, &bytes, *verify);
            written.map_err(|error| fail(&bus, error))?;
            if args.json {
                show(true, target, data_type, &value, &bytes);
            }
        }
    }
    Ok(())
}

/// Converts the error to a failure of the bus or of the node.
fn fail(bus: &SelectedBus, error: ObjectError) -> Failure {
    match error {
        ObjectError::Session(error) => bus.fail(error),
        ObjectError::Node { .. } | ObjectError::Differs { .. } => Failure::new(Kind::Drive, error),
    }
}

fn load(path: &Path) -> Result<Eds, Failure> {
    let name = || path.display().to_string();
    let bytes = files::read(path).with_context(name).or_fail(Kind::Configuration)?;
    Eds::parse(&bytes).with_context(name).or_fail(Kind::Configuration)
}

/// Returns the valid bytes: those of the type, for an expedited response without size, which has four.
fn trimmed(content: &Content, data_type: GatewayType) -> &[u8] {
    let sized = data_type.size().and_then(|size| content.exactly(size));
    sized.unwrap_or_else(|| content.bytes())
}

/// Parses `TYPE VALUE`, or `VALUE` of the type in the EDS.
fn parse_type(
    arguments: &[String],
    described: Option<GatewayType>,
) -> Result<(GatewayType, &str), Failure> {
    match arguments {
        [data_type, value] => {
            let data_type = data_type.parse().or_fail(Kind::Usage)?;
            Ok((data_type, value))
        }
        [value] => {
            let unknown = || {
                Failure::new(
                    Kind::Usage,
                    "unknown type of the object: give TYPE VALUE, or an EDS with --eds",
                )
            };
            Ok((described.ok_or_else(unknown)?, value))
        }
        _ => Err(Failure::new(Kind::Usage, "expected TYPE VALUE")),
    }
}

/// Maximum length of a file to write, in bytes; the same as [`MAX_BYTES`].
const MAX_FILE_BYTES: u64 = 16 << 20;

/// Parses the value; reads one of a byte type from a file or stdin.
fn parse_value(data_type: GatewayType, text: &str) -> Result<Value, Failure> {
    let is_bytes = matches!(data_type, GatewayType::OctetString | GatewayType::Domain);
    match text.strip_prefix('@') {
        Some(path) if is_bytes => {
            let bytes =
                files::open(path.as_ref()).and_then(|file| files::at_most(MAX_FILE_BYTES, file));
            bytes.with_context(|| path.to_owned()).or_fail(Kind::File).map(Value::Bytes)
        }
        None if is_bytes && text == "-" => {
            let bytes = files::at_most(MAX_FILE_BYTES, std::io::stdin().lock());
            bytes.context("stdin").or_fail(Kind::File).map(Value::Bytes)
        }
        Some(_) | None => {
            let value = data_type.parse(text);
            value.with_context(|| data_type.to_string()).or_fail(Kind::Usage)
        }
    }
}

/// Checks the value against the limits in the EDS (CiA 306), if present.
fn check_limits(
    text: &str,
    value: &Value,
    described: Option<&EdsObject>,
    node: NodeId,
) -> Result<(), Failure> {
    let (Value::Whole(number), Some(object)) = (value, described) else { return Ok(()) };
    let has_limits = object.low.is_some() || object.high.is_some();
    let Some(limits) = object.limits(node).filter(|_| has_limits) else { return Ok(()) };
    let (low, high) = limits.into_inner();
    let name = || format!("{} ({})", object.object, object.name);
    value::within(text, *number, low, high).with_context(name).or_fail(Kind::Usage).map(|_| ())
}

/// Prints an integer as `1591 0x0637`, texts and bytes unchanged.
fn show(json: bool, target: Target, data_type: GatewayType, value: &Value, bytes: &[u8]) {
    if json {
        let report = serde_json::json!({
            "node": target.node.raw(),
            "index": target.object.index,
            "sub": target.object.sub,
            "type": data_type.to_string(),
            "value": of_json(value),
            "bytes": Octets(bytes).to_string(),
        });
        print::line(&report.to_string());
        return;
    }
    match value {
        Value::Whole(_) => {
            let digits: String = bytes.iter().rev().map(|byte| format!("{byte:02X}")).collect();
            print::line(&format!("{value} 0x{digits}"));
        }
        Value::Pattern(number, _) => print::line(&format!("{value} {number}")),
        Value::Boolean(_)
        | Value::Real32(_)
        | Value::Real64(_)
        | Value::Text(_)
        | Value::Bytes(_)
        | Value::Time(_) => print::line(&value.to_string()),
    }
}

/// Converts to JSON. Integers beyond 64 bits become strings.
fn of_json(value: &Value) -> serde_json::Value {
    match value {
        Value::Boolean(is) => serde_json::json!(is),
        Value::Whole(number) => match (i64::try_from(*number), u64::try_from(*number)) {
            (Ok(number), _) => serde_json::json!(number),
            (Err(_), Ok(number)) => serde_json::json!(number),
            (Err(_), Err(_)) => serde_json::json!(number.to_string()),
        },
        Value::Pattern(number, _) => serde_json::json!(number),
        Value::Real32(number) => serde_json::json!(number),
        Value::Real64(number) => serde_json::json!(number),
        Value::Text(_) | Value::Bytes(_) | Value::Time(_) => serde_json::json!(value.to_string()),
    }
}
