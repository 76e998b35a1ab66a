//! A whole loop, judged: every inequality with both its sides.

use std::fmt;

use crate::controller::stability::bounds;
use crate::controller::stability::bounds::Held;
use crate::controller::stability::bounds::Impedance;
use crate::controller::stability::bounds::RateReflection;

/// The axes' names, in the order of every six-vector of the paper.
const NAMES: [&str; 6] = ["x", "y", "z", "about x", "about y", "about z"];

/// One axis of the loop, at one posture. Rotations are in rad, N·m and kg·m².
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Axis {
    /// Viscous damping of the device at the grip, in N·s/m.
    pub device_damping: f64,
    /// Dry friction of the device at the grip, in N.
    pub friction: f64,
    /// Apparent mass of the device at the grip, in kg.
    pub mass: f64,
    /// What one count of an encoder is at the grip, in m.
    pub quantum: f64,
    /// Of the hand, in N/m.
    pub hand_stiffness: f64,
    /// Of the hand, in N·s/m.
    pub hand_damping: f64,
    /// K_V, in 1/s.
    pub rate_gain: f64,
    /// K_P.
    pub pose_gain: f64,
    /// K_T.
    pub wrench_gain: f64,
    /// K_D, in N·s/m.
    pub damping: f64,
    /// Plateau of the return to centre, in N.
    pub plateau: f64,
    /// Half-width of the deadband, in m.
    pub deadband: f64,
    /// Stiffest thing the object can meet, in N/m; zero where it meets nothing.
    pub environment: f64,
    /// K_FA, in m/s per N.
    pub accommodation: f64,
    /// Stiffness and damping of the virtual coupling, in N/m and N·s/m, if there is one.
    pub virtual_coupling: Option<[f64; 2]>,
}

/// The loop around six axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Loop {
    /// The cycle, in s.
    pub period: f64,
    /// How many cycles the assist is late, beyond the hold: until a synchronous target acts.
    pub assist_late: u32,
    /// How many the reflected wrench is late.
    pub reflection_late: u32,
    /// How old the wrench is that the object gives way to, in its own cycles.
    pub accommodation_late: u32,
    /// Time constant of the velocity filter, in s.
    pub velocity_filter: f64,
    /// Time constant of the object's servo, in s.
    pub servo_lag: f64,
    /// Whether the passivity layer watches contact.
    pub is_watched: bool,
    /// The axes.
    pub axes: [Axis; 6],
}

/// What a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Topic {
    /// Whether the object comes to rest against what it meets.
    Accommodation,
    /// Whether it rings while it does.
    ServoLag,
    /// Whether hand, device and object swing in rate mode.
    RateStability,
    /// Whether reflection in rate mode gives off energy.
    RatePassivity,
    /// Whether reflection in pose mode does.
    PosePassivity,
    /// Whether the virtual coupling does.
    VirtualCoupling,
    /// Whether damping by differences does.
    Damping,
    /// Whether the slope of the return to centre does.
    CentringSlope,
    /// Whether the return to centre moves the device at all.
    CentringFriction,
    /// Whether encoder steps are heard.
    Quantisation,
}

/// How an inequality came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It holds.
    Holds,
    /// It does not, and something else covers it.
    Warns,
    /// It does not, and nothing does.
    Refuses,
}

/// One inequality on one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Finding {
    /// What it is about.
    pub topic: Topic,
    /// The axis.
    pub axis: &'static str,
    /// The inequality, in symbols.
    pub inequality: &'static str,
    /// Its left side.
    pub left: f64,
    /// Its right side.
    pub right: f64,
    /// Their unit.
    pub unit: &'static str,
    /// How it came out.
    pub verdict: Verdict,
    /// What that means.
    pub meaning: &'static str,
}

impl Loop {
    /// Everything there is to say about it.
    pub fn findings(&self) -> Vec<Finding> {
        let axes = (0..).zip(NAMES).zip(&self.axes);
        axes.flat_map(|((place, name), axis)| {
            let judged = Judged { around: self, axis, name, turns: place >= 3 };
            judged.findings()
        })
        .collect()
    }
}

/// One axis in its loop.
struct Judged<'l> {
    around: &'l Loop,
    axis: &'l Axis,
    name: &'static str,
    turns: bool,
}

