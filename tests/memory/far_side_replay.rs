//! Replay of a session in which the command mode changes while armed, beside a far side that follows one mode or both.

use std::cell::{Cell, RefCell};
use std::io::Cursor;
use std::rc::Rc;

use controller::switches::CommandMode;
use inputs::{Call, Input, InputSink, InputWriter, RecordedNode};
use replay::{End, Replay};

use crate::common::bench::press_script;
use crate::common::linked::{LINK, linked};
use crate::common::prelude::*;
use crate::linked_node::{LinkedSide, Network};

/// Inputs of a node. Those of an earlier version lack the answer to a change of the command mode.
#[derive(Clone)]
struct Recording {
    writer: Rc<RefCell<InputWriter<Vec<u8>>>>,
    is_earlier: bool,
    changes_mode: Rc<Cell<bool>>,
}

impl InputSink for Recording {
    fn is_recording(&self) -> bool {
        true
    }

    fn on_input(&self, input: Input) {
        if let Input::Call(call) = &input {
            self.changes_mode.set(matches!(call, Call::Request(Request::Command(_))));
        }
        let is_answer = self.changes_mode.get() && matches!(input, Input::Misfits(_));
        if !(is_answer && self.is_earlier) {
            self.writer.borrow_mut().write(&input).unwrap();
        }
    }
}

/// Records a node that is engaged and commanded to both modes; returns the answer to pose mode and the inputs.
fn recorded(follows_poses: bool, is_earlier: bool) -> (Result<Mode, String>, Config, Vec<u8>) {
    let config = parse(KRAFT, &linked("kraft_like", LINK));
    let far = parse(KRAFT, &fs::read_to_string(KRAFT).unwrap());
    let bitrates: Vec<u32> = config.buses.iter().map(|bus| bus.bitrate).collect();
    let world = world::build(&config, script(&press_script(1.2)), 1);
    let mut remote = LinkedSide::new(&config, &far, Network::default(), Rc::default());
    remote.capability.follows_poses = follows_poses;
    let writer = InputWriter::begin(Vec::new()).unwrap();
    let writer = Rc::new(RefCell::new(writer));
    let recording =
        Recording { writer: Rc::clone(&writer), is_earlier, changes_mode: Rc::default() };
    let bus = Memory::new(&bitrates, world, ());
    let mut node = RecordedNode::new(&config, bus, remote, recording);
    node.bring_up(&mut || false).unwrap();
    (0..500).for_each(|_| _ = node.cycle());
    assert_eq!(node.request(Request::Arm, &mut || false).ok(), Some(Mode::Armed));
    let engaged = (0..3_000).find(|_| node.cycle().mode == Mode::Engaged);
    assert!(engaged.is_some(), "{:?}", node.cause());
    (0..200).for_each(|_| _ = node.cycle());
    let pose = node.request(Request::Command(CommandMode::Pose), &mut || false);
    (0..300).for_each(|_| _ = node.cycle());
    let rate = node.request(Request::Command(CommandMode::Rate), &mut || false);
    assert_eq!(rate.ok(), Some(Mode::Engaged));
    (0..300).for_each(|_| _ = node.cycle());
    drop(node);
    let inputs = Rc::into_inner(writer).unwrap().into_inner().into_inner();
    (pose.map_err(|error| error.to_string()), config, inputs)
}

/// Asserts that a replay sends each frame again.
fn replays(config: &Config, inputs: Vec<u8>) {
    let mut replay = Replay::of_inputs(config, Cursor::new(inputs)).unwrap().unwrap();
    while replay.outcome().end.is_none() {
        replay.step();
    }
    let outcome = replay.outcome();
    assert!(matches!(outcome.end, Some(End::Complete)), "{:?}", outcome.end);
    assert!(outcome.cycles > 1_300, "{} cycles", outcome.cycles);
}

#[test]
fn changes_of_mode_beside_a_far_side_replay() {
    let (pose, config, inputs) = recorded(true, false);
    assert_eq!(pose, Ok(Mode::Engaged));
    replays(&config, inputs);
    let (pose, config, inputs) = recorded(false, false);
    assert_eq!(pose, Err("the far side does not follow poses".to_owned()));
    replays(&config, inputs);
}

#[test]
fn changes_of_mode_in_an_earlier_session_replay() {
    let (pose, config, inputs) = recorded(true, true);
    assert_eq!(pose, Ok(Mode::Engaged));
    replays(&config, inputs);
}
