//! Laws of the link: age, order, loss, outage, hold.

use nalgebra::Isometry3;
use proptest::prelude::*;

use super::*;
use units::spatial::{Motion, Twist, Wrench};

const MS: Duration = Duration::from_millis(1);

/// Records its commands; its pose along x is the time at which a sample was taken, in s.
#[derive(Clone, Debug, Default)]
struct Far {
    commands: Vec<(Instant, Motion)>,
    is_frozen: bool,
    epochs: u32,
}

impl Remote for Far {
    fn exchange(&mut self, now: Instant, command: &Command) -> Option<RemoteSample> {
        self.commands.push((now, command.motion));
        let at = if self.is_frozen { Instant::ZERO } else { now };
        let taken = now.since(Instant::ZERO).as_secs_f64();
        let x_b_m = Isometry3::translation(taken, 0.0, 0.0);
        Some(RemoteSample { at, f_s: Wrench::ZERO, x_b_m, gripper: command.gripper })
    }

    fn begin_epoch(&mut self) {
        self.epochs += 1;
    }
}

fn at(millis: u32) -> Instant {
    Instant::ZERO + MS * millis
}

/// Returns the command of one cycle: a rate in m/s as large as its time in s.
fn numbered(millis: u32) -> Motion {
    Motion::Rate(Twist::from_components([f64::from(millis) / 1e3, 0.0, 0.0, 0.0, 0.0, 0.0]))
}

fn number(motion: &Motion) -> Option<f64> {
    match motion {
        Motion::Rate(twist) => Some(twist.linear.x),
        Motion::Pose(_) | Motion::Hold => None,
    }
}

/// Time until both ends have an echo through any of the links here.
const WARM_UP: u32 = 300;

/// Returns a link whose node was armed at [`WARM_UP`].
fn armed(settings: DelaySettings) -> DelayedSide<Far> {
    let mut link = DelayedSide::new(Far::default(), settings);
    for millis in 0..WARM_UP {
        link.exchange(at(millis), &Command::HOLD);
    }
    link.begin_epoch();
    link.far_mut().commands.clear();
    link
}

/// Exchanges every ms; returns the samples with their times.
fn exchanged(
    link: &mut DelayedSide<Far>,
    millis: std::ops::Range<u32>,
) -> Vec<(Instant, RemoteSample)> {
    let each =
        millis.map(|millis| (at(millis), link.exchange(at(millis), &numbered(millis).into())));
    each.filter_map(|(now, sensed)| Some((now, sensed?))).collect()
}

/// Age by the stamp, and true age of the sample.
fn ages(&(now, sensed): &(Instant, RemoteSample)) -> (Duration, Duration) {
    let taken = Duration::from_secs_f64(sensed.x_b_m.translation.x);
    (now.since(sensed.at), now.since(Instant::ZERO).saturating_sub(taken))
}

fn settings() -> impl Strategy<Value = DelaySettings> {
    (0..40_u32, 0..30_u32, 0.0..0.6_f64, any::<bool>(), any::<u64>()).prop_map(
        |(delay, jitter, loss, reorders, seed)| DelaySettings {
            delay: MS * delay / 2,
            jitter: MS * jitter,
            loss,
            reorders,
            seed,
            ..DelaySettings::default()
        },
    )
}

proptest! {
    #[test]
    fn age_is_never_below_the_true_one_nor_the_delay(settings in settings()) {
        let mut link = DelayedSide::new(Far::default(), settings);
        for sample in exchanged(&mut link, 0..300) {
            let (by_stamp, truly) = ages(&sample);
            prop_assert!(by_stamp + Duration::from_micros(1) >= truly + settings.delay, "{by_stamp:?} {truly:?}");
            prop_assert!(by_stamp >= settings.delay * 2);
        }
    }

    #[test]
    fn stamps_and_commands_never_go_back(settings in settings()) {
        let mut link = armed(settings);
        let samples = exchanged(&mut link, WARM_UP..WARM_UP + 300);
        prop_assert!(samples.is_sorted_by_key(|(_, sensed)| sensed.at));
        let acted = link.far().commands.iter().filter_map(|(_, motion)| number(motion));
        prop_assert!(acted.collect::<Vec<_>>().is_sorted());
    }

    #[test]
    fn command_acts_no_longer_than_the_hold_time(settings in settings()) {
        let mut link = armed(settings);
        exchanged(&mut link, WARM_UP..WARM_UP + 300);
        for (now, motion) in &link.far().commands {
            let Some(number) = number(motion) else { continue };
            let age = now.since(Instant::ZERO + Duration::from_secs_f64(number));
            prop_assert!(age <= settings.hold_after, "{age:?}");
        }
    }

    #[test]
    fn same_seed_is_the_same_link(settings in settings()) {
        let run = || exchanged(&mut DelayedSide::new(Far::default(), settings), 0..100);
        prop_assert_eq!(run(), run());
    }

    #[test]
    fn every_datagram_is_accounted_for(settings in settings()) {
        let mut link = DelayedSide::new(Far::default(), settings);
        exchanged(&mut link, 0..300);
        let Some([there, back]) = link.counts() else { panic!("a link has counts") };
        for Counts { sent, lost, overflowed, overtaken } in [there, back] {
            prop_assert_eq!(overflowed, 0);
            prop_assert!(lost + overtaken <= sent);
            prop_assert!(settings.loss > 0.0 || lost == 0);
        }
        prop_assert_eq!(there.sent, 300);
    }
}

