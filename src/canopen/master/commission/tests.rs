//! Tests of the boot of one node, against a scripted device.

mod fixed_mapping;
mod repetitions;
mod second_tries;

use canopen_rs::ByteString;
use proptest::prelude::*;

use super::*;
use crate::abort::AbortCode;
use crate::master::disturbance::MAX_REPEATS;
use crate::nameplate::position_scale::PositionScale;
use crate::nameplate::units::{SiUnit, Units};
use crate::nameplate::{Nameplate, Rating, Ratio};
use crate::plan::{BOOT_TIMEOUT, REPLY_TIMEOUT, Revisions, Timeouts};
use crate::setting::OFFSETS;
use crate::testing::plans::{elbow, guarded_elbow, switch_box};
use crate::testing::scripted::{ScriptedDevice, first_boot, stamp};

/// Boots `device` by `plan`. Returns the outcome, the duration, and all frames the master sent.
fn boot(plan: &NodePlan, device: &mut ScriptedDevice) -> (BootOutcome, Duration, Vec<Frame>) {
    disturbed(plan, device, |_| None)
}

/// Boots `device` as [`boot`] does. Another client disturbs each request for which `reply` returns a reply, which the
/// master gets in place of that of the device.
fn disturbed(
    plan: &NodePlan,
    device: &mut ScriptedDevice,
    mut reply: impl FnMut(&Frame) -> Option<Frame>,
) -> (BootOutcome, Duration, Vec<Frame>) {
    let mut boot = Boot::new(plan);
    let (mut sent, mut queue) = (Vec::new(), Vec::new());
    loop {
        let now = boot.deadline().expect("a boot without an outcome has a deadline");
        let mut outcome = boot.on_time(now, &mut queue);
        while !queue.is_empty() {
            let frame = queue.remove(0);
            sent.push(frame);
            assert!(sent.len() < 5_000, "the boot does not end");
            let answer = match reply(&frame) {
                Some(reply) => {
                    boot.on_foreign_request(&frame);
                    Some(reply)
                }
                None => device.answer(&frame),
            };
            for received in answer.into_iter().chain([device.heartbeat(device.state)]) {
                outcome = outcome.or(boot.on_frame(now, &received, &mut queue));
            }
        }
        if let Some(outcome) = outcome {
            assert_eq!(boot.deadline(), None);
            return (outcome, now.since(Instant::ZERO), sent);
        }
    }
}

fn failure(plan: &NodePlan, device: &mut ScriptedDevice) -> String {
    boot(plan, device).0.expect_err("a failure").to_string()
}

#[test]
fn suitable_node_boots_exactly_as_planned() {
    for plan in [elbow(), switch_box()] {
        let mut device = ScriptedDevice::suiting(&plan);
        let (outcome, ..) = boot(&plan, &mut device);
        assert_eq!(outcome, Ok(Configuration::Downloaded));
        for (object, value) in plan.pdos.iter().flat_map(|pdo| pdo.writes().pop()) {
            assert_eq!(device.objects[&object], bytes(&value), "{object}");
        }
        for (object, value) in &plan.safety {
            assert_eq!(device.objects[object], bytes(value), "{object}");
        }
        assert_eq!(device.objects[&Object::PRODUCER_HEARTBEAT], [25, 0]);
    }
}

#[test]
fn moved_emcy_cob_id_is_disabled_then_set() {
    let plan = NodePlan { emcy_cob_id: 0x683, ..elbow() };
    let mut device = ScriptedDevice::suiting(&plan);
    assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
    assert_eq!(device.objects[&Object::EMCY_COB_ID], [0x83, 0x06, 0, 0]);
    let writes = device.written.iter().filter(|object| **object == Object::EMCY_COB_ID);
    assert_eq!(writes.count(), 2);
}

#[test]
fn stored_configuration_is_read_and_not_written() {
    for plan in [elbow(), switch_box(), guarded_elbow()] {
        let mut device = ScriptedDevice::holding(&plan);
        assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Skipped), "{}", plan.name);
        let commands = [Object::CONTROLWORD, Object::MODE_OF_OPERATION];
        let commands = if plan.is_drive() { &commands[..] } else { &[] };
        assert_eq!(device.written, commands);
    }
}

#[test]
fn wrong_or_absent_stamp_downloads_again() {
    let plan = elbow();
    for object in [Object::CONFIGURATION_DATE, Object::CONFIGURATION_TIME] {
        let mut device = ScriptedDevice::holding(&plan);
        device.objects.get_mut(&object).unwrap()[1] ^= 1;
        assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
        let mut device = ScriptedDevice::holding(&plan);
        device.objects.remove(&object);
        assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
    }
}

