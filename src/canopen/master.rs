//! The NMT master: boots every node of every bus, starts them, and then watches them.
//!
//! The cyclic exchange is not here; TPDOs are passed over at once. Nor is any decision: what is heard
//! is an [`Event`], what follows from it is `node::safety`'s. The bus does not hand a master its own
//! frames, so a command, a SYNC or an RPDO that is heard is somebody else's.

use canopen_rs::NmtCommand;
use canopen_rs::NmtState;
use canopen_rs::NodeId;
use canopen_rs::nmt::HEARTBEAT_COB_BASE;
use canopen_rs::sdo::SDO_RESPONSE_COB_BASE;

use crate::canopen::commission::Boot;
use crate::canopen::commission::BootError;
use crate::canopen::commission::PATIENCE;
use crate::canopen::commission::Problem;
use crate::canopen::emcy;
use crate::canopen::emcy::Emergency;
use crate::canopen::frame::Channel;
use crate::canopen::frame::Frame;
use crate::canopen::frame::Telegram;
use crate::canopen::heartbeat::Consumer;
use crate::canopen::heartbeat::Health;
use crate::canopen::heartbeat::News;
use crate::canopen::layout::Direction;
use crate::canopen::nmt;
use crate::canopen::nmt::Order;
use crate::canopen::plan::NodePlan;
use crate::canopen::sync;
use crate::time::Instant;

/// What the master has to say. `node` is the place of a node in the list of plans.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// Every node is configured, started, and says it is operational.
    Booted,
    /// A node is not what it should be. The others are booted on, but none is started.
    BootFailed(BootError),
    /// A node reports an error, or that one is gone.
    Emergency {
        /// Which.
        node: usize,
        /// What.
        emergency: Emergency,
    },
    /// A node was silent for too long.
    HeartbeatLost {
        /// Which.
        node: usize,
    },
    /// A node has booted by itself: everything set in it is gone.
    Rebooted {
        /// Which.
        node: usize,
    },
    /// A node has changed its NMT state, or is heard again after it was lost.
    StateChanged {
        /// Which.
        node: usize,
        /// What it is in now.
        state: NmtState,
    },
    /// Somebody else commands this network.
    ForeignMaster {
        /// On which bus.
        channel: Channel,
        /// An NMT command, a SYNC or an RPDO that only the master may send.
        frame: Frame,
    },
}

/// The master of all nodes on all buses.
#[derive(Clone, Debug)]
pub struct Master {
    nodes: Vec<Node>,
    phase: Phase,
    /// What one node wants sent; kept, so that nothing is allocated later.
    frames: Vec<Frame>,
}

#[derive(Clone, Debug)]
struct Node {
    channel: Channel,
    plan: NodePlan,
    stage: Stage,
}

/// How far one node is.
#[derive(Clone, Debug)]
enum Stage {
    Booting(Box<Boot>),
    Watched(Consumer),
    Failed,
}

/// How far they all are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Phase {
    Booting,
    /// Told to start; all must have said they did until then.
    Starting(Instant),
    Running,
    /// Not all of them could be booted.
    Failed,
}

impl Master {
    /// A master that begins to boot with the first call of [`on_time`](Self::on_time).
    pub fn new(plans: Vec<(Channel, NodePlan)>) -> Self {
        let nodes = plans.into_iter().map(|(channel, plan)| {
            let stage = Stage::Booting(Box::new(Boot::new(&plan)));
            Node { channel, plan, stage }
        });
        Self { nodes: nodes.collect(), phase: Phase::Booting, frames: Vec::with_capacity(8) }
    }

    /// Boots every node again, as after power-up.
    pub fn restart(&mut self) {
        for node in &mut self.nodes {
            node.stage = Stage::Booting(Box::new(Boot::new(&node.plan)));
        }
        self.phase = Phase::Booting;
    }

    /// Whether a node is still to be booted or started; false once it is known how that went.
    pub fn is_booting(&self) -> bool {
        match self.phase {
            Phase::Booting | Phase::Starting(_) => true,
            Phase::Running | Phase::Failed => false,
        }
    }

