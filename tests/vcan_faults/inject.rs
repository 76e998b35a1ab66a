//! Faults of the vocabulary, applied to the wire between node and drives: by the kernel's gateway, by frames of another
//! sender, by signals to the node's process.

use nix::sys::signal::Signal;

use crate::common::prelude::*;
use crate::gateway::{DRIVES, Gateway, NODE, Way};
use crate::rig::Rig;
use canopen::NmtCommand;
use canopen::emcy::Emergency;
use canopen::nmt::{self, Order};
use faults::{
    DeviceFault, Disconnection, Effect, Extent, FaultKind, FrameFault, HostFault, Selection,
    Service, Target,
};

/// The elevation, next to the elbow.
pub(crate) const ELEVATION: Joint = Joint::of::<2>();

/// The bus of config/kraft_like.toml.
pub(crate) const BUS: Target = Target::Bus(Channel(0));

/// A broken cable of a device.
pub(crate) const WIRE_CUT: FaultKind = FaultKind::Disconnection(Disconnection::WireCut);

/// A stopped process of the node.
pub(crate) const STOPPED: FaultKind = FaultKind::Host(HostFault::ProcessStopped);

/// The position of a drive.
pub(crate) const POSITION: Service = Service::Tpdo(1);

/// Returns a fault of every frame of a service.
pub(crate) const fn every(service: Service, effect: Effect) -> FaultKind {
    FaultKind::Frames(FrameFault::on_service(service, effect))
}

/// Returns a foreign frame from its form in candump, `080#` or `603#2B00`.
pub(crate) fn foreign(text: &str) -> FaultKind {
    let (cob_id, digits) = text.split_once('#').unwrap();
    let byte = |place: usize| u8::from_str_radix(&digits[2 * place..][..2], 16).unwrap();
    let data: Vec<u8> = (0..digits.len() / 2).map(byte).collect();
    let frame = Frame::from_slice(u16::from_str_radix(cob_id, 16).unwrap(), &data).unwrap();
    FaultKind::ForeignFrame { frame, period: None }
}

impl Rig {
    /// Applies a fault from now on; what the gateway does of it ends with the test.
    #[track_caller]
    pub(crate) fn inject(&mut self, gateway: &Gateway, target: Target, kind: FaultKind) {
        match (kind, target) {
            (FaultKind::Disconnection(Disconnection::WireCut), Target::Joint(joint)) => {
                gateway.lose_all_of(node_id(joint));
            }
            (FaultKind::Frames(fault), _) => self.inject_frames(gateway, target, fault),
            (FaultKind::Imitation { by, service }, Target::Joint(joint)) => {
                let (way, by) = cob_id(Target::Joint(by), service);
                let (_, imitated) = cob_id(Target::Joint(joint), service);
                gateway.copy(way, by, &format!("SET:I:{imitated:03X}.0.0000000000000000"));
            }
            (FaultKind::ForeignFrame { frame, period: None }, Target::Bus(_)) => send(NODE, &frame),
            (
                FaultKind::Device(DeviceFault::Emergency { code, register }),
                Target::Joint(joint),
            ) => {
                let [low, high] = code.to_le_bytes();
                // Torque and statusword after them: the drive is still enabled.
                let data = [low, high, register, 0, 0, 0x27, 0x06, 0];
                assert_eq!(Emergency::decode(&data).map(|emergency| emergency.code), Some(code));
                let (_, cob_id) = cob_id(Target::Joint(joint), Service::Emergency);
                send(DRIVES, &Frame::new(cob_id, data));
            }
            (FaultKind::Device(DeviceFault::Reboot), Target::Joint(joint)) => {
                // The node must receive the boot-up message, but not the command after it.
                gateway.lose(Way::ToNode, nmt::COB_ID);
                let node = NodeId::new(joint.number()).ok();
                send(DRIVES, &Order { command: NmtCommand::ResetNode, node }.frame());
            }
            (FaultKind::Host(HostFault::ProcessStopped), Target::Host) => {
                self.node.as_ref().unwrap().signal(Signal::SIGSTOP);
            }
            other => panic!("{other:?} cannot be applied to this wire"),
        }
    }

    /// Resumes the node's process.
    pub(crate) fn resume_node(&self) {
        self.node.as_ref().unwrap().signal(Signal::SIGCONT);
    }

    #[track_caller]
    fn inject_frames(&mut self, gateway: &Gateway, target: Target, fault: FrameFault) {
        let (Selection::Service(service), Extent::Always) = (fault.selection, fault.extent) else {
            panic!("{fault:?} cannot be applied to this wire");
        };
        let (way, cob_id) = cob_id(target, service);
        match fault.effect {
            Effect::Drop => gateway.lose(way, cob_id),
            Effect::Corrupt(mask) => {
                gateway.alter(way, cob_id, &format!("XOR:D:0.0.{}", hex(mask)));
            }
            Effect::Freeze => {
                let mut data = [0; 8];
                let frozen = self.next(cob_id);
                data[..frozen.len()].copy_from_slice(&frozen);
                gateway.alter(way, cob_id, &format!("SET:D:0.0.{}", hex(data)));
            }
            Effect::Duplicate | Effect::Delay { .. } | Effect::Resize(_) => {
                panic!("{fault} cannot be applied to this wire")
            }
        }
    }
}

/// Sends a frame on an interface, as another node would.
fn send(interface: &str, frame: &Frame) {
    let text = format!("{frame}");
    Process::start("cansend", &[interface, &text]).wait().succeeds();
}

fn hex(bytes: [u8; 8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02X}")).collect()
}

fn node_id(joint: Joint) -> u16 {
    u16::from(joint.number())
}

/// Returns direction and COB-ID of a service in config/kraft_like.toml.
#[track_caller]
fn cob_id(target: Target, service: Service) -> (Way, u16) {
    let node = match target {
        Target::Joint(joint) => node_id(joint),
        Target::SwitchBox => 16,
        Target::Drives | Target::Bus(_) | Target::Link | Target::Host => {
            panic!("{target} is no single device")
        }
    };
    match service {
        Service::Tpdo(1) => (Way::ToNode, 0x180 + node),
        // Three drives share a frame of targets.
        Service::Rpdo(1) => (Way::ToDrives, if node <= 3 { 0x201 } else { 0x204 }),
        Service::Emergency => (Way::ToNode, 0x680 + node),
        Service::Heartbeat => (Way::ToNode, 0x700 + node),
        Service::Tpdo(_) | Service::Rpdo(_) | Service::Sdo | Service::Sync | Service::Nmt => {
            panic!("{service} has no rule of its own")
        }
    }
}
