//! PDO mapping that the node does not let be written.

use super::*;
use crate::layout::MAPPINGS;

/// Returns a node with the mapping of `plan`, which refuses every write of it.
fn fixed(plan: &NodePlan, code: AbortCode) -> ScriptedDevice {
    let mut device = ScriptedDevice::suiting(plan);
    for (object, value) in plan.pdos.iter().flat_map(|pdo| pdo.writes()) {
        if MAPPINGS.iter().any(|indices| indices.contains(&object.index)) {
            // The last value counts: the number of entries.
            device.objects.insert(object, bytes(&value));
            device.refuses.insert(object, code);
        }
    }
    device
}

#[test]
fn fixed_mapping_as_planned_is_accepted() {
    for plan in [elbow(), switch_box()] {
        for code in [AbortCode::READ_ONLY, AbortCode::GENERAL_ERROR] {
            let mut device = fixed(&plan, code);
            assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
            let is_mapping = |object: &&Object| MAPPINGS[1].contains(&object.index);
            assert_eq!(device.written.iter().find(is_mapping), None);
            let cob_ids: Vec<_> = plan.pdos.iter().flat_map(|pdo| pdo.writes().pop()).collect();
            for (object, value) in cob_ids {
                assert_eq!(device.objects[&object], bytes(&value), "{object} is written");
            }
        }
    }
}

#[test]
fn fixed_mapping_of_other_objects_is_refused_with_both_values() {
    let plan = elbow();
    let mut device = fixed(&plan, AbortCode::READ_ONLY);
    device.objects.insert(Object::tpdo_mapping(1, 2), vec![0x10, 0, 0x78, 0x60]);
    let refused = "joint 3 (elbow), node 3: 1A00h refused: 06010002h object is read only; ";
    let remedy = ": choose a layout that the device has";
    let differs = "1A00h:2 is 60780010h, expected 60640020h";
    assert_eq!(failure(&plan, &mut device), format!("{refused}{differs}{remedy}"));
    let mut device = fixed(&plan, AbortCode::READ_ONLY);
    device.objects.insert(Object::tpdo_mapping(1, 0), vec![2]);
    let differs = "1A00h is 02h, expected 03h";
    assert_eq!(failure(&plan, &mut device), format!("{refused}{differs}{remedy}"));
    let mut device = fixed(&plan, AbortCode::READ_ONLY);
    device.objects.remove(&Object::tpdo_mapping(1, 2));
    let absent = "1A00h:2 refused: 06020000h object does not exist";
    assert_eq!(failure(&plan, &mut device), format!("{refused}{absent}{remedy}"));
}
