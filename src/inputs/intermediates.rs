//! Digest of the control law's intermediates, in the order of Fig. 3. One byte for each is enough to name the first that
//! differs in a replay.

use nalgebra::Isometry3;

use controller::command::Gate;
use controller::reference::Displacement;
use controller::switches::Permissions;
use controller::{JointVector, Ledger, Output};
use units::spatial::{Motion, Twist, Wrench};

/// Number of intermediates.
pub const COUNT: usize = 20;

/// One byte for each intermediate of a cycle. Equal bits give equal bytes; different bits give different bytes with a
/// probability of 255 in 256.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Digest(pub [u8; COUNT]);

impl Digest {
    /// Returns the digest of a cycle.
    pub fn from_output(output: &Output) -> Self {
        Self(each(output).map(|(_, mix)| mix.byte()))
    }

    /// Returns the name, as in STYLE.md, of the first intermediate of `output` that differs from the digest.
    pub fn first_difference(&self, output: &Output) -> Option<&'static str> {
        let found = each(output).into_iter().zip(self.0);
        found.into_iter().find_map(|((name, mix), byte)| (mix.byte() != byte).then_some(name))
    }
}

/// Returns the intermediates in the order in which they are computed.
fn each(output: &Output) -> [(&'static str, Mix); COUNT] {
    let Output { reference, twist, port, ledger, .. } = output;
    let port_state = [port.activity, port.energy.unwrap_or(0.0), port.tank.unwrap_or(0.0)];
    let faults = u64::from(output.invalid_value.is_some())
        | u64::from(output.joint_out_of_range.is_some()) << 1;
    [
        ("q", Mix::new().vector(&output.q)),
        ("x_0_g", Mix::new().pose(&output.x_0_g)),
        ("v_g", Mix::new().twist(&twist.v_g_raw).twist(&twist.v_g)),
        ("switches", Mix::new().permissions(&output.permissions)),
        ("reference", Mix::new().pose(&reference.x_0_h).pose(&reference.x_b_r)),
        ("x_h_g", Mix::new().pose(&output.x_h_g)),
        ("dx", Mix::new().displacement(&output.dx)),
        ("dx_db", Mix::new().displacement(&output.dx_db)),
        ("gate", Mix::new().gate(output.gate)),
        ("command", Mix::new().motion(&output.command)),
        ("f_m_task", Mix::new().wrench(&output.f_m_task)),
        ("f_g_task", Mix::new().wrench(&output.f_g_task)),
        ("f_g_passivity", Mix::new().wrench(&port.f_g_passivity)),
        ("energy", Mix::new().numbers(&port_state)),
        ("f_g_centring", Mix::new().wrench(&output.f_g_centring)),
        ("f_g_damping", Mix::new().wrench(&output.f_g_damping)),
        ("ledger", Mix::new().ledger(ledger)),
        ("tau", Mix::new().vector(&output.tau)),
        ("targets", Mix::new().numbers(&output.targets.map(|target| f64::from(target.0)))),
        ("fault", Mix::new().word(faults)),
    ]
}

/// Hash of the bits of an intermediate: multiplications by an odd constant, each followed by an XOR of the upper half onto
/// the lower.
#[derive(Clone, Copy, Debug)]
struct Mix(u64);

impl Mix {
    const fn new() -> Self {
        Self(0)
    }

    /// Returns eight bits of the hash.
    fn byte(self) -> u8 {
        let [first, ..] = self.0.to_be_bytes();
        first
    }

    const fn word(self, word: u64) -> Self {
        // 2⁶⁴ divided by the golden ratio.
        let product = (self.0 ^ word).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        Self(product ^ product >> 32)
    }

    fn numbers<'a>(self, numbers: impl IntoIterator<Item = &'a f64>) -> Self {
        numbers.into_iter().fold(self, |mix, number| mix.word(number.to_bits()))
    }

    fn vector(self, vector: &JointVector) -> Self {
        self.numbers(vector.iter())
    }

    fn pose(self, pose: &Isometry3<f64>) -> Self {
        self.numbers(pose.translation.vector.iter()).numbers(pose.rotation.coords.iter())
    }

    fn twist(self, twist: &Twist) -> Self {
        self.numbers(&twist.components())
    }

    fn wrench(self, wrench: &Wrench) -> Self {
        self.numbers(&wrench.components())
    }

    fn displacement(self, dx: &Displacement) -> Self {
        self.numbers(dx.translation.iter()).numbers(dx.orientation.iter())
    }

    fn motion(self, motion: &Motion) -> Self {
        match motion {
            Motion::Hold => self.word(1),
            Motion::Rate(v_m) => self.word(2).twist(v_m),
            Motion::Pose(x_b_d) => self.word(3).pose(x_b_d),
        }
    }

    const fn gate(self, gate: Gate) -> Self {
        self.word(match gate {
            Gate::Released => 1,
            Gate::Waiting => 2,
            Gate::TurnedTooFar => 3,
            Gate::Open => 4,
        })
    }

    fn permissions(self, permissions: &Permissions) -> Self {
        let &Permissions {
            commands,
            task,
            centring,
            damping,
            reference,
            engaged,
            latches,
            reflects,
        } = permissions;
        let flags = [commands, task, centring, damping, reference, engaged, latches, reflects];
        self.word(flags.into_iter().fold(1, |bits, flag| bits << 1 | u64::from(flag)))
    }

    fn ledger(self, ledger: &Ledger) -> Self {
        let Ledger { task, gravity, centring, damping, passivity, soft_stops, friction, .. } =
            ledger;
        let requests = [task, gravity, centring, damping, passivity, soft_stops, friction];
        let mix = requests.into_iter().fold(self, |mix, request| mix.vector(request));
        mix.numbers(&[ledger.assist_scale, ledger.rest_scale, ledger.share])
    }
}
