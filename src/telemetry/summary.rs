//! Summary of a session: counters and extremes over all its records.

use std::fmt;

use nalgebra::Isometry3;
use serde::Serialize;

use crate::contact::Contact;
use crate::contact_posture::ContactPostures;
use crate::fidelity::{Report, WrenchSource};
use crate::losses::Losses;
use crate::origin::Origin;
use crate::recording::RecordingReport;
use crate::shaking::Shaking;
use crate::status::ModelDifference;
use crate::timing::{Timing, TimingReport};
use node::cause::Cause;
use node::record::{Mode, Record};
use units::numbering::Joint;
use units::spatial::Motion;
use units::time::Instant;
use units::wording::counted;

/// Maximum contact force of free motion, in which the object should follow its command, in N.
const FREE_MOTION_FORCE: f64 = 0.5;

/// Counters and extremes of a session.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// Origin of time of `bus.log`, fault records and messages.
    pub origin: Origin,
    /// Set if the user ended the session early.
    pub is_interrupted: bool,
    /// Cycles run.
    pub cycles: u64,
    /// Time from the first SYNC to the last, in s.
    pub seconds: f64,
    /// Cycles whose torques were too late to be sent, or whose SYNC was skipped.
    pub overruns: u64,
    /// Cycles in which at least one joint's sample was missing.
    pub cycles_with_missing_samples: u64,
    /// Position samples not received in time, over all joints.
    pub missing_samples: u64,
    /// Frames, records and events lost before the disk. The other figures exclude lost records.
    pub lost: Losses,
    /// Parts of the recorded session, and the reason of an early end; `None` without a recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub recording: Option<RecordingReport>,
    /// Time engaged, in s.
    pub engaged_seconds: f64,
    /// Changes from armed to engaged.
    pub engagements: u64,
    /// Peak force of task and passivity damper at the grip, in N.
    pub peak_felt_force_n: f64,
    /// Peak moment of both at the grip, in N·m.
    pub peak_felt_moment_nm: f64,
    /// Peak contact force on the object, in N.
    pub peak_contact_force_n: f64,
    /// Time in contact while engaged, in s.
    pub contact_seconds: f64,
    /// Quality of contact.
    pub contact: Contact,
    /// Contact in postures outside the bounds.
    pub contact_posture: ContactPostures,
    /// Shaking of a robot in free motion.
    pub shaking: Shaking,
    /// Fidelity of wrench reflection, measured at the hand in a simulation, and by the commanded torques on drives.
    pub fidelity: Option<Report>,
    /// Cycles in which torque was scaled down to the limits of the joints.
    pub saturated_cycles: u64,
    /// Last joint, from 1, that friction compensation drove without a hand. The compensation was then withdrawn.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub self_driven_joint: Option<u8>,
    /// RMS of commanded minus actual speed in rate mode and free motion, in m/s.
    pub rate_tracking_rms_m_per_s: f64,
    /// RMS of commanded minus actual position in pose mode and free motion, in m.
    pub pose_tracking_rms_m: f64,
    /// Distance travelled by the object, in m.
    pub object_travel_m: f64,
    /// Maximum difference between robot and model; `None` without a model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelDifference>,
    /// Load of each bus, in percent of its bitrate.
    pub bus_load_percent: Vec<f64>,
    /// Timing of the cycles; `None` in virtual time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub timing: Option<TimingReport>,
    /// Histograms of these times, written to a separate file.
    #[serde(skip)]
    pub histograms: Option<Timing>,
    /// Number of frames on each bus.
    pub bus_frames: Vec<u64>,
    /// Mode at the end.
    pub final_mode: String,
    /// Cause of the stop, if stopped at the end.
    pub stopped_by: Option<String>,
    #[serde(skip)]
    rate_error: Rms,
    #[serde(skip)]
    pose_error: Rms,
    #[serde(skip)]
    first: Option<Instant>,
    /// Mode and cause of the last record.
    #[serde(skip)]
    ended: Option<(Mode, Option<Cause>)>,
    #[serde(skip)]
    last: Option<(Instant, Mode, Isometry3<f64>)>,
}