#[test]
fn stamp_with_one_wrong_value_downloads_again() {
    let plan = elbow();
    for (object, _) in plan.writes() {
        let mut device = ScriptedDevice::holding(&plan);
        device.objects.get_mut(&object).unwrap()[0] ^= 0x11;
        let is_off = plan.pdos.iter().any(|p| p.service.is_none() && p.communication(1) == object);
        let expected = if is_off { Configuration::Skipped } else { Configuration::Downloaded };
        assert_eq!(boot(&plan, &mut device).0, Ok(expected), "{object}");
    }
}

#[test]
fn configuration_is_stored_if_planned_and_supported() {
    let plan = NodePlan { stores_configuration: true, ..elbow() };
    let mut device = ScriptedDevice::suiting(&plan);
    assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded), "it has no 1020h");
    device.objects.extend(stamp(&plan).map(|(object, _)| (object, vec![0; 4])));
    device.objects.insert(Object::STORE_PARAMETERS, vec![1, 0, 0, 0]);
    assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Stored));
    assert_eq!(device.objects[&Object::STORE_PARAMETERS], b"save");
    let last = [Object::STORE_PARAMETERS, Object::MODE_OF_OPERATION];
    assert!(device.written.ends_with(&last), "the mode is not stored");
    assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Skipped));
}

#[test]
fn planned_restore_of_defaults_resets_the_whole_node() {
    let plan = NodePlan { restores_defaults: true, ..elbow() };
    let mut device = ScriptedDevice::suiting(&plan);
    device.objects.insert(Object::RESTORE_DEFAULTS, vec![1, 0, 0, 0]);
    let (outcome, _, sent) = boot(&plan, &mut device);
    assert_eq!(outcome, Ok(Configuration::Downloaded));
    assert_eq!(device.written.first(), Some(&Object::RESTORE_DEFAULTS));
    assert!(sent.contains(&Frame::new(0, [0x81, 3])));
}

#[test]
fn kept_alive_node_is_not_reset_if_it_runs_as_planned() {
    let plan = NodePlan { keep_alive: true, ..switch_box() };
    let is_reset = |sent: &[Frame]| sent.iter().any(|f| f.cob_id == 0 && f.data()[0] == 0x82);
    let mut device = ScriptedDevice { state: 0x05, ..ScriptedDevice::holding(&plan) };
    let (outcome, _, sent) = boot(&plan, &mut device);
    assert_eq!((outcome, is_reset(&sent)), (Ok(Configuration::Kept), false));
    assert_eq!((device.state, device.written.len()), (0x05, 0));

    let mut device = ScriptedDevice { state: 0x7F, ..ScriptedDevice::holding(&plan) };
    let (outcome, _, sent) = boot(&plan, &mut device);
    assert_eq!((outcome, is_reset(&sent)), (Ok(Configuration::Skipped), true));

    let mut device = ScriptedDevice { state: 0x05, ..ScriptedDevice::suiting(&plan) };
    let (outcome, _, sent) = boot(&plan, &mut device);
    assert_eq!((outcome, is_reset(&sent)), (Ok(Configuration::Downloaded), true));
}

#[test]
fn device_without_error_behaviour_boots() {
    let mut device = ScriptedDevice::suiting(&elbow());
    device.objects.remove(&Object::ERROR_BEHAVIOUR);
    assert_eq!(boot(&elbow(), &mut device).0, Ok(Configuration::Downloaded));
}

#[test]
fn wrong_software_serial_or_revision_is_named() {
    let mut plan = elbow();
    plan.admission.software = ByteString::from_bytes(b"0.2").ok();
    let mut device = ScriptedDevice::suiting(&plan);
    device.objects.insert(Object::SOFTWARE_VERSION, b"0.1".to_vec());
    let message = "joint 3 (elbow), node 3: 100Ah is \"0.1\", expected \"0.2\"";
    assert_eq!(failure(&plan, &mut device), message);

    let mut plan = elbow();
    plan.admission.serial = Some(7);
    let mut device = ScriptedDevice::suiting(&plan);
    device.objects.insert(Object::SERIAL, vec![8, 0, 0, 0]);
    let message = "joint 3 (elbow), node 3: 1018h:4 is 00000008h, expected 00000007h";
    assert_eq!(failure(&plan, &mut device), message);

    let mut plan = elbow();
    plan.admission.revisions = Revisions::Compatible;
    let mut device = ScriptedDevice::suiting(&plan);
    device.objects.insert(Object::REVISION, vec![9, 0, 1, 0]);
    assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
    device.objects.insert(Object::REVISION, vec![0, 0, 2, 0]);
    let message = "joint 3 (elbow), node 3: 1018h:3 is 00020000h, \
                   expected 00010000h or a later minor revision";
    assert_eq!(failure(&plan, &mut device), message);
}

