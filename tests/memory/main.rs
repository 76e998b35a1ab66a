//! Node, master and drives on the bus in memory, and the pure rooms: nothing here starts a process or opens a socket.

#[path = "../common/mod.rs"]
mod common;

mod arm_course;
mod arms;
mod boot;
mod boot_variants;
mod bus_hazards;
mod campaign;
mod config;
mod control_law;
mod coupling;
mod delayed_link;
mod drive_hazards;
mod dual_peg;
mod energy;
mod experiments;
mod faults;
mod fidelity;
mod friction_sweep;
mod golden;
mod held_torque;
mod late_torques;
mod link;
mod lss;
mod mode_check;
mod no_switch_box;
mod operator;
mod operators;
mod oracles;
mod plausibility;
mod position_scale;
mod power_off;
mod quirks;
mod real_drives;
mod robot_site;
mod robots;
mod scenarios;
mod sdo;
mod stated;
mod stiff_wall;
mod stop_times;
mod stored_offsets;
mod teleoperation;
mod torque_curve;
mod wrong_facts;
