//! Writes `protocol/KEYS.md` and `protocol/keys.json` from the tables.

use std::fs;
use std::path::Path;

use armada_protocol::generated;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR"));
    fs::write(folder.join("KEYS.md"), generated::keys_md())?;
    fs::write(folder.join("keys.json"), generated::keys_json()?)?;
    Ok(())
}