/// Exchanges frames between boot and device until the master sends a frame that satisfies `is_it`.
fn run_until(
    boot: &mut Boot,
    device: &mut ScriptedDevice,
    is_it: impl Fn(&Frame) -> bool,
) -> Vec<Frame> {
    let mut queue = Vec::new();
    boot.on_time(Instant::ZERO, &mut queue);
    while let Some(sent) = queue.pop() {
        if is_it(&sent) {
            break;
        }
        if let Some(answer) = device.answer(&sent) {
            assert_eq!(boot.on_frame(Instant::ZERO, &answer, &mut queue), None);
        }
    }
    queue
}

#[test]
fn two_boot_ups_after_two_resets_are_two_nodes() {
    let plan = elbow();
    let (mut boot, mut device) = (Boot::new(&plan), ScriptedDevice::suiting(&plan));
    let reset = Frame::new(0, [0x82, 3]);
    let mut out = run_until(&mut boot, &mut device, |sent| *sent == reset);
    let boot_up = device.heartbeat(0);
    let mut outcomes: Vec<_> =
        (0..3).map(|_| boot.on_frame(Instant::ZERO, &boot_up, &mut out)).collect();
    assert_eq!(outcomes, [None, None, None], "one of them may be of the power-up");
    assert_eq!(out.iter().filter(|sent| **sent == reset).count(), 1, "so it is reset again");
    outcomes = vec![boot.on_frame(Instant::ZERO, &boot_up, &mut out)];
    let problem = Problem::Duplicate(Sign::TwoBootUps);
    assert_eq!(outcomes, [Some(Err(BootError::new(&plan, problem)))]);
}

#[test]
fn reply_received_twice_is_of_two_nodes() {
    let plan = elbow();
    let (mut boot, mut device) = (Boot::new(&plan), ScriptedDevice::suiting(&plan));
    let mut out = Vec::new();
    boot.on_time(Instant::ZERO, &mut out);
    let reply = device.answer(&out[0]).unwrap();
    assert_eq!(boot.on_frame(Instant::ZERO, &reply, &mut out), None);
    let outcome = boot.on_frame(Instant::ZERO, &reply, &mut out);
    let problem = Problem::Duplicate(Sign::ExtraReply);
    assert_eq!(outcome, Some(Err(BootError::new(&plan, problem))));
    let message = "answers one SDO request twice: are there two nodes with this node-id?";
    assert!(outcome.unwrap().unwrap_err().to_string().ends_with(message));
}

#[test]
fn late_replies_are_no_sign_of_two_nodes() {
    let plan = elbow();
    let (mut boot, mut device) = (Boot::new(&plan), ScriptedDevice::suiting(&plan));
    let mut out = Vec::new();
    boot.on_time(Instant::ZERO, &mut out);
    let reply = device.answer(&out[0]).unwrap();
    for turn in 1..5 {
        boot.on_time(Instant::ZERO + RETRY_PERIOD * turn, &mut out);
    }
    for _ in 0..5 {
        assert_eq!(boot.on_frame(Instant::ZERO + RETRY_PERIOD * 4, &reply, &mut out), None);
    }
}

#[test]
fn wrong_product_is_named_and_not_touched() {
    let mut device = ScriptedDevice::suiting(&elbow());
    device.objects.insert(Object::PRODUCT_CODE, vec![1, 0, 0, 0]);
    let (outcome, _, sent) = boot(&elbow(), &mut device);
    let message = "joint 3 (elbow), node 3: 1018h:2 is 00000001h, expected 04020010h";
    assert_eq!(outcome.unwrap_err().to_string(), message);
    assert!(sent.iter().all(|frame| frame.cob_id == 0x603));
    assert!(device.written.is_empty());
}