#[test]
fn constant_delay_is_the_age_of_every_sample() {
    for delay in [0, 2, 5, 20] {
        let settings = DelaySettings { delay: MS * delay, ..DelaySettings::default() };
        let mut link = DelayedSide::new(Far::default(), settings);
        let samples = exchanged(&mut link, 0..200);
        assert_eq!(samples.len(), 200 - usize::try_from(2 * delay).unwrap());
        for sample in samples {
            assert_eq!(ages(&sample).0, MS * (2 * delay), "{delay} ms");
        }
    }
}

#[test]
fn reordered_datagrams_are_dropped() {
    let settings = DelaySettings { jitter: MS * 10, reorders: true, ..DelaySettings::default() };
    let mut link = DelayedSide::new(Far::default(), settings);
    exchanged(&mut link, 0..1_000);
    let [there, back] = link.counts().unwrap();
    assert!(there.overtaken > 100 && back.overtaken > 100, "{there:?} {back:?}");
}

#[test]
fn lost_share_is_that_of_the_settings() {
    let settings = DelaySettings { loss: 0.2, ..DelaySettings::default() };
    let mut link = DelayedSide::new(Far::default(), settings);
    exchanged(&mut link, 0..5_000);
    let [there, back] = link.counts().unwrap();
    for Counts { sent, lost, .. } in [there, back] {
        assert!((sent * 17 / 100..sent * 23 / 100).contains(&lost), "{lost} of {sent}");
    }
}

#[test]
fn far_side_holds_from_an_outage_until_a_new_epoch() {
    let outage = [MS * (WARM_UP + 100), MS * (WARM_UP + 300)];
    let settings = DelaySettings {
        delay: MS * 5,
        outage: Some(outage),
        hold_after: MS * 50,
        ..DelaySettings::default()
    };
    let mut link = armed(settings);
    let samples = exchanged(&mut link, WARM_UP..WARM_UP + 400);
    link.begin_epoch();
    exchanged(&mut link, WARM_UP + 400..WARM_UP + 500);
    let far = link.far();
    assert_eq!(far.commands.len(), 500, "its cycle runs whatever arrives");
    let follows = far.commands.iter().filter(|(_, motion)| *motion != Motion::Hold);
    let follows: Vec<Instant> = follows.map(|(now, _)| *now).collect();
    // From 5 ms after an arming. The newest echo before the outage was sent 6 ms before the last command.
    let expected = (5..144).chain(405..500).map(|millis| at(WARM_UP + millis));
    assert_eq!(follows, expected.collect::<Vec<_>>());
    let age = |millis| {
        let sample = samples.iter().find(|(now, _)| *now == at(WARM_UP + millis));
        sample.map(|one| ages(one).0)
    };
    assert!(age(299) >= Some(MS * 199), "{:?}", age(299));
    assert_eq!(age(320), Some(MS * 10));
}

#[test]
fn epoch_begins_at_the_far_side_when_its_first_command_arrives() {
    let mut link = armed(DelaySettings { delay: MS * 5, ..DelaySettings::default() });
    let before = link.far().epochs;
    for (millis, begun) in [(0..5, 0), (5..10, 1)] {
        exchanged(&mut link, WARM_UP + millis.start..WARM_UP + millis.end);
        assert_eq!(link.far().epochs - before, begun);
    }
    let mut direct = DelayedSide::direct(Far::default());
    direct.begin_epoch();
    assert_eq!(direct.far().epochs, 1);
}

#[test]
fn sample_that_the_far_side_repeats_gets_no_newer_stamp() {
    let mut link = DelayedSide::new(Far::default(), DelaySettings::default());
    exchanged(&mut link, 0..10);
    link.far_mut().is_frozen = true;
    let stamps: Vec<Instant> =
        exchanged(&mut link, 10..20).iter().map(|(_, sensed)| sensed.at).collect();
    assert_eq!(stamps, [at(9); 10]);
}

#[test]
fn datagrams_beyond_the_queue_are_lost_and_counted() {
    let settings = DelaySettings { delay: MS * 4, ..DelaySettings::default() };
    let mut link = DelayedSide::new(Far::default(), settings);
    for micros in 0..1_000 {
        link.exchange(Instant::from_micros(micros), &Command::HOLD);
    }
    let [there, _] = link.counts().unwrap();
    assert_eq!(there, Counts { sent: 1_000, overflowed: 1_000 - 20, ..Counts::default() });
}

#[test]
fn far_side_does_not_catch_up_with_a_long_pause() {
    let mut link = DelayedSide::new(Far::default(), DelaySettings::default());
    exchanged(&mut link, 0..2);
    exchanged(&mut link, 60_000..60_001);
    assert_eq!(link.far().commands.len(), 3);
}

#[test]
fn direct_connection_changes_nothing() {
    let (mut far, mut link) = (Far::default(), DelayedSide::direct(Far::default()));
    for millis in 0..10 {
        let command = numbered(millis).into();
        assert_eq!(link.exchange(at(millis), &command), far.exchange(at(millis), &command));
    }
    assert_eq!(link.counts(), None);
}
