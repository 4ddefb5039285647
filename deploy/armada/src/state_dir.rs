//! Where latched stops are kept while no agent runs.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::Context as _;

use crate::run_file;

/// The folder given, or else this user's: `$XDG_STATE_HOME/armada`, `~/.local/state/armada`.
///
/// # Errors
/// If none is given and the user has none.
pub(crate) fn or_default(given: Option<PathBuf>) -> anyhow::Result<PathBuf> {
    let of_user = || of_user(std::env::var_os("XDG_STATE_HOME"), std::env::var_os("HOME"));
    given.or_else(of_user).context("there is no folder to keep latched stops in: give --state-dir")
}

/// The folder of a cell's agents below `base`.
pub(crate) fn of_cell(base: &Path, cell: &str) -> PathBuf {
    base.join("cells").join(run_file::safe_name(cell))
}

/// Source: XDG base directory specification 0.8; a path that is not absolute does not count.
fn of_user(state_home: Option<OsString>, home: Option<OsString>) -> Option<PathBuf> {
    let absolute = |path: OsString| Some(PathBuf::from(path)).filter(|path| path.is_absolute());
    let below_home = || home.and_then(absolute).map(|home| home.join(".local/state"));
    state_home.and_then(absolute).or_else(below_home).map(|base| base.join("armada"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(state_home: &str, home: &str) -> Option<String> {
        let some = |text: &str| (!text.is_empty()).then(|| OsString::from(text));
        of_user(some(state_home), some(home)).map(|path| path.display().to_string())
    }

    #[test]
    fn stops_are_kept_where_the_user_keeps_state() {
        assert_eq!(folder("/var/me", "/home/me").as_deref(), Some("/var/me/armada"));
        let below_home = Some("/home/me/.local/state/armada");
        assert_eq!(folder("", "/home/me").as_deref(), below_home);
        assert_eq!(folder("relative", "/home/me").as_deref(), below_home);
        assert_eq!(folder("", ""), None);
    }

    #[test]
    fn each_cell_has_a_folder_of_its_own() {
        let base = Path::new("/state");
        assert_eq!(of_cell(base, "dual_arm"), Path::new("/state/cells/dual_arm"));
        assert_eq!(of_cell(base, "../x"), Path::new("/state/cells/___x"));
    }
}