#[test]
fn wrong_device_type_is_named() {
    let mut device = ScriptedDevice::suiting(&elbow());
    device.objects.insert(Object::DEVICE_TYPE, vec![0x91, 0x01, 0x02, 0]);
    let message = "joint 3 (elbow), node 3: 1000h is 00020191h, expected xxxx0192h";
    assert_eq!(failure(&elbow(), &mut device), message);
}

#[test]
fn refused_mapping_is_named_with_its_entry() {
    let mut device = ScriptedDevice::suiting(&elbow());
    device.refuses.insert(Object::tpdo_mapping(1, 2), AbortCode::NOT_MAPPABLE);
    let message = "joint 3 (elbow), node 3: 1A00h:2 refused: 06040041h object cannot be mapped";
    assert_eq!(failure(&elbow(), &mut device), message);
}

#[test]
fn confirmed_write_without_effect_is_detected() {
    let plan = elbow();
    let written = |step| match step {
        Step::Object(action, check) if action.writes() => Some(check.object),
        Step::Read(_)
        | Step::CompareNameplate
        | Step::Object(..)
        | Step::Reset(_)
        | Step::AwaitHeartbeat => None,
    };
    let writes: Vec<_> = first_boot(&plan).into_iter().filter_map(written).collect();
    for object in writes {
        let mut device = ScriptedDevice::suiting(&plan);
        device.forgets.push(object);
        // Bit 31 of a COB-ID is set already: writing it changes nothing.
        let message = failure_or_none(&plan, &mut device);
        let is_off = plan.pdos.iter().any(|p| p.service.is_none() && p.communication(1) == object);
        assert_eq!(message.is_none(), is_off, "{object}: {message:?}");
        assert!(message.is_none_or(|message| message.contains(&format!("{object} is "))));
    }
}

fn failure_or_none(plan: &NodePlan, device: &mut ScriptedDevice) -> Option<String> {
    boot(plan, device).0.err().map(|error| error.to_string())
}

#[test]
fn unused_pdo_that_does_not_exist_is_off() {
    let mut device = ScriptedDevice::suiting(&elbow());
    device.objects.remove(&Object::rpdo_communication(4, 1));
    assert_eq!(boot(&elbow(), &mut device).0, Ok(Configuration::Downloaded));
    device.objects.remove(&Object::rpdo_communication(1, 1));
    let message = "joint 3 (elbow), node 3: 1400h:1 refused: 06020000h object does not exist";
    assert_eq!(failure(&elbow(), &mut device), message);
}

#[test]
fn slow_power_up_is_awaited() {
    let mut device = ScriptedDevice { deaf_for: 12, ..ScriptedDevice::suiting(&elbow()) };
    let (outcome, took, _) = boot(&elbow(), &mut device);
    assert_eq!((outcome, took), (Ok(Configuration::Downloaded), 12 * RETRY_PERIOD));
}

#[test]
fn absent_node_fails_at_the_deadline() {
    let mut device = ScriptedDevice { deaf_for: u32::MAX, ..ScriptedDevice::suiting(&elbow()) };
    let (outcome, took, sent) = boot(&elbow(), &mut device);
    assert_eq!(
        outcome.unwrap_err().to_string(),
        "joint 3 (elbow), node 3: does not answer, waited 2.0 s"
    );
    assert_eq!(took, BOOT_TIMEOUT);
    let requests = sent.iter().filter(|frame| frame.data().first() == Some(&0x40)).count();
    assert_eq!(requests, 20);
}

#[test]
fn stopped_node_is_set_pre_operational() {
    let mut device = ScriptedDevice { state: 0x04, ..ScriptedDevice::suiting(&elbow()) };
    assert_eq!(boot(&elbow(), &mut device).0, Ok(Configuration::Downloaded));
}

#[test]
fn enabled_drive_is_switched_off_before_identity_is_read() {
    let mut device = ScriptedDevice { state: 0x05, ..ScriptedDevice::suiting(&elbow()) };
    device.objects.insert(Object::STATUSWORD, vec![0x37, 0x16]);
    let (outcome, took, sent) = boot(&elbow(), &mut device);
    let message = "joint 3 (elbow), node 3: 6041h is 1637h, expected xxx0h in the bits 0004h";
    assert_eq!(outcome.unwrap_err().to_string(), message, "it never leaves operation enabled");
    assert!(took >= BOOT_TIMEOUT);
    let is_identity_request = |frame: &Frame| frame.data().get(1..3) == Some(&[0x18, 0x10]);
    assert!(!sent.iter().any(is_identity_request));
    assert!(!sent.contains(&Frame::new(0, [0x82, 3])), "no reset");
    assert_eq!(device.written, [Object::CONTROLWORD]);
}