    /// What is known of a node, by its place in the list of plans.
    pub fn health(&self, node: usize) -> Option<Health> {
        match &self.nodes.get(node)?.stage {
            Stage::Booting(_) => Some(Health::NeverSeen),
            Stage::Watched(consumer) => Some(consumer.health()),
            Stage::Failed => Some(Health::Lost),
        }
    }

    /// Takes one received frame; telegrams to send are appended to `out`.
    pub fn on_frame(
        &mut self,
        now: Instant,
        telegram: &Telegram,
        out: &mut Vec<Telegram>,
    ) -> Option<Event> {
        let Telegram { channel, frame } = *telegram;
        match frame.cob_id & FUNCTION {
            // TPDO1 to TPDO4 of the predefined connection set: the cycle's.
            0x180 | 0x280 | 0x380 | 0x480 => None,
            SDO_RESPONSE_COB_BASE | HEARTBEAT_COB_BASE => {
                let of = |node: &Node| u16::from(node.plan.node.raw()) == frame.cob_id & !FUNCTION;
                let place = self.nodes.iter().position(|n| n.channel == channel && of(n))?;
                let event = self.node_on_frame(now, place, &frame, out);
                self.proceed(now, event, out)
            }
            _ if self.is_ours_alone(channel, &frame) => {
                Some(Event::ForeignMaster { channel, frame })
            }
            _ => self.emergency(channel, &frame),
        }
    }

    /// Does what is due. It says one thing at a time: call it until its deadline lies ahead.
    pub fn on_time(&mut self, now: Instant, out: &mut Vec<Telegram>) -> Option<Event> {
        let mut event = None;
        for place in 0..self.nodes.len() {
            event = self.node_on_time(now, place, out);
            if event.is_some() {
                break;
            }
        }
        self.proceed(now, event, out)
    }

    /// When [`on_time`](Self::on_time) must next be called.
    pub fn deadline(&self) -> Option<Instant> {
        let of_node = |node: &Node| match &node.stage {
            Stage::Booting(boot) => boot.deadline(),
            Stage::Watched(consumer) => consumer.deadline(),
            Stage::Failed => None,
        };
        let start = match self.phase {
            Phase::Starting(until) => Some(until),
            Phase::Booting | Phase::Running | Phase::Failed => None,
        };
        self.nodes.iter().filter_map(of_node).chain(start).min()
    }

    /// For an orderly stop, after torque and power are off: every node back to pre-operational.
    pub fn shut_down(&self, out: &mut Vec<Telegram>) {
        self.order_all(NmtCommand::EnterPreOperational, out);
    }

    fn order_all(&self, command: NmtCommand, out: &mut Vec<Telegram>) {
        out.extend(self.nodes.iter().map(|node| Telegram {
            channel: node.channel,
            frame: Order::to(node.plan.node, command).frame(),
        }));
    }

    fn node_on_frame(
        &mut self,
        now: Instant,
        place: usize,
        frame: &Frame,
        out: &mut Vec<Telegram>,
    ) -> Option<Event> {
        let node = self.nodes.get_mut(place)?;
        match &mut node.stage {
            Stage::Booting(boot) => {
                let outcome = boot.on_frame(now, frame, &mut self.frames);
                node.after_boot(now, outcome, &mut self.frames, out)
            }
            Stage::Watched(consumer) => {
                let news = consumer.on_frame(now, frame)?;
                self.news_of(place, news)
            }
            Stage::Failed => None,
        }
    }

    fn node_on_time(
        &mut self,
        now: Instant,
        place: usize,
        out: &mut Vec<Telegram>,
    ) -> Option<Event> {
        let node = self.nodes.get_mut(place)?;
        match &mut node.stage {
            Stage::Booting(boot) => {
                let outcome = boot.on_time(now, &mut self.frames);
                node.after_boot(now, outcome, &mut self.frames, out)
            }
            Stage::Watched(consumer) => {
                let news = consumer.on_time(now)?;
                self.news_of(place, news)
            }
            Stage::Failed => None,
        }
    }

