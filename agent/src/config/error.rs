//! Why a robot file cannot be used.

use std::path::{Path, PathBuf};

use armada_model::UrdfError;

/// Why a robot file, or the robot description it names, cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// A file cannot be read, or is not text.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// The file is larger than any robot file.
    #[error("{label}: {bytes} bytes, above the limit of {limit} bytes")]
    TooLarge {
        /// Name of the file.
        label: String,
        /// Its size.
        bytes: usize,
        /// Largest size.
        limit: usize,
    },
    /// The file is not YAML, misses a field, has one too many, or one of another type.
    #[error("{label}:{line}:{column}: {message}{snippet}")]
    Syntax {
        /// Name of the file.
        label: String,
        /// Line, from 1; 0 if not known.
        line: u64,
        /// Column in characters, from 1; 0 if not known.
        column: u64,
        /// What is wrong.
        message: String,
        /// The line of the file with a mark below, beginning with a line break.
        snippet: String,
    },
    /// A value is not allowed, or does not fit the robot description.
    #[error("{label}:{line}:{column}: {field}: {problem}{snippet}")]
    Invalid {
        /// Name of the file.
        label: String,
        /// Line of the value or, if it is missing, of the table it belongs to; from 1.
        line: u64,
        /// Column in characters, from 1.
        column: u64,
        /// Path of the field, parts joined by dots.
        field: String,
        /// What is wrong, with value and limit.
        problem: String,
        /// The line of the file with a mark below, beginning with a line break.
        snippet: String,
    },
    /// The robot description is not valid.
    #[error(transparent)]
    Urdf(#[from] UrdfError),
}

/// Text of a file.
pub(super) fn read(path: &Path) -> Result<String, ConfigError> {
    std::fs::read_to_string(path)
        .map_err(|source| ConfigError::Read { path: path.to_owned(), source })
}
