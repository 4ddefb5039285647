//! What is generated from the tables: `KEYS.md` for people, `keys.json` for other languages.

use std::fmt::Write;

use serde::Serialize;

use crate::keys::{self, Key};
use crate::messages::{DenialCode, RobotFlags};
use crate::method::{self, MethodRow};

/// Content of `keys.json`.
#[derive(Serialize)]
struct Tables {
    keys: &'static [Key],
    robot_methods: &'static [MethodRow],
    cell_methods: &'static [MethodRow],
    denial_codes: Vec<DenialCode>,
    robot_flags: Vec<(&'static str, u64)>,
}

/// The tables as JSON.
///
/// # Errors
/// Never in practice: the tables are plain text and numbers.
pub fn keys_json() -> Result<String, serde_json::Error> {
    let tables = Tables {
        keys: keys::ALL,
        robot_methods: method::robot::ALL,
        cell_methods: method::cell::ALL,
        denial_codes: DenialCode::ALL.to_vec(),
        robot_flags: RobotFlags::NAMES.map(|(name, bit)| (name, bit.bits())).to_vec(),
    };
    Ok(serde_json::to_string_pretty(&tables)? + "\n")
}

/// The tables as Markdown.
#[must_use]
pub fn keys_md() -> String {
    let mut text = String::from(HEAD);
    table(
        &mut text,
        "Keys of an agent",
        keys::ALL.iter().filter(|k| k.pattern.starts_with("robots")),
    );
    table(
        &mut text,
        "Keys of the cell",
        keys::ALL.iter().filter(|k| k.pattern.starts_with("cell")),
    );
    methods(&mut text, "Methods of an agent", "robots/{robot}/rpc/", method::robot::ALL);
    methods(&mut text, "Methods of the gateway", "cell/rpc/", method::cell::ALL);
    text.push_str("\n## Denial codes\n\n");
    for code in DenialCode::ALL {
        put(&mut text, format_args!("`{code}` "));
    }
    text.push_str("\n\n## Flags of a robot\n\n| bit | name |\n|---|---|\n");
    for (name, bit) in RobotFlags::NAMES {
        put(&mut text, format_args!("| `{:#x}` | `{name}` |\n", bit.bits()));
    }
    text
}

const HEAD: &str = "\
# Keys of Armada

Generated from `protocol/src/keys.rs` and `method.rs` by
`cargo run -p armada-protocol --example generate_keys`; a test compares. Payloads are JSON
(`application/json`, also taken without a label) or MessagePack (`application/msgpack`, same names).
Units are SI. Messages are in `protocol/src/messages`, one sample of each in `protocol/golden`.
A refused request is answered on the error channel with a `Denial`. Zero replies mean that nobody
is there, never success. `robot` matches `[a-z][a-z0-9_]{0,63}`.
";

fn table<'a>(text: &mut String, title: &str, rows: impl Iterator<Item = &'a Key>) {
    put(text, format_args!("\n## {title}\n\n"));
    text.push_str("| key | kinds | by | message | priority | notes |\n|---|---|---|---|---|---|\n");
    for key in rows {
        let kinds: Vec<String> =
            key.kinds.iter().map(|kind| format!("{kind:?}").to_lowercase()).collect();
        put(
            text,
            format_args!(
                "| `{}` | {} | {} | {} | {:?}{} |{} |\n",
                key.pattern,
                kinds.join(", "),
                format!("{:?}", key.owner).to_lowercase(),
                key.message,
                key.channel.priority(),
                if key.channel.express() { ", express" } else { "" },
                key.notes,
            ),
        );
    }
}

fn methods(text: &mut String, title: &str, prefix: &str, rows: &[MethodRow]) {
    put(text, format_args!("\n## {title}\n\n"));
    put(
        text,
        format_args!(
            "Under `{prefix}`; the payload is `{{\"request_id\":…,\"client\":…,\"params\":…}}`.\n\n"
        ),
    );
    text.push_str("| method | params | answer | wait \\[ms\\] | notes |\n|---|---|---|---|---|\n");
    for row in rows {
        put(
            text,
            format_args!(
                "| `{}` | {} | {} | {} |{} |\n",
                row.name, row.params, row.answer, row.timeout_ms, row.notes
            ),
        );
    }
}

/// Writing to a `String` cannot fail.
fn put(text: &mut String, part: std::fmt::Arguments<'_>) {
    let _infallible = text.write_fmt(part);
}