impl Judged<'_> {
    fn findings(&self) -> Vec<Finding> {
        let Axis { environment, wrench_gain, pose_gain, damping, plateau, .. } = *self.axis;
        let meets = environment > 0.0;
        let feels = meets && wrench_gain > 0.0;
        let mut found = Vec::new();
        if meets && self.axis.accommodation > 0.0 {
            found.extend([self.accommodation(), self.servo_lag()]);
        }
        if feels && self.axis.rate_gain > 0.0 {
            found.extend([self.rate_stability(), self.rate_passivity()]);
        }
        if let Some([stiffness, damping]) = self.axis.virtual_coupling {
            let gain = wrench_gain * pose_gain;
            let coupled = Impedance {
                stiffness: stiffness * gain,
                damping: damping * gain,
                filter: 0.0,
                late: self.around.reflection_late,
            };
            let symbols = "sup Colgate(K_T K_P (K_vc, B_vc), n) < b";
            found.push(self.rendered(Topic::VirtualCoupling, symbols, &coupled));
        } else if feels && pose_gain > 0.0 {
            let wall = Impedance {
                stiffness: wrench_gain * pose_gain * environment,
                late: self.around.reflection_late,
                ..Impedance::default()
            };
            let symbols = "K_T K_P k_e T (1/2 + n) < b";
            found.push(self.rendered(Topic::PosePassivity, symbols, &wall));
        }
        if damping > 0.0 {
            let damper = Impedance {
                damping,
                filter: self.around.velocity_filter,
                late: self.around.assist_late,
                ..Impedance::default()
            };
            found.push(self.rendered(Topic::Damping, "sup Colgate(K_D, tau, n) < b", &damper));
        }
        if plateau > 0.0 {
            found.extend([self.centring_friction(), self.centring_slope(), self.quantisation()]);
        }
        found
    }

    fn accommodation(&self) -> Finding {
        let left = self.axis.accommodation * self.axis.environment * self.around.period;
        self.finding(
            Topic::Accommodation,
            ("K_FA k_e T < 2 cos(n pi / (2 n + 1))", ""),
            (left, bounds::accommodation_limit(self.around.accommodation_late)),
            [Verdict::Holds, Verdict::Refuses],
        )
    }

    fn servo_lag(&self) -> Finding {
        let left = self.axis.accommodation * self.axis.environment * self.around.servo_lag;
        let verdicts = [Verdict::Holds, Verdict::Warns];
        self.finding(Topic::ServoLag, ("K_FA k_e tau_s <= 1/4", ""), (left, 0.25), verdicts)
    }

    fn reflection(&self) -> RateReflection {
        RateReflection {
            rate_gain: self.axis.rate_gain,
            wrench_gain: self.axis.wrench_gain,
            accommodation: self.axis.accommodation,
            stiffness: self.axis.environment,
        }
    }

    fn rate_stability(&self) -> Finding {
        let held = Held {
            mass: self.axis.mass,
            damping: self.axis.device_damping + self.axis.hand_damping,
            stiffness: self.axis.hand_stiffness,
        };
        let [left, right] = self.reflection().routh(&held);
        self.finding(
            Topic::RateStability,
            ("M (K_h a + K_T k_e K_V) < (b + M a)(K_h + b a), a = K_FA k_e", "kg N/(m s)"),
            (left, right),
            [Verdict::Holds, Verdict::Refuses],
        )
    }

    fn rate_passivity(&self) -> Finding {
        let left = self.reflection().required_damping(self.around.period);
        let right = self.axis.device_damping + self.axis.damping;
        self.finding(
            Topic::RatePassivity,
            ("K_T K_V / K_FA (1 / (K_FA k_e) + T / 2) <= b + K_D", self.damping_unit()),
            (left, right),
            [Verdict::Holds, Verdict::Warns],
        )
    }

    fn centring_friction(&self) -> Finding {
        self.finding(
            Topic::CentringFriction,
            ("f_c < F_0", if self.turns { "N·m" } else { "N" }),
            (self.axis.friction, self.axis.plateau),
            [Verdict::Holds, Verdict::Refuses],
        )
    }

    fn centring_slope(&self) -> Finding {
        let slope = Impedance {
            stiffness: 2.0 * self.axis.plateau / self.axis.deadband,
            late: self.around.assist_late,
            ..Impedance::default()
        };
        self.rendered(Topic::CentringSlope, "2 F_0 / DB T (1/2 + n) < b", &slope)
    }

    fn quantisation(&self) -> Finding {
        let Axis { friction, quantum, device_damping, hand_damping, .. } = *self.axis;
        let damping = device_damping + hand_damping;
        let most = bounds::quantised_stiffness(damping, self.around.period, friction, quantum);
        self.finding(
            Topic::Quantisation,
            (
                "2 F_0 / DB <= min(2 b / T, 2 f_c / Delta)",
                if self.turns { "N·m/rad" } else { "N/m" },
            ),
            (2.0 * self.axis.plateau / self.axis.deadband, most),
            [Verdict::Holds, Verdict::Warns],
        )
    }

    /// An impedance against the damping there is: the device's alone, or with the hand that holds it.
    fn rendered(&self, topic: Topic, symbols: &'static str, impedance: &Impedance) -> Finding {
        let needed = impedance.required_damping(self.around.period);
        let Axis { device_damping, hand_damping, .. } = *self.axis;
        let with_hand = device_damping + hand_damping;
        let is_refused = needed >= with_hand;
        let right = if is_refused { with_hand } else { device_damping };
        let failed = if is_refused { Verdict::Refuses } else { Verdict::Warns };
        let symbols = (symbols, self.damping_unit());
        self.finding(topic, symbols, (needed, right), [Verdict::Holds, failed])
    }

    const fn damping_unit(&self) -> &'static str {
        if self.turns { "N·m·s/rad" } else { "N·s/m" }
    }

    fn finding(
        &self,
        topic: Topic,
        (inequality, unit): (&'static str, &'static str),
        (left, right): (f64, f64),
        [holds, fails]: [Verdict; 2],
    ) -> Finding {
        // A number that is none does not hold.
        let verdict = if left < right { holds } else { fails };
        let meaning = topic.meaning(verdict, self.around.is_watched);
        Finding { topic, axis: self.name, inequality, left, right, unit, verdict, meaning }
    }
}

