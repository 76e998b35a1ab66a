//! Repetitions of transfers that another client disturbs.

use std::collections::BTreeMap;

use super::*;

/// Reply that aborts the transfer: SDO protocol timed out.
fn aborted(request: &Frame) -> Frame {
    let mut reply = [0x80, 0, 0, 0, 0, 0, 4, 5];
    reply[1..4].copy_from_slice(&request.data()[1..4]);
    Frame::new(0x583, reply)
}

/// Object of an SDO request; `None` of other frames.
fn requested(frame: &Frame) -> Option<Object> {
    let &[_, low, high, sub, ..] = frame.data() else { return None };
    (frame.cob_id == 0x603).then(|| Object { index: u16::from_le_bytes([low, high]), sub })
}

/// Boots `device` with the first `times` requests of each kind for each object disturbed. Returns the outcome, and how often each was sent.
fn each_disturbed(
    plan: &NodePlan,
    device: &mut ScriptedDevice,
    times: u32,
) -> (BootOutcome, BTreeMap<[u8; 4], u32>) {
    let mut counts = BTreeMap::new();
    let (outcome, ..) = disturbed(plan, device, |frame| {
        requested(frame)?;
        let kind = frame.data().first_chunk::<4>()?;
        let count = counts.entry(*kind).or_insert(0);
        *count += 1;
        (*count <= times).then(|| aborted(frame))
    });
    (outcome, counts)
}

#[test]
fn every_transfer_is_repeated_three_times_if_disturbed() {
    for plan in [elbow(), rated().0] {
        let device =
            || if plan.nameplate.is_some() { rated().1 } else { ScriptedDevice::suiting(&plan) };
        let (outcome, undisturbed) = each_disturbed(&plan, &mut device(), 0);
        assert_eq!(outcome, Ok(Configuration::Downloaded));
        let mut device = device();
        let (outcome, counts) = each_disturbed(&plan, &mut device, MAX_REPEATS);
        assert_eq!(outcome, Ok(Configuration::Downloaded));
        for (kind, count) in undisturbed {
            assert_eq!(counts[&kind], count + MAX_REPEATS, "{kind:02X?}");
        }
        for (object, value) in plan.pdos.iter().flat_map(|pdo| pdo.writes().pop()) {
            assert_eq!(device.objects[&object], bytes(&value), "{object}");
        }
    }
}

#[test]
fn fourth_disturbance_of_a_transfer_fails_the_boot() {
    let (plan, _) = rated();
    for object in [Object::VENDOR_ID, Object::RATED_TORQUE, Object::tpdo_mapping(1, 2)] {
        let mut requests = 0;
        let (outcome, ..) = disturbed(&plan, &mut rated().1, |frame| {
            let is_disturbed = requested(frame)? == object && requests < 10;
            requests += u32::from(is_disturbed);
            is_disturbed.then(|| aborted(frame))
        });
        let text = outcome.unwrap_err().to_string();
        assert!(text.contains(&format!("{object} refused: 05040000h")), "{text}");
        assert_eq!(requests, 1 + MAX_REPEATS, "{object}");
    }
}

#[test]
fn disturbance_counts_for_its_transfer_alone() {
    // The client disturbs the transfer before, which succeeds all the same: the refusal is the node's.
    let (plan, mut device) = rated();
    let (.., sent) = boot(&plan, &mut device);
    let requests: Vec<Frame> = sent.into_iter().filter(|it| requested(it).is_some()).collect();
    for object in [Object::VENDOR_ID, Object::RATED_TORQUE] {
        let place = requests.iter().position(|it| requested(it) == Some(object)).unwrap();
        let before = requested(&requests[place - 1]).unwrap();
        let (mut device, mut refusals, mut boot) = (rated().1, 0, Boot::new(&plan));
        let mut queue = Vec::new();
        let mut outcome = boot.on_time(Instant::ZERO, &mut queue);
        while outcome.is_none() {
            let frame = queue.remove(0);
            let is_refused = requested(&frame) == Some(object);
            refusals += u32::from(is_refused);
            assert!(refusals < 10, "{object}");
            let answer = if is_refused { Some(aborted(&frame)) } else { device.answer(&frame) };
            if requested(&frame) == Some(before) {
                boot.on_foreign_request(&frame);
            }
            outcome = answer.and_then(|it| boot.on_frame(Instant::ZERO, &it, &mut queue));
        }
        assert!(outcome.unwrap().is_err());
        assert_eq!(refusals, 1, "{object}");
    }
}

#[test]
fn reply_to_another_client_is_no_value_of_the_object() {
    // The reply to the other client's request is taken for one's own; it holds another value.
    let plan = elbow();
    for (object, command) in [
        (Object::VENDOR_ID, 0x43),
        (Object::rpdo_communication(1, 1), 0x43),
        (Object::PRODUCER_HEARTBEAT, 0x4B),
    ] {
        for times in [1, MAX_REPEATS, MAX_REPEATS + 1] {
            let mut count = 0;
            let (outcome, ..) = disturbed(&plan, &mut ScriptedDevice::suiting(&plan), |frame| {
                let is_read = requested(frame)? == object && frame.data().first() == Some(&0x40);
                count += u32::from(is_read);
                let mut reply = [command, 0, 0, 0, 0x5A, 0x5A, 0, 0];
                reply[1..4].copy_from_slice(&frame.data()[1..4]);
                (is_read && count <= times).then(|| Frame::new(0x583, reply))
            });
            assert_eq!(
                outcome.is_ok(),
                times <= MAX_REPEATS,
                "{object}, {times} times: {outcome:?}"
            );
        }
    }
}

#[test]
fn objects_that_the_node_lacks_are_read_again_if_disturbed() {
    // 6091h and 608Fh of the nameplate are absent, and one factor of CiA 402-1 is refused with a general error.
    let (plan, device) = rated();
    let factor = Object { sub: 1, ..Object::POSITION_FACTOR };
    let mut device = ScriptedDevice { hides: vec![factor], ..device };
    device.objects.insert(factor, vec![1, 0, 0, 0]);
    let (outcome, counts) = each_disturbed(&plan, &mut device, MAX_REPEATS);
    assert_eq!(outcome, Ok(Configuration::Downloaded));
    let [low, high] = factor.index.to_le_bytes();
    assert_eq!(counts[&[0x40, low, high, 1]], 1 + MAX_REPEATS);
}

#[test]
fn refused_optional_object_does_not_use_up_repetitions() {
    // 1029h:1 may be absent: its three repetitions are not those of the next object.
    let plan = elbow();
    let mut device = ScriptedDevice::suiting(&plan);
    device.objects.remove(&Object::ERROR_BEHAVIOUR);
    let (outcome, counts) = each_disturbed(&plan, &mut device, MAX_REPEATS);
    assert_eq!(outcome, Ok(Configuration::Downloaded));
    let [low, high] = Object::ERROR_BEHAVIOUR.index.to_le_bytes();
    let kinds = counts.iter().filter(|([_, l, h, _], _)| (*l, *h) == (low, high));
    assert_eq!(kinds.map(|(_, count)| *count).collect::<Vec<_>>(), [1 + MAX_REPEATS]);
}
