//! JSON arguments as they are typed: the text itself, `@FILE` that holds it, or `-` for standard
//! input.

use std::io::Read as _;

use anyhow::Context as _;

use crate::exit::UsageError;

/// What stands for standard input.
pub(super) const STDIN: &str = "-";

/// The text that an argument means.
///
/// # Errors
/// If the file or standard input cannot be read as text.
pub(crate) fn text_of(argument: &str) -> anyhow::Result<String> {
    match argument.strip_prefix('@') {
        Some(path) => std::fs::read_to_string(path).with_context(|| path.to_owned()),
        None if argument == STDIN => stdin(),
        None => Ok(argument.to_owned()),
    }
}

/// All of standard input.
pub(super) fn stdin() -> anyhow::Result<String> {
    let mut text = String::new();
    std::io::stdin().lock().read_to_string(&mut text).context("standard input")?;
    Ok(text)
}

/// Refuses to read standard input for two purposes.
pub(super) fn one_stdin(arguments: &[Option<&str>]) -> Result<(), UsageError> {
    if arguments.iter().flatten().filter(|&&argument| argument == STDIN).count() > 1 {
        return Err(UsageError("standard input can be read for one argument only".to_owned()));
    }
    Ok(())
}

/// Where a text stops being JSON: `line 1 column 9, after "elbow"`.
///
/// The name helps where Python wrote `NaN`, which JSON does not have.
pub(super) fn place_of(text: &str, error: &serde_json::Error) -> String {
    let before = text.lines().take(error.line()).collect::<Vec<_>>();
    let name = before.split_last().and_then(|(last, earlier)| {
        let end = error.column().min(last.len());
        let last = last.get(..end).unwrap_or(last);
        let whole = [earlier.join("\n"), last.to_owned()].join("\n");
        whole.rsplit('"').nth(1).map(str::to_owned)
    });
    let place = format!("line {} column {}", error.line(), error.column());
    name.map_or_else(|| place.clone(), |name| format!("{place}, after {name:?}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_argument_is_its_text_or_the_text_of_a_file() {
        assert_eq!(text_of("[1]").expect("as it is"), "[1]");
        let file = tempfile::NamedTempFile::new().expect("a file");
        std::fs::write(file.path(), "[2]").expect("written");
        assert_eq!(text_of(&format!("@{}", file.path().display())).expect("read"), "[2]");
        let error = format!("{:#}", text_of("@no/such/file").expect_err("no file"));
        assert!(error.starts_with("no/such/file: "), "{error}");
    }

    #[test]
    fn standard_input_serves_one_argument() {
        assert!(one_stdin(&[Some("-"), None, Some("a")]).is_ok());
        assert!(one_stdin(&[Some("-"), Some("-")]).is_err());
    }

    #[test]
    fn the_place_of_a_mistake_has_the_name_before_it() {
        let place = |text: &str| {
            let error = serde_json::from_str::<serde_json::Value>(text).expect_err("not JSON");
            place_of(text, &error)
        };
        assert_eq!(place("{\"elbow\": NaN}"), "line 1 column 11, after \"elbow\"");
        assert_eq!(place("{\"a\": 1,\n \"lift\": NaN}"), "line 2 column 10, after \"lift\"");
        assert_eq!(place("[NaN]"), "line 1 column 2");
    }
}
