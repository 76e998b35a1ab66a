//! Shipped configurations with the commanded side behind a link.

/// Keys that a link needs, and every test bears.
pub(crate) const LINK: &str = "round_trip_ms = 5.0\nstiffest_contact_n_per_m = 2000.0";

/// Tables of `[remote]` that a robot in another process has itself.
const OF_THE_FAR_SIDE: [&str; 3] = ["[remote.shared_control]", "[remote.wall]", "[remote.box]"];

/// Returns the text of a shipped file as [`linked_text`] has it.
pub(crate) fn linked(hand: &str, keys: &str) -> String {
    linked_text(&std::fs::read_to_string(format!("config/{hand}.toml")).unwrap(), keys)
}

/// Limits of a model beside the robot.
pub(crate) const MODEL: &str = "model_limit_m = 0.02\nmodel_limit_deg = 5.0";

/// Returns the same with a model of the robot in the node.
pub(crate) fn with_model(hand: &str) -> String {
    let keys = format!("{LINK}\n{MODEL}");
    linked(hand, &keys).replacen("kind = \"link\"", "kind = \"both\"", 1)
}

/// Returns the same for the object of the Python examples: without payload or accommodation.
pub(crate) fn unyielding(hand: &str, keys: &str) -> String {
    linked(hand, keys)
        .replace("mass_kg = 0.8 ", "mass_kg = 0.0 ")
        .replace("accommodation_m_per_ns = 0.01 ", "accommodation_m_per_ns = 0.0 ")
        .replace("accommodation_rad_per_nms = 0.5", "accommodation_rad_per_nms = 0.0")
}

/// Returns a configuration with `kind = "link"`, without its scene, and with these keys of `[remote.link]`.
pub(crate) fn linked_text(text: &str, keys: &str) -> String {
    let without = |text: String, table: &str| match text.split_once(table) {
        Some((before, after)) => format!("{before}[{}", after.split_once("\n[").unwrap().1),
        None => text,
    };
    let text = OF_THE_FAR_SIDE.into_iter().fold(text.to_owned(), without);
    let text = text.replacen("kind = \"virtual\"", "kind = \"link\"", 1);
    text.replacen("[safety]", &format!("[remote.link]\n{keys}\n\n[safety]"), 1)
}
