//! Tests of what a boot tries twice: a download without an answer, and a mode refused before the node is operational.

use canopen_rs::Value;

use super::*;
use crate::plan::ShownMode;

/// Number of writes of `object` that `device` has taken.
fn writes(device: &ScriptedDevice, object: Object) -> usize {
    device.written.iter().filter(|written| **written == object).count()
}

#[test]
fn download_without_an_answer_is_repeated_once() {
    let plan = elbow();
    let mut undisturbed = ScriptedDevice::suiting(&plan);
    assert!(boot(&plan, &mut undisturbed).0.is_ok());
    let cob_id = Object::tpdo_communication(1, 1);
    let repeated = [Object::CONTROLWORD, cob_id, Object::MAX_TORQUE, Object::MODE_OF_OPERATION];
    for object in repeated {
        let mut device = ScriptedDevice::suiting(&plan);
        device.loses_confirmations.push(object);
        let (outcome, took, _) = boot(&plan, &mut device);
        assert_eq!((outcome, took), (Ok(Configuration::Downloaded), REPLY_TIMEOUT), "{object}");
        assert_eq!(writes(&device, object), writes(&undisturbed, object) + 1, "{object}");
        device.loses_confirmations.extend([object; 2]);
        let message = format!("joint 3 (elbow), node 3: {object}: no answer");
        assert_eq!(failure(&plan, &mut device), message);
    }
}

#[test]
fn object_of_the_maker_and_save_are_never_written_twice() {
    let of_maker = Object { index: 0x2182, sub: 1 };
    let plan = NodePlan {
        stores_configuration: true,
        first_writes: vec![(of_maker, Value::Unsigned16(7))],
        ..elbow()
    };
    for object in [of_maker, Object::STORE_PARAMETERS] {
        let mut device = ScriptedDevice::suiting(&plan);
        device.objects.extend(stamp(&plan).map(|(object, _)| (object, vec![0; 4])));
        device.objects.insert(Object::STORE_PARAMETERS, vec![1, 0, 0, 0]);
        device.loses_confirmations.push(object);
        let message = format!("joint 3 (elbow), node 3: {object}: no answer");
        assert_eq!(failure(&plan, &mut device), message);
        assert_eq!(writes(&device, object), 1, "{object}");
    }
}

#[test]
fn only_a_mode_refused_in_this_state_waits_for_the_start() {
    let plan = elbow();
    for (code, is_awaited) in [
        (AbortCode::DEVICE_STATE, true),
        (AbortCode::VALUE_INVALID, false),
        (AbortCode::GENERAL_ERROR, false),
    ] {
        let mut device = ScriptedDevice::suiting(&plan);
        device.refuses.insert(Object::MODE_OF_OPERATION, code);
        let (mut boot, mut out) = (Boot::new(&plan), Vec::new());
        let outcome = loop {
            let now = boot.deadline().unwrap();
            let mut outcome = boot.on_time(now, &mut out);
            while let Some(answer) = out.pop().and_then(|frame| device.answer(&frame)) {
                outcome = outcome.or(boot.on_frame(now, &answer, &mut out));
            }
            if let Some(outcome) = outcome {
                break outcome;
            }
        };
        assert_eq!((outcome.is_ok(), boot.awaits_mode()), (is_awaited, is_awaited), "{code:?}");
    }
}

#[test]
fn other_objects_refused_in_this_state_fail_the_boot() {
    let plan = elbow();
    let mut device = ScriptedDevice::suiting(&plan);
    device.refuses.insert(Object::MAX_TORQUE, AbortCode::DEVICE_STATE);
    assert!(failure(&plan, &mut device).contains("6072h refused: 08000022h"));
}

#[test]
fn hidden_mode_is_read_back_under_a_reduced_torque_limit() {
    let reduced_limits = vec![(Object::MAX_TORQUE, Value::Unsigned16(50))];
    let plan = NodePlan { shown_mode: ShownMode::WhenEnabled { reduced_limits }, ..elbow() };
    let mut device = ScriptedDevice::suiting(&plan);
    device.objects.insert(Object::MODE_DISPLAY, vec![0]);
    assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
    assert_eq!(device.objects[&Object::MAX_TORQUE], [50, 0]);
    assert!(device.written.ends_with(&[Object::MAX_TORQUE, Object::MODE_OF_OPERATION]));
    let planned = plan.limits_to_raise();
    assert_eq!(planned.len(), 1);
    assert_ne!(planned[0].check.expected, Value::Unsigned16(50));

    device.forgets.push(Object::MODE_OF_OPERATION);
    device.objects.insert(Object::MODE_OF_OPERATION, vec![8]);
    let message = "joint 3 (elbow), node 3: 6060h is 08h, expected 0Ah";
    assert_eq!(failure(&plan, &mut device), message);
}
