//! Keys of the status, and the page that explains them.

use crate::common::linked::with_model;
use crate::common::prelude::*;
use crate::linked_node::{Network, booted_near, engage};
use telemetry::losses::Losses;
use telemetry::status::Status;

/// Page with the table of the keys.
const PAGE: &str = include_str!("../../docs/operation.md");

/// Returns whether the page has this key in a first column.
fn is_explained(key: &str) -> bool {
    let first_columns = PAGE.lines().filter_map(|line| line.strip_prefix('|')?.split('|').next());
    first_columns.into_iter().any(|column| column.contains(&format!("`{key}`")))
}

fn keys(status: &Status) -> Vec<String> {
    let Ok(Value::Object(status)) = serde_json::to_value(status) else { panic!("no object") };
    let of_budget = |key: &String| key.ends_with("_scale") || key.ends_with("_joint");
    let budget = status["budget"].as_object().unwrap().keys().filter(|key| of_budget(key));
    let budget: Vec<_> = budget.map(|key| format!("budget.{key}")).collect();
    status.keys().cloned().chain(budget).collect()
}

#[test]
fn every_key_of_the_status_is_in_the_table_of_its_page() {
    let scenario = script("seconds = 1.0");
    let config = config(KRAFT);
    let mut bench = started(&config, scenario, ());
    let plain = Status::from_record(&bench.cycle(), 0, Losses::default());
    let near = parse(KRAFT, &with_model("kraft_like"));
    let (mut node, _) = booted_near("kraft_like", &near, Network::default(), ());
    let modelled = Status::from_record(&engage(&mut node), 0, Losses::default());
    assert!(modelled.model.is_some());
    for key in [keys(&plain), keys(&modelled)].concat() {
        assert!(is_explained(&key), "{key}");
    }
    assert!(!is_explained("no_such_key"));
}
