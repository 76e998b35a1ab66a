//! Device configuration files (CiA 306, 5): the EDS of one device, and in it what a
//! [`NodePlan`] leaves it with.
//!
//! The same plan as a list of writes, in order, is the device's concise DCF.

use std::collections::BTreeMap;

use thiserror::Error;

use crate::canopen::concise::Download;
use crate::canopen::data_type;
use crate::canopen::eds::Commissioning;
use crate::canopen::eds::Eds;
use crate::canopen::eds::value;
use crate::canopen::object::Object;
use crate::canopen::plan;
use crate::canopen::plan::Action;
use crate::canopen::plan::Check;
use crate::canopen::plan::NodePlan;
use crate::canopen::plan::Step;

/// Why a plan is none for the device an EDS describes.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum DcfError {
    /// The device has no such object.
    #[error("{0} is not in the EDS")]
    Unknown(Object),
    /// It has another length there.
    #[error("{object} has {planned} bytes here, but is {described} in the EDS")]
    Length {
        /// Where.
        object: Object,
        /// Bytes of the value.
        planned: usize,
        /// Its data type by the EDS.
        described: &'static str,
    },
    /// It does not take that value.
    #[error("{object} = {value} is not within {low} and {high} of the EDS")]
    OutOfRange {
        /// Where.
        object: Object,
        /// What it is to hold.
        value: i128,
        /// The least it takes.
        low: i128,
        /// The most it takes.
        high: i128,
    },
}

/// The DCF of the device at `plan.node`, a file called `file_name`. Dates are those of the EDS: the
/// same plan gives the same bytes.
///
/// # Errors
/// When the device cannot hold what the plan says.
pub fn write(
    eds: &Eds,
    plan: &NodePlan,
    commissioning: &Commissioning,
    file_name: &str,
) -> Result<Vec<u8>, DcfError> {
    let mut sheet = eds.sheet();
    if let Some(last) = sheet.file_info("FileName").map(str::to_owned) {
        sheet.set_file_info("LastEDS", &last);
    }
    sheet.set_file_info("FileName", file_name);
    sheet.set_file_info("ModifiedBy", "frhc");
    let mut set = |key, value: Option<String>| {
        if let Some(value) = value {
            sheet.set_commissioning(key, &value);
        }
    };
    let named = |name: &String| Some(name.clone()).filter(|name| !name.is_empty());
    set("NodeID", Some(format!("0x{:02X}", plan.node.raw())));
    set("NodeName", named(&commissioning.node_name));
    set("Baudrate", commissioning.bitrate.map(|rate| rate.to_string()));
    set("NetNumber", commissioning.network.map(|number| number.to_string()));
    set("NetworkName", named(&commissioning.network_name));
    set("CANopenManager", Some(u8::from(commissioning.is_manager).to_string()));
    set("LSS_SerialNumber", commissioning.serial.map(|serial| format!("0x{serial:08X}")));
    for (object, content) in settings(eds, plan)? {
        sheet.set_value(object, &text(eds, object, &content)?, eds.objects());
    }
    Ok(sheet.write())
}

/// Every write of a plan, in order: what a concise DCF holds.
///
/// # Errors
/// When the device lacks an object.
pub fn downloads(eds: &Eds, plan: &NodePlan) -> Result<Vec<Download>, DcfError> {
    let mut downloads = Vec::new();
    for step in plan.steps() {
        let (must_exist, check) = match step {
            Step::Object(Action::Write, check) => (true, check),
            Step::Object(Action::SwitchOff, check) => (false, check),
            Step::Object(Action::Meet | Action::Compare | Action::Await, _)
            | Step::ResetCommunication => continue,
        };
        let Check { object, expected, .. } = check;
        if eds.object(object).is_some() {
            downloads.push(Download { object, content: plan::bytes(&expected) });
        } else if must_exist {
            return Err(DcfError::Unknown(object));
        }
    }
    Ok(downloads)
}

/// What each object holds in the end. Commands are no settings: the controlword is left out.
fn settings(eds: &Eds, plan: &NodePlan) -> Result<BTreeMap<Object, Vec<u8>>, DcfError> {
    let downloads = downloads(eds, plan)?.into_iter();
    let lasting = downloads.filter(|download| download.object != Object::CONTROLWORD);
    Ok(lasting.map(|Download { object, content }| (object, content)).collect())
}

/// A value as the EDS's data type has it written.
fn text(eds: &Eds, object: Object, content: &[u8]) -> Result<String, DcfError> {
    let described = eds.object(object).ok_or(DcfError::Unknown(object))?;
    let planned = content.len();
    let data_type = data_type::of(described.data_type);
    let data_type =
        data_type.ok_or(DcfError::Length { object, planned, described: "of an unknown type" })?;
    let wrong = DcfError::Length { object, planned, described: data_type.name };
    let text = value::text(content, &data_type).ok_or(wrong)?;
    if let Some(range) = data_type.range()
        && let Ok(number) = value::number(&text, &data_type)
    {
        let low = described.low.unwrap_or(*range.start());
        let high = described.high.unwrap_or(*range.end());
        if !(low..=high).contains(&number.value) {
            return Err(DcfError::OutOfRange { object, value: number.value, low, high });
        }
    }
    Ok(text)
}
