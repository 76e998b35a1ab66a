//! Device configuration files (DCF, CiA 306, 5): the EDS of one device with the values of a [`NodePlan`].
//!
//! The same plan as a list of writes is the device's concise DCF.

use std::collections::BTreeMap;

use canopen_rs::Value;
use thiserror::Error;

use crate::concise::Download;
use crate::sheet::Sheet;
use canopen::data_type;
use canopen::eds::{Commissioning, Eds, OutsideLimits, value};
use canopen::object::Object;
use canopen::plan::NodePlan;
use canopen::sdo::bytes;
use canopen::setting::Setting;

/// Error of a plan that a device cannot hold, by its EDS.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum DcfError {
    /// Planned object that the device lacks.
    #[error("{0} is not in the EDS")]
    Unknown(Object),
    /// Planned value of another length than the object's.
    #[error("{object} has {planned} bytes in the plan, but is {described} in the EDS")]
    Length {
        object: Object,
        /// Length of the planned value, in bytes.
        planned: usize,
        /// Data type in the EDS.
        described: &'static str,
    },
    /// Planned value outside the object's limits.
    #[error(transparent)]
    OutOfRange(#[from] OutsideLimits),
}

/// Writes the DCF of the device at `plan.node` for a file `file_name`. Dates are those of the EDS, so that one plan
/// always gives the same bytes.
///
/// # Errors
/// Returns an error if the device cannot hold the plan.
pub fn write(
    eds: &Eds,
    plan: &NodePlan,
    commissioning: &Commissioning,
    file_name: &str,
) -> Result<Vec<u8>, DcfError> {
    let mut sheet = Sheet::from_eds(eds);
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
    let planned = plan.settings();
    for (object, content) in settings(eds, plan)? {
        let text = text(eds, object, &content)?;
        let setting = planned.iter().find(|setting| setting.check.object == object);
        let described = eds.object(object).ok_or(DcfError::Unknown(object))?;
        match described.check_content(&content, plan.node) {
            Err(outside) if setting.is_none_or(Setting::fails_beyond_limits) => {
                return Err(outside.into());
            }
            // An erroneous limit of the data sheet, with which other tools would refuse the value.
            Err(_) => sheet.drop_limits(object),
            Ok(()) => {}
        }
        sheet.set_value(object, &text, eds.objects());
    }
    Ok(sheet.write())
}

/// Returns the writes of a plan, in order: the content of a concise DCF.
///
/// # Errors
/// Returns an error if the device lacks an object.
pub fn downloads(eds: &Eds, plan: &NodePlan) -> Result<Vec<Download>, DcfError> {
    let mut downloads = Vec::new();
    let mode = plan.mode.map(|mode| (Object::MODE_OF_OPERATION, Value::Integer8(mode)));
    let settings = plan
        .settings()
        .into_iter()
        .map(|Setting { check, need }| ((check.object, check.expected), need.is_must()));
    for ((object, value), is_must) in settings.chain(mode.map(|mode| (mode, true))) {
        if eds.object(object).is_some() {
            downloads.push(Download { object, content: bytes(&value) });
        } else if is_must {
            return Err(DcfError::Unknown(object));
        }
    }
    Ok(downloads)
}

/// Returns the final value of each object.
fn settings(eds: &Eds, plan: &NodePlan) -> Result<BTreeMap<Object, Vec<u8>>, DcfError> {
    let downloads = downloads(eds, plan)?.into_iter();
    Ok(downloads.map(|Download { object, content }| (object, content)).collect())
}

/// Formats a value by the data type of the EDS.
fn text(eds: &Eds, object: Object, content: &[u8]) -> Result<String, DcfError> {
    let described = eds.object(object).ok_or(DcfError::Unknown(object))?;
    let planned = content.len();
    let data_type = data_type::find(described.data_type);
    let data_type =
        data_type.ok_or(DcfError::Length { object, planned, described: "of an unknown type" })?;
    let wrong = DcfError::Length { object, planned, described: data_type.name };
    value::text(content, &data_type).ok_or(wrong)
}

#[cfg(test)]
mod tests {
    use super::*;
    use canopen::NodeId;
    use canopen::testing::plans::{elbow, switch_box};

    const DRIVE: &str = include_str!("../../../eds/frhc_drive.eds");

    fn parse(text: &str) -> Eds {
        Eds::parse(text.as_bytes()).unwrap()
    }

    fn written(eds: &Eds, plan: &NodePlan) -> Result<Eds, DcfError> {
        let name =
            Commissioning { node_name: "elbow\r\n[2000]".into(), ..Commissioning::default() };
        Ok(Eds::parse(&write(eds, plan, &name, "3_elbow.dcf")?).unwrap())
    }

