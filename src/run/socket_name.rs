//! Name of a socket in errors: its path, and the key that sets it.

use std::path::Path;

use config::Config;

/// Returns `kind` of socket, its path, and the `key` of the configuration that sets it, or would.
pub(crate) fn socket_name(
    kind: &str,
    path: &Path,
    key: &str,
    configured: Option<&Path>,
    config: &Config,
) -> String {
    let (path, file) = (path.display(), config.file.display());
    match configured {
        Some(_) => format!("{kind} socket {path} ({key} of {file})"),
        None => format!("{kind} socket {path} (by default; {key} of {file} sets another)"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn name_has_the_key_also_where_it_is_absent() {
        let config = Config::load(Path::new("config/kraft_like.toml")).unwrap();
        let path = Path::new("/a/node.sock");
        let name = |configured| socket_name("control", path, "node.socket", configured, &config);
        let given = "control socket /a/node.sock (node.socket of config/kraft_like.toml)";
        assert_eq!(name(Some(path)), given);
        assert!(name(None).ends_with("node.socket of config/kraft_like.toml sets another)"));
    }
}
