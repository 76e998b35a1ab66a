//! Nodes on the command line: by node-id, or by their names in the configuration.

use canopen::NodeId;
use canopen::frame::Channel;
use canopen_tools::signals::identifier;
use canopen_tools::value::numeral::whole;
use config::Config;
use run::exit::{Failure, Kind};

/// Node as given.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum NodeArg {
    /// Number within 1..=127.
    Id(NodeId),
    /// Name of a joint, or of the switch box.
    Name(String),
}

/// Parses a node-id or a name. A number is always a node-id.
pub(crate) fn node(text: &str) -> Result<NodeArg, String> {
    let Some(number) = whole(text) else {
        let is_name = text.chars().any(char::is_alphanumeric);
        let reason = || "node-id must be within 1..=127, or the name of a joint".to_owned();
        return is_name.then(|| NodeArg::Name(text.to_owned())).ok_or_else(reason);
    };
    let id = u8::try_from(number).ok().and_then(|raw| NodeId::new(raw).ok());
    id.map(NodeArg::Id).ok_or_else(|| "node-id must be within 1..=127".to_owned())
}

/// Parses a node; `None` for `all`.
pub(crate) fn node_or_all(text: &str) -> Result<Option<NodeArg>, String> {
    if text == "all" { Ok(None) } else { node(text).map(Some) }
}

/// Parses a node; `None` for `none` and 255.
pub(crate) fn node_or_none(text: &str) -> Result<Option<NodeArg>, String> {
    if text == "none" || whole(text) == Some(255) { Ok(None) } else { node(text).map(Some) }
}

/// Parses nodes such as `1-16,32,elbow`.
pub(crate) fn nodes(text: &str) -> Result<Vec<NodeArg>, String> {
    let mut nodes = Vec::new();
    for part in text.split(',') {
        match part.split_once('-').map(|(first, last)| (node(first), node(last))) {
            Some((Ok(NodeArg::Id(first)), Ok(NodeArg::Id(last)))) if first > last => {
                return Err(
                    "the first node-id of a range must not exceed the last, as 1-16".to_owned()
                );
            }
            Some((Ok(NodeArg::Id(first)), Ok(NodeArg::Id(last)))) => {
                let range = (first.raw()..=last.raw()).filter_map(|raw| NodeId::new(raw).ok());
                nodes.extend(range.map(NodeArg::Id));
            }
            Some((first, _)) if part.starts_with(|first: char| first.is_ascii_digit()) => {
                first?;
                return Err("node-ids of a range must be within 1..=127, as 1-16".to_owned());
            }
            Some(_) | None => nodes.push(node(part)?),
        }
    }
    Ok(nodes)
}

impl NodeArg {
    /// Returns bus and node-id of a named node; `None` if the node is given by its node-id.
    ///
    /// # Errors
    /// Returns an error if the name is unknown; the error lists the known ones.
    pub(super) fn find(&self, config: &Config) -> Result<Option<(Channel, NodeId)>, Failure> {
        let Self::Name(name) = self else { return Ok(None) };
        let nodes = config.node_plans();
        let is_it = |of: &str| {
            [of, short(of)].contains(&name.as_str()) || identifier(short(of)) == identifier(name)
        };
        let found = nodes.iter().find(|(_, plan)| is_it(&plan.name));
        let known = || {
            let names = nodes.iter().map(|(_, plan)| identifier(short(&plan.name)));
            names.collect::<Vec<_>>().join(", ")
        };
        let unknown = || {
            let reason =
                format!("unknown node \"{name}\"; expected a node-id or one of {}", known());
            Failure::new(Kind::Usage, reason)
        };
        found.map(|(channel, plan)| Some((*channel, plan.node))).ok_or_else(unknown)
    }
}

/// Returns `elbow` of `joint 3 (elbow)`.
fn short(name: &str) -> &str {
    let inside = name.split_once('(').and_then(|(_, rest)| rest.strip_suffix(')'));
    inside.unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn numbers_are_node_ids_and_words_are_names() {
        assert_eq!(node("0x10"), node("16"));
        assert_eq!(node("elbow"), Ok(NodeArg::Name("elbow".to_owned())));
        for text in ["0", "128", "", "-", "500"] {
            assert!(node(text).is_err(), "{text}");
        }
        assert_eq!((node_or_all("all"), node_or_none("none")), (Ok(None), Ok(None)));
        assert_eq!(node_or_none("255"), Ok(None));
    }

    #[test]
    fn list_has_ranges_and_names() {
        let id = |raw| NodeArg::Id(NodeId::new(raw).unwrap());
        let name = |text: &str| NodeArg::Name(text.to_owned());
        assert_eq!(nodes("5,1-3"), Ok(vec![id(5), id(1), id(2), id(3)]));
        assert_eq!(nodes("7,wrist-roll"), Ok(vec![id(7), name("wrist-roll")]));
        for text in ["3-1", "", "0-5", "1-128", "1-x"] {
            assert!(nodes(text).is_err(), "{text}");
        }
    }

    #[test]
    fn named_nodes_are_found_by_every_form_of_their_name() {
        let config = Config::load("config/kraft_like.toml".as_ref()).unwrap();
        let find = |text: &str| node(text).unwrap().find(&config);
        let raw = |text: &str| find(text).unwrap().map(|(_, node)| node.raw());
        assert_eq!([raw("elbow"), raw("joint 3 (elbow)")], [Some(3); 2]);
        assert_eq!(raw("switch box"), raw("switch_box"));
        assert_eq!(raw("3"), None, "given by its node-id");
        let unknown = find("elbo").unwrap_err().to_string();
        assert!(
            unknown.contains("unknown node \"elbo\"; expected a node-id or one of "),
            "{unknown}"
        );
        assert!(unknown.contains("elbow, "), "{unknown}");
    }

    proptest! {
        #[test]
        fn any_text_parses_or_fails(text in "\\PC{0,12}|[0-9a-fhx,-]{0,12}") {
            node(&text).ok();
            nodes(&text).ok();
        }
    }
}
