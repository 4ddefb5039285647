//! The name of a robot inside its cell.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Name of a robot inside its cell: `[a-z][a-z0-9_]{0,63}`, one chunk of a key expression.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct RobotName(String);

/// Why a text is not a [`RobotName`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{name:?} is not a robot name: 1 to 64 of a-z, 0-9 and _, beginning with a letter")]
pub struct RobotNameError {
    /// The text, cut after 80 characters.
    pub name: String,
}

impl RobotName {
    /// The name as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for RobotName {
    type Err = RobotNameError;

    fn from_str(text: &str) -> Result<Self, RobotNameError> {
        let mut bytes = text.bytes();
        let begins = bytes.next().is_some_and(|first| first.is_ascii_lowercase());
        let goes_on = bytes.all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_');
        if begins && goes_on && text.len() <= 64 {
            Ok(Self(text.to_owned()))
        } else {
            Err(RobotNameError { name: text.chars().take(80).collect() })
        }
    }
}

impl TryFrom<String> for RobotName {
    type Error = RobotNameError;

    fn try_from(text: String) -> Result<Self, RobotNameError> {
        text.parse()
    }
}

impl From<RobotName> for String {
    fn from(name: RobotName) -> Self {
        name.0
    }
}

impl fmt::Display for RobotName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_could_leave_their_key_chunk_are_refused() {
        for bad in ["", "Left", "a/b", "a*", "1arm", "_a", "a b", "ä", "$x", "a\n"] {
            assert!(bad.parse::<RobotName>().is_err(), "{bad:?} was taken");
        }
        assert!("a".repeat(65).parse::<RobotName>().is_err());
        assert!("left_arm2".parse::<RobotName>().is_ok());
    }
}
