//! Random gain sets as configuration files.

use std::fmt;

use crate::common::prelude::*;
use sim::random::SplitMix;

/// Shipped files whose gains are replaced.
const ARMS: [&str; 3] = ["kraft_like", "jpl_like", "sixr_spherical"];

/// Gains of a file, with the stiffness of its surfaces.
#[derive(Clone, Copy, Debug)]
pub(super) struct GainSet {
    arm: &'static str,
    wrench: f64,
    pub(super) pose: f64,
    rate: f64,
    damping: f64,
    accommodation: f64,
    stiffness: f64,
}

impl GainSet {
    /// Draws a set, each gain evenly on a logarithmic scale.
    pub(super) fn random(random: &mut SplitMix) -> Self {
        let arm = ARMS[usize::try_from(random.bits() % 3).unwrap()];
        let mut within = |low: f64, high: f64| low * (high / low).powf(random.unit());
        Self {
            arm,
            wrench: within(0.05, 1.0),
            pose: within(0.4, 2.0),
            rate: within(0.5, 6.0),
            damping: within(1.0, 60.0),
            accommodation: within(0.001, 0.02),
            stiffness: within(500.0, 20_000.0),
        }
    }

    /// Returns the file's configuration with these gains, which its gain check warns of only. `moved` names a joint whose
    /// start moves by a share of its range.
    pub(super) fn config(&self, moved: Option<&(String, f64)>) -> Config {
        let file = format!("config/{}.toml", self.arm);
        let text = fs::read_to_string(&file).unwrap();
        let text = self.replaced(&text);
        let config = parse(&file, &text);
        let Some((name, share)) = moved else { return config };
        let place = config.joints.iter().position(|joint| joint.name == *name).unwrap();
        let [low, high] = config.controller.arm.ranges()[place];
        let start = (config.joints[place].plant.start + share * (high - low)).clamp(low, high);
        parse(&file, &starting(&text, name, start))
    }

    fn replaced(&self, text: &str) -> String {
        let Self { wrench, pose, rate, damping, accommodation, stiffness, .. } = *self;
        let moments = wrench / 2.0;
        let wrench = format!("[{wrench}, {wrench}, {wrench}, {moments}, {moments}, {moments}]");
        let keys = [
            ("[controller]", "wrench_gain", wrench),
            ("[controller]", "pose_gain", format!("{:?}", [pose; 6])),
            ("[controller]", "rate_gain_per_s", format!("{:?}", [rate, rate, rate, 1.5, 1.5, 1.5])),
            ("[controller]", "damping_ns_per_m", format!("{:?}", [damping; 3])),
            ("[controller]", "max_moment_nm", "2.0\ngain_check = \"warn\"".to_owned()),
            ("[remote]", "accommodation_m_per_ns", accommodation.to_string()),
            ("[remote.wall]", "stiffness_n_per_m", stiffness.to_string()),
            ("[remote.box]", "stiffness_n_per_m", stiffness.to_string()),
        ];
        let mut section = "";
        let lines = text.lines().map(|line| {
            if line.starts_with('[') {
                section = line.split(' ').next().unwrap();
            }
            let is_key = |(of, key, _): &&(&str, &str, String)| {
                *of == section && line.starts_with(&format!("{key} ="))
            };
            let replaced = keys.iter().find(is_key);
            replaced.map_or_else(|| line.to_owned(), |(_, key, value)| format!("{key} = {value}"))
        });
        lines.collect::<Vec<_>>().join("\n")
    }
}

/// Returns the file with another start of this joint, in rad or m.
fn starting(text: &str, joint: &str, start: f64) -> String {
    let mut is_joint = false;
    let lines = text.lines().map(|line| {
        if line.starts_with('[') {
            is_joint = false;
        } else if line.starts_with("name = ") {
            is_joint = line.contains(&format!("\"{joint}\""));
        }
        match line.split(' ').next() {
            Some("rest_deg") if is_joint => format!("rest_deg = {:?}", start.to_degrees()),
            Some("rest_m") if is_joint => format!("rest_m = {start:?}"),
            _ => line.to_owned(),
        }
    });
    lines.collect::<Vec<_>>().join("\n")
}

impl fmt::Display for GainSet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { arm, wrench, pose, rate, damping, accommodation, stiffness } = self;
        write!(
            f,
            "{arm}: K_T {wrench:.3}, K_P {pose:.2}, K_V {rate:.2} 1/s, K_D {damping:.1} N·s/m, K_FA {accommodation:.4} m/(N·s), \
             k_e {stiffness:.0} N/m"
        )
    }
}