impl Summary {
    /// Creates an empty summary; `postures` checks its contacts.
    #[must_use]
    pub fn judging(postures: ContactPostures) -> Self {
        Self { contact_posture: postures, ..Self::default() }
    }

    /// Adds the next record.
    pub fn add(&mut self, record: &Record) {
        let missing = record.sampled.iter().filter(|sampled| !**sampled).count();
        self.cycles += 1;
        self.overruns = record.overruns;
        self.missing_samples += u64::try_from(missing).unwrap_or(0);
        self.cycles_with_missing_samples += u64::from(missing > 0);
        self.saturated_cycles += u64::from(record.output.is_saturated());
        let self_driven = record.output.ledger.self_driven.map(Joint::number);
        self.self_driven_joint = self_driven.or(self.self_driven_joint);
        self.contact.add(record);
        let most = self.model.unwrap_or_default();
        self.model = record.model.map(|model| most.max(ModelDifference::new(model))).or(self.model);
        // Formatted only at a change, so that cycles of a steady state do not allocate.
        let ended = Some((record.mode, record.cause));
        if std::mem::replace(&mut self.ended, ended) != ended {
            self.final_mode = record.mode.to_string();
            self.stopped_by = record.cause.map(|cause| cause.to_string());
        }

        let first = *self.first.get_or_insert(record.at);
        self.seconds = record.at.since(first).as_secs_f64();
        if let Some((at, mode, x_b_m)) = self.last {
            let dt = record.at.since(at).as_secs_f64();
            self.shaking.add(&record.f_s, dt);
            let moved = (record.x_b_m.translation.vector - x_b_m.translation.vector).norm();
            self.object_travel_m += moved;
            if record.mode == Mode::Engaged {
                self.engaged_seconds += dt;
                self.engagements += u64::from(mode != Mode::Engaged);
                self.contact_posture.add(record, dt);
                self.engaged(record, moved, dt);
            }
        }
        self.last = Some((record.at, record.mode, record.x_b_m));
    }

    fn engaged(&mut self, record: &Record, moved: f64, dt: f64) {
        let contact = record.f_s.force.norm();
        let felt = record.output.f_g_task + record.output.port.f_g_passivity;
        self.peak_contact_force_n = self.peak_contact_force_n.max(contact);
        self.peak_felt_force_n = self.peak_felt_force_n.max(felt.force.norm());
        self.peak_felt_moment_nm = self.peak_felt_moment_nm.max(felt.moment.norm());
        if contact > FREE_MOTION_FORCE {
            self.contact_seconds += dt;
            return;
        }
        match record.output.command {
            Motion::Hold => {}
            Motion::Rate(v_m) => self.rate_error.add(v_m.linear.norm() - moved / dt),
            Motion::Pose(x_b_d) => self
                .pose_error
                .add((x_b_d.translation.vector - record.x_b_m.translation.vector).norm()),
        }
        self.rate_tracking_rms_m_per_s = self.rate_error.value();
        self.pose_tracking_rms_m = self.pose_error.value();
    }
}

