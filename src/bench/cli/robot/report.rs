//! Status of the robot, as a line of text or as one JSON object.

use serde_json::{Map, Value, json};

use crate::robot::sensor::SensorStatus;
use contract::{FarState, Gripper, Measurements, Pose};
use testbench::far_robot::Status;
use units::time::Instant;

/// Status of the robot and its connection.
#[derive(Clone, Debug)]
pub(super) struct Report {
    /// Status of the robot.
    pub(super) status: Status,
    /// Set if a node listens and sends.
    pub(super) is_connected: bool,
    /// Status of a real force/torque sensor, if configured.
    pub(super) sensor: Option<SensorStatus>,
}

impl Report {
    /// Returns the status in one line: lengths in m, joints in degrees.
    pub(super) fn text(&self) -> String {
        let Status { reason, leader: (session, epoch), measured, q, rejects, .. } = &self.status;
        let state = match reason.state() {
            FarState::Following => "follows".to_owned(),
            FarState::Holding => format!("holds: {reason}"),
        };
        let joints: Vec<_> = q.iter().map(|q| format!("{:.1}", q.to_degrees())).collect();
        let leader = match session {
            0 => "no leader".to_owned(),
            session => format!("leader {session:016x}, epoch {epoch}"),
        };
        let connection = if self.is_connected { "connected" } else { "not connected" };
        let rejects: Vec<_> =
            rejects.iter().map(|(reason, count)| format!("{count} {reason}")).collect();
        let rejects = if rejects.is_empty() { "none".to_owned() } else { rejects.join(", ") };
        let sensor = self.sensor.as_ref().map_or(String::new(), SensorStatus::text);
        format!(
            "{:.3} s  {state}  {connection}, {leader}  {}  joints {}°  rejected {rejects}{sensor}",
            self.seconds(),
            measured_text(measured),
            joints.join(" "),
        )
    }

    /// Returns the status as an object: SI units, session as 16 hexadecimal digits.
    pub(super) fn json(&self) -> Value {
        let Status { reason, leader: (session, epoch), measured, q, rejects, .. } = &self.status;
        let leader = (*session != 0)
            .then(|| json!({ "session": format!("{session:016x}"), "epoch": epoch }));
        let pose = measured.pose.map(|Pose { position, orientation }| {
            json!({ "position_m": position, "orientation_xyzw": orientation })
        });
        let wrench = measured
            .wrench
            .map(|[x, y, z, a, b, c]| json!({ "force_n": [x, y, z], "moment_nm": [a, b, c] }));
        let gripper = measured
            .gripper
            .map(|Gripper { position, force }| json!({ "opening_m": position, "force_n": force }));
        let rejects: Map<_, _> =
            rejects.iter().map(|(reason, count)| (reason.to_string(), count.into())).collect();
        json!({
            "t_s": self.seconds(),
            "state": reason.state().to_string(),
            "reason": reason.to_string(),
            "connected": self.is_connected,
            "leader": leader,
            "pose": pose,
            "joints_rad": q,
            "wrench": wrench,
            "gripper": gripper,
            "rejects": rejects,
            "sensor": self.sensor.as_ref().map(SensorStatus::json),
        })
    }

    fn seconds(&self) -> f64 {
        self.status.at.since(Instant::ZERO).as_secs_f64()
    }
}

fn measured_text(measured: &Measurements) -> String {
    let pose =
        measured.pose.map_or("no valid pose".to_owned(), |Pose { position: [x, y, z], .. }| {
            format!("{{MRF}} at {x:.4} {y:.4} {z:.4} m")
        });
    let norm = |[x, y, z]: [f64; 3]| x.hypot(y).hypot(z);
    let wrench = measured.wrench.map_or("no valid wrench".to_owned(), |[x, y, z, a, b, c]| {
        format!("contact {:.2} N, {:.3} N·m", norm([x, y, z]), norm([a, b, c]))
    });
    let gripper = measured
        .gripper
        .map(|Gripper { position, force }| format!("  gripper {position:.4} m, {force:.2} N"));
    format!("{pose}  {wrench}{}", gripper.unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use config::Config;
    use config::robots::RobotArm;
    use testbench::far_robot::{FarRobot, RobotLimits};

    fn report() -> Report {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let arm = RobotArm::load(Path::new("config/robots/puma560.toml")).unwrap();
        let limits = RobotLimits::default();
        let mut robot = FarRobot::new(&config.with_robot(arm), limits, 1, 2, 3).unwrap();
        // The first reading of the sensor comes with the second cycle.
        robot.step(Instant::from_micros(500));
        robot.step(Instant::from_micros(1_500));
        robot.on_message(Instant::from_micros(1_600), b"short");
        Report { status: robot.status(), is_connected: false, sensor: None }
    }

    #[test]
    fn status_line_has_state_pose_wrench_and_rejects() {
        let text = report().text();
        assert!(text.starts_with("0.002 s  holds: "), "{text}");
        for part in
            ["not connected, no leader", "{MRF} at 0.4000 ", "contact 0.00 N", "rejected 1 "]
        {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    #[test]
    fn json_status_has_every_joint_and_no_leader() {
        let json = report().json();
        assert_eq!(json["joints_rad"].as_array().unwrap().len(), 6);
        assert_eq!((&json["state"], &json["leader"]), (&json!("holding"), &Value::Null));
        assert_eq!(json["pose"]["orientation_xyzw"].as_array().unwrap().len(), 4);
        assert_eq!(json["wrench"]["force_n"].as_array().unwrap().len(), 3);
        assert_eq!(json["rejects"].as_object().unwrap().len(), 1);
        assert_eq!(json["sensor"], Value::Null);
    }
}
