//! A controller that is stepped without a node: its settings, and any input for it.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use proptest::prelude::*;

use crate::common::oracle;
use crate::common::prelude::*;
use controller::assist::ContactFade;
use controller::calibration::{Calibration, JointCalibration, TorqueCurve};
use controller::channels::Channels;
use controller::command::CommandLaw;
use controller::engagement::Engagement;
use controller::friction::{FrictionCompensation, FrictionSettings};
use controller::gains::Gains;
use controller::interpretation::Interpretation;
use controller::limits::{AssistFraction, Slew};
use controller::orientation::Orientation;
use controller::passivity::{Passivity, PassivitySettings};
use controller::period::Period;
use controller::reflection::Reflection;
use controller::soft_stops::SoftStops;
use controller::switches::{CommandMode, Switches};
use controller::tank::{Tank, TankSettings};
use controller::velocity::Filter;
use controller::virtual_coupling::VirtualCoupling;
use controller::{Controller, Extensions, Input, JointVector, Output, Settings};

pub(crate) const NEUTRAL: [f64; 6] = [0.1, -0.87, 1.66, -0.79, 0.1, 0.2];

pub(crate) const MAX_TORQUES: [f64; 6] = [6.0, 6.0, 4.0, 1.2, 1.0, 0.8];

pub(crate) const PERIOD: f64 = 1e-3;

pub(crate) const UP: Switches = Switches { deadman: false, reference: false, reflection: false };

pub(crate) const DEADMAN: Switches = Switches { deadman: true, ..UP };

pub(crate) const REFERENCE: Switches = Switches { reference: true, ..DEADMAN };

const REFLECTION: Switches = Switches { reflection: true, ..DEADMAN };

pub(crate) fn settings() -> Settings {
    let gains = |values| Gains::new(values, "gain").unwrap();
    let curve = |max_torque| TorqueCurve::new([150.0, 1.0, 0.01], max_torque).unwrap();
    // One count is about 1e-9 rad, below any tolerance here.
    let joint = |max_torque| {
        let ratio = 1e5 * std::f64::consts::TAU;
        JointCalibration::new(10_000, ratio, -5, curve(max_torque)).unwrap()
    };
    Settings {
        interpretation: Interpretation::CONSISTENT,
        period: Period::new(PERIOD).unwrap(),
        arm: oracle::arm("kraft_like"),
        calibration: Calibration::new(MAX_TORQUES.map(joint)),
        channels: Channels::new(
            [0.01, 0.01, 0.01, 0.06, 0.06, 0.06],
            [2.0, 2.0, 2.0, 0.08, 0.08, 0.08],
        )
        .unwrap(),
        command: CommandLaw {
            rate_gain: gains([2.0, 2.0, 2.0, 1.5, 1.5, 1.5]),
            pose_gain: gains([1.0; 6]),
            pose_deadband: false,
        },
        reflection: Reflection::new(
            Isometry3::translation(0.0, 0.0, -0.05),
            gains([1.0; 6]),
            1e3,
            1e3,
        )
        .unwrap(),
        damping: gains([8.0, 8.0, 8.0, 0.02, 0.02, 0.02]),
        assist_fraction: AssistFraction::new(0.35).unwrap(),
        bounds: controller::adjustment::Bounds::FIXED,
        dry_friction: JointVector::zeros(),
        extensions: Extensions::default(),
    }
}

pub(crate) fn by_rotation_vector() -> Settings {
    let orientation = Orientation::RotationVector;
    Settings {
        interpretation: Interpretation { orientation, ..Interpretation::CONSISTENT },
        ..settings()
    }
}

pub(crate) fn as_printed() -> Settings {
    Settings { interpretation: Interpretation::PAPER_1997, ..settings() }
}