/// Boots a drive that is found enabled, obeys, and turns by `counts` every 100 ms.
fn boot_moving(counts: i32, for_samples: i32) -> (BootOutcome, Duration) {
    let plan = NodePlan { standstill_counts: Some(50), ..elbow() };
    let mut device = ScriptedDevice::suiting(&plan);
    device.objects.insert(Object::STATUSWORD, vec![0x37, 0x16]);
    device.objects.insert(Object::POSITION_ACTUAL, vec![0; 4]);
    let (mut boot, mut queue, mut samples) = (Boot::new(&plan), Vec::new(), 0);
    loop {
        let now = boot.deadline().unwrap();
        let mut outcome = boot.on_time(now, &mut queue);
        while !queue.is_empty() {
            let frame = queue.remove(0);
            let is_position = frame.data().get(..3) == Some(&[0x40, 0x64, 0x60]);
            samples += i32::from(is_position);
            let at = counts * samples.min(for_samples);
            device.objects.insert(Object::POSITION_ACTUAL, at.to_le_bytes().into());
            let answer = device.answer(&frame);
            if device.written.contains(&Object::CONTROLWORD) {
                device.objects.insert(Object::STATUSWORD, vec![0x40, 0x16]);
            }
            if let Some(answer) = answer {
                outcome = outcome.or(boot.on_frame(now, &answer, &mut queue));
            }
        }
        if let Some(outcome) = outcome {
            assert!(boot.was_enabled());
            return (outcome, now.since(Instant::ZERO));
        }
    }
}

#[test]
fn drive_found_enabled_boots_after_standstill() {
    let (outcome, took) = boot_moving(51, 20);
    assert_eq!((outcome, took), (Ok(Configuration::Downloaded), 24 * RETRY_PERIOD));
    let (outcome, took) = boot_moving(50, i32::MAX);
    assert_eq!((outcome, took), (Ok(Configuration::Downloaded), 5 * RETRY_PERIOD));
}

#[test]
fn drive_moving_without_power_is_refused() {
    let (outcome, took) = boot_moving(51, i32::MAX);
    let message = "joint 3 (elbow), node 3: still moves, 5.0 s after its power was taken off";
    assert_eq!((outcome.unwrap_err().to_string().as_str(), took), (message, STANDSTILL_TIMEOUT));
}

#[test]
fn self_starting_node_is_set_pre_operational() {
    let mut device = ScriptedDevice { starts_itself: true, ..ScriptedDevice::suiting(&elbow()) };
    assert_eq!(boot(&elbow(), &mut device).0, Ok(Configuration::Downloaded));
    assert_eq!(device.state, 0x7F);
}

#[test]
fn boot_up_message_behind_an_answer_repeats_the_reset() {
    let plan = elbow();
    for (late_ms, is_booted) in [(1, true), (9, true), (11, false)] {
        let mut device = ScriptedDevice::suiting(&plan);
        let (mut boot, mut queue, mut sent) = (Boot::new(&plan), Vec::new(), Vec::new());
        let (mut now, mut is_sent) = (Instant::ZERO, false);
        let mut outcome = boot.on_time(now, &mut queue);
        for _ in 0..10_000 {
            let Some(frame) = (!queue.is_empty()).then(|| queue.remove(0)) else { break };
            sent.push(frame);
            if let Some(answer) = device.answer(&frame) {
                outcome = outcome.or(boot.on_frame(now, &answer, &mut queue));
            }
            let has_answered = frame.data().starts_with(&[0x40, 0x00, 0x10]) && sent.len() > 5;
            if has_answered && !std::mem::replace(&mut is_sent, true) {
                now = now + Duration::from_millis(late_ms);
                let boot_up = device.heartbeat(0);
                outcome = outcome.or(boot.on_frame(now, &boot_up, &mut queue));
            }
        }
        let resets = sent.iter().filter(|frame| frame.data() == [0x82, 3]).count();
        assert_eq!(
            (outcome.unwrap().is_ok(), resets),
            (is_booted, 1 + usize::from(is_booted)),
            "{late_ms}"
        );
    }
}

#[test]
fn node_without_boot_up_after_reset_is_named() {
    let mut device = ScriptedDevice { boots: false, ..ScriptedDevice::suiting(&elbow()) };
    let message = "joint 3 (elbow), node 3: did not boot up after its reset";
    assert_eq!(failure(&elbow(), &mut device), message);
}

