//! Hazards, promises and properties of docs/safety.md, by number.

/// Number, subject and promised reaction or figure.
pub(crate) type Claim = (u8, &'static str, &'static str);

pub(crate) const HAZARDS: [Claim; 53] = [
    (
        1,
        "A drive loses its power or its cable",
        "zero torque on all joints within 5 cycles of its last sample",
    ),
    (2, "A heartbeat stops while samples arrive", "drives off when its configured time is over"),
    (
        3,
        "One joint's samples stop, or are rare",
        "zero torque within 5 cycles, and when more than ten are lost and not compensated (one is forgiven every 250 \
         cycles); reflection off when more than a twentieth within a second come late and are compensated",
    ),
    (
        4,
        "Samples come late or in another order",
        "an old one never replaces a newer one; zero torque within 5 cycles of three empty ones, \
         and when more than ten are overdue",
    ),
    (
        5,
        "A drive repeats an old position",
        "zero torque within 600 ms, if the joint is pushed and a neighbour moves",
    ),
    (6, "Two nodes share a node-id, or one is imitated", "zero torque within 3 cycles"),
    (
        7,
        "A node sends an emergency message",
        "zero torque within 2 cycles; a warning only while its error register is 00h and `emcy_warnings` lists its code",
    ),
    (
        8,
        "A drive faults, loses its power stage, leaves operation enabled or operational",
        "the other five zero within 2 cycles; never enabled again by itself",
    ),
    (
        9,
        "A drive reboots in the middle of a run",
        "all drives off within 2 cycles; identity and configuration are checked again",
    ),
    (10, "A drive exerts another torque than its target", "zero torque within 55 ms"),
    (11, "A joint or the grip moves too fast", "zero torque within 3 cycles"),
    (
        12,
        "A position jumps; a counter wraps",
        "the jump is not used, the second one trips within 2 cycles; a single wrong sample is forgiven; a wrap \
         is no jump",
    ),
    (
        13,
        "A drive no longer receives its RPDOs",
        "it is off by its own timer within 6 ms, the others follow; a drive without that timer is seen within 120 ms, \
         and disabled; a disarm is not answered as ready while its torque actual is beyond 20 ‰",
    ),
    (14, "A device with another identity than configured", "no drive is started"),
    (
        15,
        "A PDO mapping is refused, or silently differs",
        "no drive is started; node and object are named",
    ),
    (16, "The drives' own protection is not accepted, or does not act", "no arming"),
    (
        17,
        "The node starts while drives are enabled or the arm moves",
        "disable voltage is the first command; no boot before standstill",
    ),
    (
        18,
        "An invalid configuration, EDS or calibration",
        "no frame at all; one line names file and key",
    ),
    (19, "A torque curve that is not monotone", "no frame at all"),
    (20, "The frames do not fit the bus", "no frame at all"),
    (
        21,
        "The transmit queue is full",
        "drives free of torque within 6 cycles, by their own timers where no frame gets out; no torque frame is sent late",
    ),
    (
        22,
        "Frames are accepted by the driver and never reach the bus",
        "nothing more is sent; the drives stop by their timers",
    ),
    (23, "Bus off, error passive", "nothing more is sent after bus off; zero torque when passive"),
    (24, "The interface goes down or is unplugged", "drives off; only a whole boot leads back"),
    (25, "Old frames wait in the receive queue", "they are discarded within 2 cycles"),
    (
        26,
        "Frames of unknown nodes: SYNC, NMT, PDOs, SDO downloads, malformed ones",
        "ignored and counted, or the stop of what they imitate within 2 cycles; a proven setting that \
         differs: drives off when its turn to be read again has come",
    ),
    (
        27,
        "The node is killed or crashes",
        "the drives are free of torque by their own timers, within the times of promise 2",
    ),
    (
        28,
        "The node is stopped for a while",
        "as 27; the first torque after it is zero, no missed cycle is caught up",
    ),
    (
        29,
        "Cycles come late",
        "late torques are dropped; zero torque within 5 cycles of a gap, or after too many late ones",
    ),
    (
        30,
        "An orderly stop",
        "torque ramped to zero within 50 ms, drives off and confirmed within 1 s",
    ),
    (31, "The wall clock steps; the host sleeps", "no effect; drives off"),
    (32, "The disk is full or slow, the log floods", "no effect on the cycle"),
    (33, "A wrench that is NaN, infinite or huge", "no effect beyond cap and slew"),
    (
        34,
        "The link to the remote side is lost",
        "no reflection after 70 ms; the robot follows no command older than 100 ms (`hold_after_ms`)",
    ),
    (35, "The link repeats an old wrench", "no reflection after 70 ms"),
    (36, "Wrenches come late, twice or in another order", "an older one is never used"),
    (37, "Wrenches are forged, replayed, or from another session", "no effect at all"),
    (
        38,
        "The deadman is released",
        "the command ends in the same cycle, reflected torque within 20 ms",
    ),
    (
        39,
        "The deadman sticks, bounces or is tied down",
        "disagreement stops after 50 ms; closed at power-up refuses arming; 60 s without motion end reflection; \
         a press of reflection or reference counts after 25 ms",
    ),
    (
        40,
        "The reference or the mode changes in motion",
        "rate zero in the cycle in which the press counts, no torque changes faster than its slew",
    ),
    (
        41,
        "Reflection begins with a large wrench; power comes on while the arm is not held, or with a wrong sign or scale",
        "ramps of 300 ms and 1 s from zero; an arm driven one way for 0.9 rad, or whose grip reaches 1 m/s, stops; \
         engaged, a joint that its friction compensation drives for 0.05 rad loses it, and stops the node if it goes on for 0.25 rad; \
         a joint whose facts are stated only is armed within 5° of its rest posture alone",
    ),
    (
        42,
        "Signs, wraps and singular poses of the mathematics",
        "finite and within the slew everywhere",
    ),
    (
        43,
        "A joint near its limit",
        "what pushes outwards fades; beyond it reflection ends in 1 cycle",
    ),
    (
        44,
        "The required torque exceeds the drives' limits",
        "all joints are scaled together: the direction is kept",
    ),
    (
        45,
        "The control loop oscillates, or the commanded side pumps energy into the hand",
        "reflection ends within 400 ms of undamped oscillation, of 20 W into the hand, or of 2 J above 0.5 W",
    ),
    (
        46,
        "A drive stays on after disable voltage",
        "disabled by SDO after 2 cycles (25 ms where controlwords take turns), stopped by NMT 10 ms later, named; 30 ms \
         after that heartbeat and guarding end for all drives",
    ),
    (
        47,
        "The robot at the commanded side holds: its sensor, its wrench limit, its end, a fault",
        "no reflection after 70 ms, the reason named; it goes on in the epoch of a reset alone",
    ),
    (
        48,
        "Messages of the far side take longer than the gains were checked with",
        "a warning before arming; no reflection after 70 ms while engaged",
    ),
    (
        49,
        "The robot at the commanded side does not follow its commands",
        "no reflection from the sample on that is beyond the limit to its model, if it has one (`kind = \"both\"`)",
    ),
    (
        50,
        "The input of the gripper is silent, out of its range, or contradicts itself",
        "the gripper stays where it was commanded in the next cycle; out of range or contradictory, no reflection after 100 ms, \
         the counts or bits named; a glitch does not count, as invalid time must exceed valid time by 25 ms",
    ),
    (
        51,
        "The zero of a joint was never set, or is lost",
        "no torque before it is known, a lost one refuses arming; lost under torque, zero torque within 2 cycles; a homing moves no \
         joint by more than 1° and no drive exerts more than 50 ‰",
    ),
    (
        52,
        "The arm moves itself against a person or a thing, with a wrong sign, or on after the deadman is released",
        "3 N at the grip, 40 % of the described weight and twice the friction at most; blocked for 0.3 s or 4° (10 mm) off the way, reflection ends and the arm stays carried; released, the motion ends in the next cycle, and the arm sinks by at most 0.1 rad/s",
    ),
    (
        53,
        "One drive is tried alone: it pushes with more than its bound, moves another joint, runs away, or keeps a reduced limit",
        "torque limit of the drive at the bound before it is enabled, all others off; zero torque and off in the cycle after the deadman is released, another joint moves by 0.3° (0.5 mm), or it moves by 2° (3.5 mm) or at 0.6 rad/s (0.1 m/s); only a boot, which writes the planned limits, leads to torque again",
    ),
];