impl Finding {
    /// By how many times the left side is too large, or how much of the right it takes.
    pub fn excess(&self) -> f64 {
        self.left / self.right
    }
}

impl Topic {
    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Accommodation => "force accommodation",
            Self::ServoLag => "servo lag",
            Self::RateStability => "rate mode, hand and object",
            Self::RatePassivity => "rate mode, passivity",
            Self::PosePassivity => "pose mode, reflection",
            Self::VirtualCoupling => "pose mode, virtual coupling",
            Self::Damping => "damping",
            Self::CentringSlope => "return to centre, slope",
            Self::CentringFriction => "return to centre, friction",
            Self::Quantisation => "return to centre, encoder steps",
        }
    }

    const fn meaning(self, verdict: Verdict, is_watched: bool) -> &'static str {
        match (verdict, self) {
            (Verdict::Holds, _) => "",
            (Verdict::Refuses, Self::Accommodation) => "the object never comes to rest in contact",
            (Verdict::Refuses, Self::RateStability) => "hand and object swing in contact",
            (Verdict::Refuses, Self::CentringFriction) => {
                "the device rests wherever it is let go; the centre is never reached"
            }
            (Verdict::Refuses, _) => "more than device and hand together can damp",
            (Verdict::Warns, Self::ServoLag) => "the object rings when it meets something",
            (Verdict::Warns, Self::Quantisation) => "steps of the encoder can be felt",
            (Verdict::Warns, Self::RatePassivity | Self::PosePassivity) if is_watched => {
                "the passivity layer must take back what contact gives off"
            }
            (Verdict::Warns, _) => "the device alone does not damp it; a hand must hold it",
        }
    }
}

impl Verdict {
    /// In one word.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Warns => "warning",
            Self::Refuses => "refused",
        }
    }
}

/// One line: the inequality, both sides, and what it means if it fails.
impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { topic, axis, inequality, left, right, unit, meaning, .. } = self;
        let sign = if left < right { "<" } else { ">=" };
        let space = if unit.is_empty() { "" } else { " " };
        write!(
            f,
            "{}, {axis}: {inequality}: {left:.4} {sign} {right:.4}{space}{unit}",
            topic.name()
        )?;
        if meaning.is_empty() { Ok(()) } else { write!(f, "; {meaning}") }
    }
}
