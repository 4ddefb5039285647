//! The form of the cell file, with the position of each value that is checked further.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use armada_model::Pose;
use serde::de::{Deserialize, DeserializeOwned, Deserializer, MapAccess, Visitor};
use serde_saphyr::Spanned;

use super::CellConfigError;

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CellFile {
    pub(super) cell: Spanned<String>,
    #[serde(default)]
    pub(super) namespace: Option<Spanned<String>>,
    #[serde(default)]
    pub(super) gateway: GatewaySection,
    pub(super) robots: InOrder<RobotSection>,
    #[serde(default)]
    pub(super) motion: BTreeMap<String, Spanned<f64>>,
    #[serde(default)]
    pub(super) clearance: ClearanceSection,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ClearanceSection {
    #[serde(default)]
    pub(super) required_m: Option<Spanned<f64>>,
    #[serde(default)]
    pub(super) check: Option<bool>,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GatewaySection {
    #[serde(default)]
    pub(super) listen: Option<Vec<Spanned<String>>>,
}

#[derive(serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RobotSection {
    pub(super) file: PathBuf,
    pub(super) endpoint: Spanned<String>,
    #[serde(default)]
    pub(super) emulate: bool,
    #[serde(default)]
    pub(super) mount: MountSection,
}

#[derive(Default, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MountSection {
    #[serde(default)]
    pub(super) parent: Option<Spanned<String>>,
    #[serde(default)]
    pub(super) pose: Pose,
}

/// A mapping whose entries stay in the order of the file.
pub(super) struct InOrder<T>(pub(super) Vec<(Spanned<String>, T)>);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for InOrder<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(EntriesVisitor(PhantomData))
    }
}

struct EntriesVisitor<T>(PhantomData<T>);

impl<'de, T: Deserialize<'de>> Visitor<'de> for EntriesVisitor<T> {
    type Value = InOrder<T>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a mapping from names to robots")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(InOrder(entries))
    }
}

/// Reads YAML; `yes` and `on` are text, never booleans.
pub(super) fn read<T: DeserializeOwned>(text: &str, path: &Path) -> Result<T, CellConfigError> {
    let options = serde_saphyr::options! { strict_booleans: true };
    serde_saphyr::from_str_with_options(text, options)
        .map_err(|cause| CellConfigError::Syntax { path: path.to_owned(), cause: Box::new(cause) })
}