pub(crate) const PROMISES: [Claim; 15] = [
    (1, "Every fault that the node detects ends torque on all six joints", "5 cycles"),
    (
        2,
        "A node that is killed, stopped or crashes leaves drives without torque",
        "6 ms by the RPDO timer, 25 ms by the heartbeat alone, 33 ms by guarding",
    ),
    (
        3,
        "The drives' timers are proof-tested at each bring-up, and limit the force",
        "six of six, or no arming",
    ),
    (4, "When one drive faults the others end", "2 cycles"),
    (
        5,
        "Torque is bounded, at the last limiter before the bus",
        "never above the lesser of capacity and 6072h; rise of at most a tenth of it per cycle",
    ),
    (6, "A wrench that is invalid or not authentic has no effect", "none of 100,000"),
    (7, "A lost or frozen link ends reflection", "70 ms, no step beyond the slew"),
    (8, "A released deadman ends command and reflection", "1 cycle, 20 ms"),
    (
        9,
        "No torque before identity, mapping, protection, proof test and arming; none of the task before a press of the deadman",
        "no such frame",
    ),
    (
        10,
        "Never an old torque frame",
        "none is sent later than 1.5 periods after its SYNC; what an adapter held back acts no later than the \
         RPDO timer and a period; without that timer, the time of heartbeat or guarding, 3 ms and a period",
    ),
    (11, "An invalid configuration is refused", "no frame, exit code 3, within 1 s"),
    (12, "An orderly stop is confirmed", "drives off, exit code 0, within 1 s"),
    (13, "Disk, log and clock of the host do not matter", "no stop, cycle times within a tenth"),
    (
        14,
        "No false stops",
        "no false stop in 16 million cycles with 1 % of the link's and 0.1 % of the samples lost",
    ),
    (15, "Every stop is recorded", "cause, joint, cycle, 2 s before and 1 s after"),
];

pub(crate) const PROPERTIES: [Claim; 16] = [
    (1, "The Jacobian is the derivative of the kinematics", "by differences"),
    (2, "A wrench transformed to another frame has the same power", ""),
    (
        3,
        "The centring force is odd, bounded, continuous, and never points away from the centre",
        "",
    ),
    (4, "Orientation errors are continuous at half a turn", ""),
    (5, "Damping dissipates energy, and a new reference gives no impulse", ""),
    (6, "All outputs are finite for all finite joint positions, singular poses included", ""),
    (7, "Saturation keeps the direction", ""),
    (8, "The assist keeps to its fraction, and the task comes first", ""),
    (9, "Cap and slew hold for any number", "NaN, infinities, -0 and subnormals"),
    (10, "Torque curves are monotone and odd, and their inverse is exact", "a thousandth"),
    (11, "Drives get legal transitions only", "any sequence of statuswords"),
    (12, "The replay window is a set", ""),
    (13, "What is stale stays so with age", ""),
    (14, "Differences of positions are right across 2³¹", ""),
    (15, "Causes in any order end in the most restrictive of their states", ""),
    (16, "A configuration with one byte changed is refused, or its values are in range", ""),
];