#[test]
fn mode_not_displayed_is_refused() {
    let mut device = ScriptedDevice::suiting(&elbow());
    device.objects.insert(Object::MODE_DISPLAY, vec![0]);
    assert_eq!(
        failure(&elbow(), &mut device),
        "joint 3 (elbow), node 3: 6061h is 00h, expected 0Ah: if it displays its mode only when enabled, say \
         mode_shown = \"enabled\" in [joint.boot]"
    );
}

#[test]
fn reboot_during_boot_is_a_failure() {
    let plan = elbow();
    let mut device = ScriptedDevice::suiting(&plan);
    let (mut boot, mut queue) = (Boot::new(&plan), Vec::new());
    boot.on_time(Instant::ZERO, &mut queue);
    while device.written.len() < 5 {
        let answer = queue.pop().and_then(|frame| device.answer(&frame));
        if let Some(answer) = answer {
            assert_eq!(boot.on_frame(Instant::ZERO, &answer, &mut queue), None);
        }
    }
    let later = Instant::ZERO + Duration::from_millis(50);
    let outcome = boot.on_frame(later, &device.heartbeat(0), &mut queue);
    assert_eq!(outcome, Some(Err(BootError::new(&plan, Problem::Rebooted))));
    assert_eq!(boot.deadline(), None);
}

proptest! {
    #[test]
    fn any_frames_never_panic_and_the_boot_ends_once(
        steps in proptest::collection::vec(
            (0_u64..300_000, prop::sample::select(vec![0x583_u16, 0x703, 0x000, 0x584]), proptest::collection::vec(any::<u8>(), 0..9)),
            0..60,
        ),
        answers in proptest::collection::vec(any::<bool>(), 0..200),
    ) {
        let plan = elbow();
        let mut device = ScriptedDevice::suiting(&plan);
        let (mut boot, mut out, mut now) = (Boot::new(&plan), Vec::new(), Instant::ZERO);
        let (mut outcomes, mut answers) = (0, answers.into_iter());
        for (step, cob_id, data) in steps {
            now = now + Duration::from_micros(step);
            let noise = Frame::from_slice(cob_id, &data).unwrap();
            outcomes += u32::from(boot.on_time(now, &mut out).is_some());
            outcomes += u32::from(boot.on_frame(now, &noise, &mut out).is_some());
            while let Some(request) = out.pop() {
                let answer = device.answer(&request).filter(|_| answers.next().unwrap_or(true));
                if let Some(answer) = answer {
                    outcomes += u32::from(boot.on_frame(now, &answer, &mut out).is_some());
                }
            }
        }
        for _ in 0..first_boot(&plan).len() * 60 {
            let Some(due) = boot.deadline() else { break };
            now = now.max(due);
            outcomes += u32::from(boot.on_time(now, &mut out).is_some());
        }
        prop_assert_eq!(outcomes, 1);
        prop_assert_eq!(boot.deadline(), None);
    }
}

