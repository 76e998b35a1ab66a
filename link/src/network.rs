//! Session of zenoh: endpoints, identity, and permissions of each end.

use std::path::Path;

use zenoh::{Config, Session, Wait};

use crate::certificate::Files;
use crate::failure::Failure;
use crate::role::{Role, Topic, router_name};
use crate::settings::Settings;

/// Time for a session to open, and its lease, in ms. zenoh has ten seconds for both.
const TIMEOUT_MS: u32 = 1_000;

/// Opens the session of a role.
///
/// # Errors
/// Returns the settings and the reason if a port is in use, or zenoh refuses a setting.
pub fn open(role: Role, settings: &Settings, files: &Files) -> Result<Session, Failure> {
    let config = configuration(role, settings, files)?;
    zenoh::open(config).wait().map_err(|error| {
        let reason = innermost(&error.to_string());
        let listen = settings.listen.join(", ");
        Failure::system(if listen.is_empty() {
            reason
        } else {
            format!("listen {listen}: {reason}")
        })
    })
}

/// Returns the reason in an error of zenoh, without the places in its sources.
pub fn innermost(error: &str) -> String {
    let mut text = error.to_owned();
    while let Some((before, rest)) = text.split_once(" at /") {
        let after = rest.split_once([' ', ',']).map_or("", |it| it.1);
        text = format!("{before} {after}");
    }
    let words: Vec<&str> = text.split_whitespace().collect();
    words.join(" ").trim_end_matches(['.', ' ']).to_owned()
}

/// Returns the settings of zenoh for a role.
///
/// # Errors
/// Returns an error if zenoh refuses a setting.
pub fn configuration(role: Role, settings: &Settings, files: &Files) -> Result<Config, Failure> {
    let endpoints = |addresses: &[String]| {
        let endpoints = addresses.iter().map(|address| format!("quic/{address}?mixed_rel=1"));
        list(&endpoints.collect::<Vec<_>>())
    };
    let mut config = Config::default();
    for (key, value) in [
        ("mode", text("peer")),
        // A router forwards between regions alone.
        ("region_name", text(role.name())),
        ("scouting/multicast/enabled", "false".to_owned()),
        ("scouting/gossip/enabled", "false".to_owned()),
        ("timestamping/enabled", "false".to_owned()),
        ("open/return_conditions/connect_scouted", "false".to_owned()),
        ("listen/endpoints", endpoints(&settings.listen)),
        ("connect/endpoints", endpoints(&settings.connect)),
        ("connect/timeout_ms", "-1".to_owned()),
        ("connect/exit_on_failure", "false".to_owned()),
        ("connect/retry", "{ period_init_ms: 100, period_max_ms: 500 }".to_owned()),
        ("transport/unicast/open_timeout", TIMEOUT_MS.to_string()),
        ("transport/unicast/accept_timeout", TIMEOUT_MS.to_string()),
        ("transport/unicast/max_links", "1".to_owned()),
        ("transport/link/tx/lease", TIMEOUT_MS.to_string()),
        ("transport/link/tls", identity(files)),
        ("access_control", access(role, settings.arm)),
    ] {
        let set = config.insert_json5(key, &value);
        set.map_err(|error| Failure::configuration(format!("zenoh: {key}: {error}")))?;
    }
    Ok(config)
}

/// Returns the settings of mutual TLS. Hosts are not verified, because a certificate identifies a role of an arm.
fn identity(files: &Files) -> String {
    let path = |path: &Path| text(&path.to_string_lossy());
    let (authority, certificate, key) =
        (path(&files.authority), path(&files.certificate), path(&files.key));
    format!(
        "{{ enable_mtls: true, verify_name_on_connect: false, root_ca_certificate: {authority}, \
        listen_certificate: {certificate}, connect_certificate: {certificate}, \
        listen_private_key: {key}, connect_private_key: {key} }}"
    )
}

/// Returns the access control, which permits only the actions of the other end and a router by their roles. Flows are
/// those of this end.
fn access(role: Role, arm: u16) -> String {
    let keys = |topics: &[Topic]| list(&topics.iter().map(|it| it.key(arm)).collect::<Vec<_>>());
    let (taken, given) = (keys(role.other().topics()), keys(role.topics()));
    let alive = list(&[role.alive(arm), role.other().alive(arm)]);
    let subjects = list(&[role.other().common_name(arm), router_name(arm)]);
    let rule = |id: &str, keys: &str, messages: &str, flows: &str| {
        format!(
            "{{ id: \"{id}\", permission: \"allow\", key_exprs: {keys}, messages: {messages}, flows: {flows} }}"
        )
    };
    let rules = [
        rule("taken", &taken, "[\"put\"]", "[\"ingress\"]"),
        rule("asked", &taken, "[\"declare_subscriber\"]", "[\"egress\"]"),
        rule("given", &given, "[\"put\"]", "[\"egress\"]"),
        rule("offered", &given, "[\"declare_subscriber\"]", "[\"ingress\"]"),
        rule(
            "alive",
            &alive,
            "[\"liveliness_token\", \"liveliness_query\", \"declare_liveliness_subscriber\"]",
            "[\"ingress\", \"egress\"]",
        ),
    ]
    .join(", ");
    format!(
        "{{ enabled: true, default_permission: \"deny\", rules: [{rules}], \
        subjects: [{{ id: \"other\", cert_common_names: {subjects} }}], \
        policies: [{{ rules: [\"taken\", \"asked\", \"given\", \"offered\", \"alive\"], subjects: [\"other\"] }}] }}"
    )
}

/// Returns a string of JSON5.
fn text(value: &str) -> String {
    format!("{value:?}")
}

/// Returns a list of strings of JSON5.
fn list(values: &[impl AsRef<str>]) -> String {
    let values: Vec<String> = values.iter().map(|value| text(value.as_ref())).collect();
    format!("[{}]", values.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zenoh_accepts_the_settings_of_both_roles() {
        for role in [Role::Near, Role::Far] {
            let settings = Settings {
                arm: 1,
                keys: "keys".into(),
                listen: vec!["[::]:7447".into()],
                connect: vec!["robot:1".into()],
                socket: "s".into(),
                in_flight: 8,
            };
            let files = Files::in_folder(Path::new("k\"eys"), role.name());
            configuration(role, &settings, &files).unwrap();
        }
    }

    #[test]
    fn reasons_are_without_places_in_sources() {
        let error = "Can not create a new QUIC listener on [::]:7447: Address in use at /a/b.rs:1. at /c/d.rs:2.";
        assert_eq!(
            innermost(error),
            "Can not create a new QUIC listener on [::]:7447: Address in use"
        );
    }
}
