//! Values that a device keeps instead of computing them: its deadline, and the filter of the frames that it consumes.

use super::*;
use crate::lss::REQUEST_COB_ID;

/// Input of the device.
#[derive(Clone, Debug)]
enum Input {
    Frame(u16, Vec<u8>),
    Remote(u16),
    Download(Object, u32),
    Wait(u64),
    /// Passage of time without a call of the device.
    Delay(u64),
    Error(u16),
    TransientError,
    PowerCycle,
}

/// Objects whose write changes deadline or filter, and values for them.
fn download() -> impl Strategy<Value = Input> {
    let writes = [
        (Object::SYNC_COB_ID, [0x80, 0x81]),
        (Object::SYNC_WINDOW, [0, 2_000]),
        (Object::TIME_COB_ID, [0x100, 0x8000_0100]),
        (Object::EMCY_INHIBIT_TIME, [0, 100]),
        (Object::PRODUCER_HEARTBEAT, [0, 7]),
        (Object::CONSUMER_HEARTBEAT, [0, MASTER_FOR_20_MS]),
        (Object::GUARD_TIME, [0, 5]),
        (Object::LIFE_TIME_FACTOR, [0, 2]),
        (RPDO1.communication(1), [OFF | 0x205, 0x206]),
        (RPDO1.communication(2), [1, 255]),
        (RPDO1.communication(5), [0, 9]),
        (TPDO1.communication(1), [OFF | 0x185, 0x185]),
        (TPDO1.communication(2), [1, 255]),
        (TPDO1.communication(5), [0, 11]),
    ];
    (prop::sample::select(writes.to_vec()), 0..2_usize)
        .prop_map(|((object, values), which)| Input::Download(object, values[which]))
}

fn frame() -> impl Strategy<Value = Input> {
    let ids = [0x80, 0x81, 0x100, 0x205, 0x206, 0x305, 0x605, 0x606, 0x77F, 0x705, REQUEST_COB_ID];
    let data = prop::collection::vec(any::<u8>(), 0..=8);
    let cob_id = prop_oneof![4 => prop::sample::select(ids.to_vec()), 1 => 0..0x800_u16];
    (cob_id, data).prop_map(|(cob_id, data)| Input::Frame(cob_id, data))
}

fn input() -> impl Strategy<Value = Input> {
    let commands = prop::sample::select(vec![1, 1, 1, 2, 0x80, 0x81, 0x82]);
    prop_oneof![
        4 => frame(),
        4 => download(),
        2 => (commands, 4..=6_u8).prop_map(|(command, node)| Input::Frame(0, vec![command, node])),
        1 => prop::sample::select(vec![0x705, 0x706, 0x185, 0x186]).prop_map(Input::Remote),
        2 => Just(Input::Frame(0x80, vec![])),
        3 => (0..30_u64).prop_map(Input::Wait),
        2 => (0..30_u64).prop_map(Input::Delay),
        1 => prop::sample::select(vec![0, 0x2310, 0x4310]).prop_map(Input::Error),
        1 => Just(Input::TransientError),
        1 => Just(Input::PowerCycle),
    ]
}

impl Fixture {
    /// Applies an input. If not `is_filtered`, the device takes every frame, and looks for something to send after it.
    /// Returns the frames sent.
    fn apply(&mut self, input: &Input, is_filtered: bool) -> Vec<Frame> {
        let mut out = Vec::new();
        let frame = match input {
            Input::Frame(cob_id, data) => Frame::from_slice(*cob_id, data),
            Input::Remote(cob_id) => Some(Frame::remote(*cob_id, 1)),
            Input::Download(object, value) => {
                let size = self.device.dictionary().entry(*object).and_then(Entry::size);
                let [i0, i1] = object.index.to_le_bytes();
                let [a, b, c, d] = value.to_le_bytes();
                let command = 0x23 | u8::try_from(4 - size.unwrap_or(4)).unwrap() << 2;
                Some(Frame::new(0x605, [command, i0, i1, object.sub, a, b, c, d]))
            }
            Input::Wait(millis) => {
                let until = self.now + Duration::from_millis(*millis);
                while let Some(due) = self.device.deadline().filter(|due| *due <= until) {
                    self.now = self.now.max(due);
                    self.device.on_time(self.now, &mut out);
                }
                self.now = until;
                None
            }
            Input::Delay(millis) => {
                self.now = self.now + Duration::from_millis(*millis);
                None
            }
            Input::Error(code) => {
                self.device.touch(|application, _| application.code = *code);
                None
            }
            Input::TransientError => {
                self.device.report_transient_error(0x8140, 0x11);
                None
            }
            Input::PowerCycle => {
                self.device.power_cycle();
                None
            }
        };
        let Some(frame) = frame else { return out };
        if is_filtered {
            self.device.on_frame(self.now, &frame, &mut out);
        } else {
            if self.device.take_frame(self.now, &frame, &mut out) {
                self.device.send_pending(self.now, &mut out);
            }
            self.device.update_deadline();
        }
        out
    }
}

proptest! {
    #[test]
    fn kept_deadline_and_filter_are_those_of_the_state(
        inputs in prop::collection::vec(input(), 1..80),
    ) {
        let mut fixture = Fixture::new();
        for input in inputs {
            fixture.apply(&input, true);
            prop_assert_eq!(fixture.device.due, fixture.device.next_deadline(), "{:?}", input);
            prop_assert_eq!(fixture.device.filter, fixture.device.consumed(), "{:?}", input);
        }
    }

    #[test]
    fn frames_that_the_filter_stops_have_no_effect(
        inputs in prop::collection::vec(input(), 1..80),
    ) {
        let (mut filtered, mut open) = (Fixture::new(), Fixture::new());
        for input in inputs {
            let (sent, by_open) = (filtered.apply(&input, true), open.apply(&input, false));
            prop_assert_eq!(sent, by_open, "{:?}", input);
            prop_assert_eq!(filtered.device.state(), open.device.state());
            prop_assert_eq!(filtered.device.deadline(), open.device.deadline());
            prop_assert_eq!(&filtered.device.dictionary, &open.device.dictionary);
            let applications = [filtered.device.application(), open.device.application()];
            let [written, by_open] = applications.map(|application| &application.written);
            prop_assert_eq!(written, by_open);
        }
    }
}