#[test]
fn transfer_disturbed_by_another_client_is_repeated() {
    let request = Frame::new(0x603, [0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
    let abort = Frame::new(0x583, [0x80, 0x00, 0x10, 0, 0, 0, 4, 5]);
    for disturbances in [0, 1, MAX_REPEATS] {
        let (mut boot, mut out) = (Boot::new(&elbow()), Vec::new());
        boot.on_time(Instant::ZERO, &mut out);
        for _ in 0..disturbances {
            boot.on_foreign_request(&request);
            assert_eq!(boot.on_frame(Instant::ZERO, &abort, &mut out), None);
        }
        assert_eq!(out.len(), 1 + usize::try_from(disturbances).unwrap());
        assert!(out.iter().all(|frame| *frame == request));
        let last = boot.on_frame(Instant::ZERO, &abort, &mut out);
        assert!(last.is_some(), "undisturbed, it counts");
    }
}

/// Boots at a server that takes `think` ms for each reply about 1000h, one after the other. Returns the
/// time at which the next object was read, in ms.
fn slow_to_answer(think: u64) -> Option<u64> {
    let (mut boot, mut out) = (Boot::new(&elbow()), Vec::new());
    let (mut queue, mut busy_until) = (std::collections::VecDeque::new(), 0);
    for ms in 0..20_000_u64 {
        let now = Instant::from_micros(ms * 1_000);
        while boot.deadline().is_some_and(|due| due <= now) {
            assert_eq!(boot.on_time(now, &mut out), None, "{ms} ms");
        }
        let requests = out.drain(..).filter(|it| it.cob_id == 0x603 && it.data()[0] == 0x40);
        queue.extend(requests);
        let Some(request) = queue.front().copied() else { continue };
        if busy_until == 0 {
            busy_until = if request.data()[1..3] == [0x00, 0x10] { ms + think } else { ms };
        }
        if ms < busy_until {
            continue;
        }
        (busy_until, _) = (0, queue.pop_front());
        if request.data()[1..3] != [0x00, 0x10] {
            return Some(ms);
        }
        let answer = Frame::new(0x583, [0x43, 0x00, 0x10, 0, 0x92, 1, 2, 0]);
        assert_eq!(boot.on_frame(now, &answer, &mut out), None, "{ms} ms");
    }
    None
}

#[test]
fn late_replies_do_not_consume_the_next_timeout() {
    // A server that takes 0.9 s has received ten requests before its first reply.
    for think in [1, 300, 900] {
        assert!(slow_to_answer(think).is_some(), "{think} ms");
    }
}

#[test]
fn replies_to_another_client_are_no_sign_of_two_nodes() {
    let request = Frame::new(0x603, [0x40, 0x00, 0x10, 0, 0, 0, 0, 0]);
    let other = Frame::new(0x583, [0x43, 0x00, 0x10, 0, 0x92, 1, 2, 0]);
    let (mut boot, mut out) = (Boot::new(&elbow()), Vec::new());
    boot.on_time(Instant::ZERO, &mut out);
    boot.on_foreign_request(&request);
    for _ in 0..2 {
        assert_eq!(boot.on_frame(Instant::ZERO, &other, &mut out), None);
    }
}

#[test]
fn cob_id_gets_bit_30_where_the_node_accepts_no_other() {
    let plan = elbow();
    let mut device = ScriptedDevice::suiting(&plan);
    let cob_id = Object::tpdo_communication(1, 1);
    device.has_no_rtr.push(cob_id);
    assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
    assert_eq!(device.objects[&cob_id], [0x83, 0x01, 0, 0x40]);
    assert_eq!(device.objects[&Object::tpdo_communication(2, 1)][3] & 0x40, 0, "only that one");
    device.refuses.insert(cob_id, AbortCode::VALUE_INVALID);
    assert!(failure(&plan, &mut device).ends_with("1800h:1 refused: 06090030h value is invalid"));
}

#[test]
fn refused_value_of_a_means_counts_as_its_absence() {
    let plan = elbow();
    let mut device = ScriptedDevice::suiting(&plan);
    device.refuses.insert(Object::QUICK_STOP_OPTION, AbortCode::VALUE_INVALID);
    let mut boot = Boot::new(&plan);
    let mut queue = Vec::new();
    let outcome = loop {
        let now = boot.deadline().unwrap();
        let mut outcome = boot.on_time(now, &mut queue);
        while !queue.is_empty() {
            let answer = device.answer(&queue.remove(0));
            outcome = answer.and_then(|it| boot.on_frame(now, &it, &mut queue)).or(outcome);
        }
        if let Some(outcome) = outcome {
            break outcome;
        }
    };
    assert_eq!(outcome, Ok(Configuration::Downloaded));
    assert_eq!(boot.missing(), [Object::QUICK_STOP_OPTION]);
    assert_eq!(boot.refused(), [(Object::QUICK_STOP_OPTION, AbortCode::VALUE_INVALID)]);
    for (object, code) in [
        (Object::QUICK_STOP_OPTION, AbortCode::GENERAL_ERROR),
        (Object::MAX_TORQUE, AbortCode::VALUE_INVALID),
        (Object::CONSUMER_HEARTBEAT, AbortCode::VALUE_TOO_HIGH),
    ] {
        let mut device = ScriptedDevice::suiting(&plan);
        device.refuses.insert(object, code);
        assert!(failure(&plan, &mut device).contains(&object.to_string()), "{object} {code}");
    }
}

#[test]
fn offsets_are_cleared_or_compared_or_absent() {
    let plan = elbow();
    for object in OFFSETS {
        let mut device = ScriptedDevice::suiting(&plan);
        assert!(
            boot(&plan, &mut device).0.is_ok() && device.objects[&object].iter().all(|it| *it == 0)
        );
        let mut device = ScriptedDevice::suiting(&plan);
        device.objects.remove(&object);
        assert!(boot(&plan, &mut device).0.is_ok(), "{object} absent");
        let mut device = ScriptedDevice::suiting(&plan);
        device.refuses.insert(object, AbortCode::READ_ONLY);
        let text = failure(&plan, &mut device);
        assert!(
            text.contains(": an offset acts from enabling on; clear it with the maker's tool"),
            "{text}"
        );
        device.objects.get_mut(&object).unwrap().fill(0);
        assert!(boot(&plan, &mut device).0.is_ok(), "{object} read only, and zero");
        device.refuses.insert(object, AbortCode::GENERAL_ERROR);
        assert!(failure(&plan, &mut device).contains("clear it with the maker's tool"), "{object}");
    }
}

#[test]
fn upload_without_an_answer_is_repeated_once() {
    let plan = elbow();
    for object in [Object::VENDOR_ID, Object::MAX_TORQUE, Object::MODE_DISPLAY] {
        let mut device = ScriptedDevice::suiting(&plan);
        device.loses.push(object);
        let (outcome, took, _) = boot(&plan, &mut device);
        assert_eq!((outcome, took), (Ok(Configuration::Downloaded), REPLY_TIMEOUT), "{object}");
        device.loses.extend([object; 2]);
        assert_eq!(
            failure(&plan, &mut device),
            format!("joint 3 (elbow), node 3: {object}: no answer")
        );
    }
}

#[test]
fn time_limits_are_those_of_the_plan() {
    let plan = NodePlan {
        timeouts: Timeouts { reply: Duration::from_millis(40), boot: Duration::from_millis(900) },
        ..elbow()
    };
    let mut device = ScriptedDevice::suiting(&plan);
    device.loses.push(Object::VENDOR_ID);
    assert_eq!(boot(&plan, &mut device).1, Duration::from_millis(40));
    device.deaf_for = u32::MAX;
    assert!(failure(&plan, &mut device).ends_with("does not answer, waited 0.9 s"));
}

/// Elbow plan with a nameplate, and a node that holds it.
fn rated() -> (NodePlan, ScriptedDevice) {
    let nameplate = Nameplate {
        polarity: 0,
        scale: PositionScale {
            counts: 4_096,
            unit: SiUnit::INCREMENTS,
            encoder: None,
            gear: Ratio::ONE,
            feed: None,
        },
        rated_current: None,
        rated_torque: Rating { value: 176.5, unit: "mN·m" },
        capacity: None,
        units: Units::default(),
        modes: None,
    };
    let plan = NodePlan { nameplate: Some(nameplate), ..elbow() };
    let mut device = ScriptedDevice::suiting(&plan);
    device.objects.insert(Object::POLARITY, vec![0]);
    device.objects.insert(Object::RATED_TORQUE, vec![177, 0, 0, 0]);
    (plan, device)
}

#[test]
fn nameplate_is_compared_after_every_configuration() {
    let (plan, mut device) = rated();
    assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
    device.objects.insert(Object::POLARITY, vec![0x80]);
    let text = failure(&plan, &mut device);
    assert!(text.contains("node 3: polarity (607Eh) is 80h, expected 00h: "), "{text}");
    let mut stored = ScriptedDevice::holding(&plan);
    stored.objects.insert(Object::POLARITY, vec![0x80]);
    assert!(failure(&plan, &mut stored).contains("polarity"), "a stored configuration, too");
}

#[test]
fn first_write_precedes_the_plan_and_may_mend_the_nameplate() {
    let (plan, mut device) = rated();
    device.objects.insert(Object::POLARITY, vec![0x80]);
    let plan = NodePlan { first_writes: vec![(Object::POLARITY, Value::Unsigned8(0))], ..plan };
    assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
    let first = device.written.iter().find(|object| **object != Object::CONTROLWORD);
    assert_eq!(first, Some(&Object::POLARITY));
}

#[test]
fn lost_answer_about_the_nameplate_is_asked_for_again() {
    let (plan, mut device) = rated();
    device.loses.push(Object::RATED_TORQUE);
    assert_eq!(boot(&plan, &mut device).0, Ok(Configuration::Downloaded));
    device.loses.extend([Object::RATED_TORQUE; 2]);
    assert!(failure(&plan, &mut device).ends_with("6076h: no answer"), "not taken for absent");
}

#[test]
fn nameplate_that_cannot_be_read_is_not_taken_for_absent() {
    let (plan, device) = rated();
    let mut device = ScriptedDevice { hides: vec![Object::POLARITY], ..device };
    assert!(failure(&plan, &mut device).contains("607Eh refused: 08000000h"));
}