/// Formats the summary for people.
impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "cycles            {} in {:.3} s", self.cycles, self.seconds)?;
        if self.overruns > 0 {
            writeln!(f, "overruns          {}", counted(self.overruns, "cycle"))?;
        }
        for (name, percentiles) in self.timing.iter().flat_map(TimingReport::rows) {
            writeln!(f, "{name:17} {percentiles}")?;
        }
        writeln!(
            f,
            "missed samples    {} in {}",
            self.missing_samples,
            counted(self.cycles_with_missing_samples, "cycle")
        )?;
        if !self.lost.is_empty() {
            writeln!(f, "not recorded      {}", self.lost)?;
        }
        if let Some(recording) = self.recording.as_ref().filter(|it| it.ended_early.is_some()) {
            writeln!(f, "recording         {recording}")?;
        }
        writeln!(
            f,
            "engaged           {:.1} s in {}, {:.1} s of it in contact",
            self.engaged_seconds,
            counted(self.engagements, "spell"),
            self.contact_seconds
        )?;
        writeln!(
            f,
            "peak wrench felt  {:.2} N, {:.3} N·m (contact {:.1} N)",
            self.peak_felt_force_n, self.peak_felt_moment_nm, self.peak_contact_force_n
        )?;
        writeln!(
            f,
            "tracking, free    {:.2} mm/s rms in rate mode, {:.2} mm rms in pose mode",
            self.rate_tracking_rms_m_per_s * 1e3,
            self.pose_tracking_rms_m * 1e3
        )?;
        self.fmt_contact(f)?;
        writeln!(f, "object travelled  {:.2} m", self.object_travel_m)?;
        if let Some(ModelDifference { distance_mm, angle_deg }) = self.model {
            writeln!(f, "robot to model    {distance_mm:.1} mm and {angle_deg:.1}° at most")?;
        }
        if self.shaking.is_reported() {
            writeln!(f, "robot             {}", self.shaking)?;
        }
        writeln!(f, "torque limited    {}", counted(self.saturated_cycles, "cycle"))?;
        if let Some(joint) = self.self_driven_joint {
            writeln!(
                f,
                "friction          compensation withdrawn: it drove joint {joint} by itself; measure its friction"
            )?;
        }
        for (bus, (load, frames)) in self.bus_load_percent.iter().zip(&self.bus_frames).enumerate()
        {
            writeln!(f, "bus {bus} load        {load:.1} % ({})", counted(frames, "frame"))?;
        }
        self.fmt_end(f)
    }
}

impl Summary {
    /// Formats the last mode, with the cause of a stop.
    fn fmt_end(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ended             {}", self.final_mode)?;
        if let Some(cause) = &self.stopped_by {
            write!(f, ": {cause}")?;
        }
        if self.is_interrupted { f.write_str(" (interrupted)") } else { Ok(()) }
    }

    /// Formats the quality of contact.
    fn fmt_contact(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.contact_seconds <= 0.0 {
            writeln!(f, "contact           none above {FREE_MOTION_FORCE} N while engaged")?;
            return self.fmt_fidelity(f);
        }
        writeln!(
            f,
            "contact           {}, at most {:.0} mm/s, {:+.1} mJ from the hand (lowest {:+.1} mJ)",
            counted(self.contact.reversals, "reversal"),
            self.contact.peak_speed_m_per_s * 1e3,
            self.contact.energy_j * 1e3,
            self.contact.lowest_energy_j * 1e3
        )?;
        if self.contact_posture.poor_seconds > 0.0 {
            writeln!(f, "contact posture   {}", self.contact_posture)?;
        }
        self.fmt_fidelity(f)
    }

    /// Formats the difference of the felt from the reflected wrench.
    fn fmt_fidelity(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(fidelity) = &self.fidelity {
            let place = match fidelity.judged {
                WrenchSource::Hand => "felt at the hand ",
                WrenchSource::Command => "commanded forces ",
            };
            writeln!(f, "{place} {fidelity}")?;
        }
        Ok(())
    }
}

/// Running root mean square.
#[derive(Clone, Copy, Debug, Default)]
struct Rms {
    sum_of_squares: f64,
    count: f64,
}

impl Rms {
    fn add(&mut self, value: f64) {
        self.sum_of_squares += value * value;
        self.count += 1.0;
    }

    fn value(self) -> f64 {
        if self.count > 0.0 { (self.sum_of_squares / self.count).sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn session_without_contact_says_so_in_place_of_zeros() {
        let text = |contact_seconds| {
            let summary = Summary { engaged_seconds: 6.0, contact_seconds, ..Summary::default() };
            summary.to_string()
        };
        let none = "contact           none above 0.5 N while engaged\n";
        assert!(text(0.0).contains(none), "{}", text(0.0));
        assert!(text(0.1).contains("contact           0 reversals, "), "{}", text(0.1));
    }
}