    #[test]
    fn dcf_holds_the_final_values() {
        let plan = elbow();
        let dcf = written(&parse(DRIVE), &plan).unwrap();
        let value = |object| dcf.object(object).unwrap().setting.value.as_deref();
        assert_eq!(value(Object::rpdo_communication(1, 1)), Some("0x00000203"), "on in the end");
        assert_eq!(value(Object::rpdo_communication(2, 1)), Some("0x80000303"));
        assert_eq!(value(Object::rpdo_mapping(1, 0)), Some("0x02"));
        assert_eq!(value(Object::MODE_OF_OPERATION), Some("10"));
        assert_eq!(value(Object::CONTROLWORD), None, "a command is no setting");
        assert_eq!(value(Object::DEVICE_TYPE), None);
        assert_eq!(dcf.commissioning().unwrap().node, Some(plan.node));
    }

    #[test]
    fn name_cannot_break_its_line() {
        let dcf = written(&parse(DRIVE), &elbow()).unwrap();
        assert_eq!(dcf.commissioning().unwrap().node_name, "elbow  [2000]");
        assert_eq!(dcf.objects().len(), parse(DRIVE).objects().len());
    }

    #[test]
    fn compact_pdos_are_expanded() {
        let is_pdo = |section: &&str| {
            !["14", "16", "18", "1A"].iter().any(|index| section.starts_with(index))
        };
        let sections: Vec<_> = DRIVE.split("\n[").filter(is_pdo).collect();
        let text = sections.join("\n[").replace("Granularity=8", "Granularity=8\nCompactPDO=0x2E");
        let (eds, plan) = (parse(&text), elbow());
        let dcf = written(&eds, &plan).unwrap();
        let identities = |eds: &Eds| {
            let one =
                |one: &canopen::eds::EdsObject| (one.object, one.data_type, one.access, one.number);
            eds.objects().iter().map(one).collect::<Vec<_>>()
        };
        assert_eq!(identities(&dcf), identities(&eds));
        let configured = |object| dcf.object(object).unwrap().configured(plan.node);
        assert_eq!(configured(Object::tpdo_communication(1, 1)), Some(vec![0x83, 1, 0, 0]));
        assert_eq!(configured(Object::tpdo_mapping(1, 2)), Some(vec![0x20, 0, 0x64, 0x60]));
    }

    #[test]
    fn compact_arrays_stay_compact() {
        let (before, rest) = DRIVE.split_once("[1016]").unwrap();
        let (_, behind) = rest.split_once("[1017]").unwrap();
        let text = format!(
            "{before}[1016]\nObjectType=8\nDataType=7\nAccessType=rw\nCompactSubObj=4\n\n[1017]{behind}"
        );
        let plan = elbow();
        let dcf = written(&parse(&text), &plan).unwrap();
        let watch = dcf.object(Object::CONSUMER_HEARTBEAT).unwrap();
        assert_eq!(watch.configured(plan.node), Some(vec![22, 0, 0x7F, 0]));
        assert_eq!(
            dcf.object(Object { sub: 2, ..watch.object }).unwrap().configured(plan.node),
            None
        );
    }

    #[test]
    fn value_the_device_cannot_hold_is_refused() {
        let refusal = |from: &str, to: &str| {
            assert!(DRIVE.contains(from));
            written(&parse(&DRIVE.replacen(from, to, 1)), &elbow()).unwrap_err().to_string()
        };
        assert_eq!(refusal("[6072]", "[2072]"), "6072h is not in the EDS");
        let heartbeat = "Producer heartbeat time\nObjectType=0x7\nDataType=0x000";
        assert_eq!(
            refusal(&format!("{heartbeat}6"), &format!("{heartbeat}7")),
            "1017h has 2 bytes in the plan, but is UNSIGNED32 in the EDS"
        );
        let torque = "LowLimit=0\nHighLimit=3000";
        assert_eq!(
            refusal(torque, "LowLimit=0\nHighLimit=999"),
            "6072h must be within 0..=999 of the EDS, got 1000"
        );
    }

    #[test]
    fn absent_pdo_need_not_be_disabled() {
        let eds = parse(include_str!("../../../eds/frhc_switches.eds"));
        let downloads = downloads(&eds, &switch_box()).unwrap();
        assert!(downloads.iter().all(|download| eds.object(download.object).is_some()));
        let node = NodeId::new(16).unwrap();
        assert_eq!(written(&eds, &switch_box()).unwrap().commissioning().unwrap().node, Some(node));
    }
}
