//! The kernel's CAN gateway as the wire between node and drives: one rule for each COB-ID and direction,
//! so that taking a rule away loses exactly that frame, at once.

use std::cell::RefCell;
use std::sync::{Mutex, PoisonError};

use crate::common::process::Process;

/// The node's side.
pub(crate) const NODE: &str = "vcan0";

/// The drives' side.
pub(crate) const DRIVES: &str = "vcan1";

/// Direction of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    ToDrives,
    ToNode,
}

/// Pairs of interfaces that have been joined already: the kernel keeps rules.
static JOINED: Mutex<Vec<String>> = Mutex::new(Vec::new());

/// The rules between two interfaces. Changes by a test are undone at its end.
#[derive(Debug)]
pub(crate) struct Gateway {
    node: String,
    undo: RefCell<Vec<(&'static str, Vec<String>)>>,
}

impl Gateway {
    /// The gateway between the drives and the node's interface, or the far end of its cable.
    pub(crate) fn at(node: &str) -> Self {
        let gateway = Self { node: node.to_owned(), undo: RefCell::default() };
        let mut joined = JOINED.lock().unwrap_or_else(PoisonError::into_inner);
        if !joined.iter().any(|one| one == node) {
            for (way, id) in cob_ids() {
                cangw("-A", &gateway.rule(way, id, None));
            }
            joined.push(node.to_owned());
        }
        gateway
    }

    /// Forgets the rules of an interface that is gone.
    pub(crate) fn is_gone(&self) {
        JOINED.lock().unwrap().retain(|one| *one != self.node);
        self.undo.borrow_mut().clear();
    }

    /// Loses this frame from now on.
    pub(crate) fn lose(&self, way: Way, id: u16) {
        self.change("-D", "-A", self.rule(way, id, None));
    }

    /// Loses every frame of a node from now on: its cable is broken.
    pub(crate) fn lose_all_of(&self, node: u16) {
        for (way, id) in cob_ids() {
            if way == Way::ToNode && id & 0x7F == node && id > 0x80 {
                self.lose(way, id);
            }
        }
    }

    /// Alters this frame from now on, in the syntax of `cangw -m`: `SET:D:0.0.FF7F000000000000`.
    pub(crate) fn alter(&self, way: Way, id: u16, modification: &str) {
        self.lose(way, id);
        self.copy(way, id, modification);
    }

    /// Sends this frame a second time from now on, altered.
    pub(crate) fn copy(&self, way: Way, id: u16, modification: &str) {
        self.change("-A", "-D", self.rule(way, id, Some(modification)));
    }

    fn change(&self, action: &str, back: &'static str, rule: Vec<String>) {
        cangw(action, &rule);
        self.undo.borrow_mut().push((back, rule));
    }

    /// Returns a rule for data frames with this 11-bit identifier; both flags are in the mask.
    fn rule(&self, way: Way, id: u16, modification: Option<&str>) -> Vec<String> {
        let (from, to) = match way {
            Way::ToDrives => (self.node.as_str(), DRIVES),
            Way::ToNode => (DRIVES, self.node.as_str()),
        };
        let filter = format!("{id:03X}:C00007FF");
        let rule = ["-s", from, "-d", to, "-e", "-f", &filter];
        let modification = modification.map(|modification| ["-m", modification]);
        rule.into_iter().chain(modification.into_iter().flatten()).map(str::to_owned).collect()
    }
}

impl Drop for Gateway {
    fn drop(&mut self) {
        for (back, rule) in self.undo.borrow_mut().drain(..).rev() {
            cangw(back, &rule);
        }
    }
}

fn cangw(action: &str, rule: &[String]) {
    let words: Vec<&str> = std::iter::once(action).chain(rule.iter().map(String::as_str)).collect();
    Process::start("cangw", &words).wait().succeeds();
}

/// Returns every frame that node and drives exchange in kraft_like.toml.
fn cob_ids() -> Vec<(Way, u16)> {
    let nodes = || (1..=6).chain([16]);
    let with_nodes = |bases: &'static [u16]| {
        bases.iter().flat_map(move |base| nodes().map(move |node| base + node))
    };
    let broadcast = [0x000, 0x080, 0x100, 0x77F, 0x201, 0x204];
    let to_drives = broadcast.into_iter().chain(with_nodes(&[0x300, 0x600]));
    let to_node = with_nodes(&[0x180, 0x280, 0x380, 0x580, 0x680, 0x700]).chain([0x000, 0x080]);
    let to_drives = to_drives.map(|id| (Way::ToDrives, id));
    to_drives.chain(to_node.map(|id| (Way::ToNode, id))).collect()
}
