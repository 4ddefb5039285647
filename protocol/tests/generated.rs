//! The generated files are those that the tables generate.

use armada_protocol::generated;

const HINT: &str = "run: cargo run -p armada-protocol --example generate_keys";

#[test]
fn keys_md_is_current() {
    assert_eq!(include_str!("../KEYS.md"), generated::keys_md(), "{HINT}");
}

#[test]
fn keys_json_is_current() {
    assert_eq!(
        include_str!("../keys.json"),
        generated::keys_json().expect("plain tables"),
        "{HINT}"
    );
}
