//! Real-time settings of `frhc run` that the command line adds.

use bus::realtime::{self, Settings};
use clap::Args;

use crate::exit::{Failure, Kind};

/// Settings beyond priority, locked memory and exact timers, which are always requested.
#[derive(Clone, Copy, Debug, Default, Args)]
pub struct RealtimeArgs {
    /// Run the cycle on this processor alone; isolcpus= keeps other work off it.
    #[arg(long, value_name = "N")]
    pub cpu: Option<usize>,
    /// Let idle processors wake up within this time (/dev/cpu_dma_latency); 0 keeps them from sleeping.
    #[arg(long, value_name = "µs", value_parser = clap::value_parser!(i32).range(0..))]
    pub cpu_latency: Option<i32>,
    /// Do not start where the kernel refuses one of these settings, priority, locked memory or exact timers.
    #[arg(long)]
    pub require_realtime: bool,
}

impl RealtimeArgs {
    /// Checks that the processor exists.
    ///
    /// # Errors
    /// When no processor has this number.
    pub(super) fn check(&self) -> Result<(), Failure> {
        match self.cpu.filter(|cpu| !realtime::has_cpu(*cpu)) {
            Some(cpu) => {
                let reason = format!("--cpu {cpu}: this machine has no such processor");
                Err(Failure::new(Kind::Usage, reason))
            }
            None => Ok(()),
        }
    }

    pub(super) fn settings(&self) -> Settings {
        Settings { cpu: self.cpu, cpu_latency_us: self.cpu_latency, ..Settings::default() }
    }
}