/// Returns settings with every optional layer, tuned so that each acts.
pub(crate) fn everything() -> Settings {
    let plain = settings();
    let gains = |linear, angular| {
        Gains::new([linear, linear, linear, angular, angular, angular], "gain").unwrap()
    };
    let max_torques = plain.calibration.max_torques();
    let extensions = Extensions {
        velocity_filter: Filter::new(0.005).unwrap(),
        walls_in_pose: true,
        contact_fade: Some(ContactFade::new(5.0).unwrap()),
        damping_never_pulls: true,
        engagement: Some(Engagement::new(0.05, None, plain.period).unwrap()),
        soft_stops: Some(SoftStops::new(plain.arm.ranges(), &max_torques, 0.1, 0.5).unwrap()),
        friction: Some(
            FrictionCompensation::new(FrictionSettings {
                share: 0.7,
                coulomb: max_torques * 0.01,
                viscous: max_torques * 0.004,
                presliding: JointVector::repeat(1e-3),
            })
            .unwrap(),
        ),
        slew: Some(Slew::new(&max_torques, 0.02, plain.period).unwrap()),
        passivity: Some(
            Passivity::new(PassivitySettings {
                max_energy: 0.05,
                max_damping: 20.0,
                lever: 0.1,
                contact_threshold: 0.1,
                contact_release_cycles: 500,
                is_one_sided: true,
            })
            .unwrap(),
        ),
        tank: Some(
            Tank::new(TankSettings {
                initial: 0.1,
                min: 0.0,
                low: 0.02,
                max: 0.5,
                refill: 50.0,
                max_damping: 60.0,
            })
            .unwrap(),
        ),
        virtual_coupling: Some(VirtualCoupling::new(
            gains(400.0, 5.0),
            gains(2.0, 0.02),
            plain.period,
        )),
    };
    let channels = plain.channels.with_wall([0.1; 6], [200.0; 6]).unwrap();
    Settings { extensions, channels, ..plain }
}

/// A controller and its input.
pub(crate) struct Bench {
    pub(crate) controller: Controller,
    pub(crate) calibration: Calibration<6>,
    pub(crate) input: Input,
}

impl Bench {
    /// Creates a controller and runs one cycle with all switches open.
    pub(crate) fn new(settings: &Settings, mode: CommandMode) -> Self {
        let mut bench = Self {
            controller: Controller::new(settings),
            calibration: settings.calibration,
            input: Input {
                counts: settings.calibration.counts(&JointVector::from(NEUTRAL)),
                f_s: Wrench::ZERO,
                x_b_m: Isometry3::translation(0.4, 0.0, 0.3),
                switches: UP,
                mode,
                gravity_share: 1.0,
                reflection_share: 1.0,
                hold: false,
                held: None,
                restart: true,
            },
        };
        bench.press(UP);
        bench.input.restart = false;
        bench
    }

    /// Creates a controller with the deadman held, the reference set at the neutral posture, and reflection on.
    pub(crate) fn engaged(settings: &Settings, mode: CommandMode) -> Self {
        let mut bench = Self::new(settings, mode);
        bench.press(REFLECTION);
        bench.press(REFERENCE);
        bench.press(DEADMAN);
        bench
    }

    pub(crate) fn press(&mut self, switches: Switches) -> Output {
        self.input.switches = switches;
        self.controller.step(&self.input)
    }

    pub(crate) fn at(&mut self, q: [f64; 6]) -> Output {
        self.input.counts = self.calibration.counts(&JointVector::from(q));
        self.controller.step(&self.input)
    }
}

pub(crate) fn displaced(by: f64) -> [f64; 6] {
    NEUTRAL.map(|q| q + by)
}

pub(crate) fn joints() -> impl Strategy<Value = [f64; 6]> {
    prop::array::uniform6(-0.3..0.3_f64)
        .prop_map(|by| [0, 1, 2, 3, 4, 5].map(|joint| NEUTRAL[joint] + by[joint]))
}

pub(crate) fn wrench(size: f64) -> impl Strategy<Value = Wrench> {
    prop::array::uniform6(-size..size).prop_map(Wrench::from_components)
}

pub(crate) fn mode() -> impl Strategy<Value = CommandMode> {
    prop_oneof![Just(CommandMode::Rate), Just(CommandMode::Pose)]
}

pub(crate) fn switches() -> impl Strategy<Value = Switches> {
    any::<[bool; 3]>().prop_map(|[deadman, reference, reflection]| Switches {
        deadman,
        reference,
        reflection,
    })
}

/// Generates any 64-bit float, with infinities, NaN, subnormals and the ends of the range more often.
pub(crate) fn any_float() -> impl Strategy<Value = f64> {
    let edges = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        f64::MIN_POSITIVE / 2.0,
        1e308,
        -1e308,
        -0.0,
        1e5,
    ];
    prop_oneof![prop::num::f64::ANY, prop::sample::select(edges.to_vec()), -1e6..1e6_f64]
}

pub(crate) fn any_pose() -> impl Strategy<Value = Isometry3<f64>> {
    prop::array::uniform7(any_float()).prop_map(|[x, y, z, w, i, j, k]| {
        let rotation = nalgebra::Quaternion::new(w, i, j, k);
        Isometry3::from_parts(Vector3::new(x, y, z).into(), UnitQuaternion::new_unchecked(rotation))
    })
}