    /// What a heartbeat, or its absence, means: a failed boot until all run, an event from then on.
    fn news_of(&mut self, place: usize, news: News) -> Option<Event> {
        if self.phase == Phase::Running {
            return Some(match news {
                News::State(state) => Event::StateChanged { node: place, state },
                News::BootedUp | News::Rebooted => Event::Rebooted { node: place },
                News::Lost => Event::HeartbeatLost { node: place },
            });
        }
        let problem = match news {
            News::State(_) => return None,
            News::BootedUp | News::Rebooted => Problem::Rebooted,
            News::Lost => Problem::NoHeartbeat,
        };
        self.nodes.get_mut(place)?.fail(problem)
    }

    /// Passes `event` on, or goes on to the next phase if there is none and all nodes are ready for it.
    fn proceed(
        &mut self,
        now: Instant,
        event: Option<Event>,
        out: &mut Vec<Telegram>,
    ) -> Option<Event> {
        match self.phase {
            Phase::Booting if !self.any(|stage| matches!(stage, Stage::Booting(_))) => {
                if self.any(|stage| matches!(stage, Stage::Failed)) {
                    self.phase = Phase::Failed;
                } else {
                    self.phase = Phase::Starting(now + PATIENCE);
                    self.order_all(NmtCommand::StartRemoteNode, out);
                }
            }
            Phase::Starting(_) if self.any(|stage| matches!(stage, Stage::Failed)) => {
                self.phase = Phase::Failed;
            }
            Phase::Starting(_) if !self.any(|stage| !stage.is_operational()) => {
                self.phase = Phase::Running;
                return Some(Event::Booted);
            }
            Phase::Starting(until) if now >= until => {
                let late = self.nodes.iter_mut().find(|node| !node.stage.is_operational())?;
                self.phase = Phase::Failed;
                return late.fail(Problem::NotStarted);
            }
            Phase::Booting | Phase::Starting(_) | Phase::Running | Phase::Failed => {}
        }
        event
    }

    fn any(&self, is: impl Fn(&Stage) -> bool) -> bool {
        self.nodes.iter().any(|node| is(&node.stage))
    }

    /// Whether only the master may send this.
    fn is_ours_alone(&self, channel: Channel, frame: &Frame) -> bool {
        let is_rpdo = |node: &Node| {
            node.channel == channel
                && node.plan.pdos.iter().any(|pdo| {
                    pdo.direction == Direction::Receive
                        && pdo.service.is_some()
                        && pdo.cob_id == frame.cob_id
                })
        };
        frame.cob_id == nmt::COB_ID
            || frame.cob_id == sync::COB_ID
            || self.nodes.iter().any(is_rpdo)
    }

    /// The emergency of one of the nodes, where it was planned to be or where it was before that.
    fn emergency(&self, channel: Channel, frame: &Frame) -> Option<Event> {
        let node = self.nodes.iter().position(|node| {
            let cob_ids = [node.plan.emcy_cob_id, emcy::default_cob_id(node.plan.node)];
            node.channel == channel && cob_ids.contains(&frame.cob_id)
        })?;
        let emergency = Emergency::decode(frame.data())?;
        Some(Event::Emergency { node, emergency })
    }
}

/// The bits of a COB-ID that say what it is for; the others are the node-id.
const FUNCTION: u16 = 0x780;

impl Node {
    /// Sends what the boot wants sent, and goes on to the watch if it is over.
    fn after_boot(
        &mut self,
        now: Instant,
        outcome: Option<Result<(), BootError>>,
        frames: &mut Vec<Frame>,
        out: &mut Vec<Telegram>,
    ) -> Option<Event> {
        let channel = self.channel;
        out.extend(frames.drain(..).map(|frame| Telegram { channel, frame }));
        match outcome? {
            Ok(()) => {
                let lost_after = self.plan.lost_after;
                let watch = Consumer::new(self.plan.node, lost_after, now + lost_after);
                self.stage = Stage::Watched(watch);
                None
            }
            Err(error) => {
                self.stage = Stage::Failed;
                Some(Event::BootFailed(error))
            }
        }
    }

    fn fail(&mut self, problem: Problem) -> Option<Event> {
        self.stage = Stage::Failed;
        Some(Event::BootFailed(BootError::new(&self.plan, problem)))
    }
}

impl Stage {
    fn is_operational(&self) -> bool {
        match self {
            Self::Watched(consumer) => consumer.health() == Health::Alive(NmtState::Operational),
            Self::Booting(_) | Self::Failed => false,
        }
    }
}
