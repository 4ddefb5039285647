//! Keys that resets and check-ins of stop sources are signed with: HMAC-SHA256 (RFC 2104), in
//! lower-case hexadecimal.
//!
//! ```text
//! reset     armada-reset\n{robot}\n{boot_id}\n{nonce}\n{sorted stop_ids, comma separated}
//! check-in  armada-check-in\n{source}\n{robot}\n{nonce}\n{pressed | released}
//! ```
//!
//! Identities are written with hyphens, in lower case. The nonce is the robot's and good for one
//! attempt, so no clock is needed and nothing can be repeated.

use std::fmt;
use std::path::{Path, PathBuf};

use hmac::{Hmac, Mac as _};
use sha2::Sha256;
use uuid::Uuid;

use crate::RobotName;
use crate::messages::{ResetParams, StopChallenge, StopCheckIn};

/// Longest key that is taken \[bytes\].
const MAX_KEY: usize = 4096;

/// A key that both ends have; it never shows in a log.
#[derive(Clone, PartialEq, Eq)]
pub struct SigningKey(Vec<u8>);

/// Why there is no key.
#[derive(Debug, thiserror::Error)]
pub enum SigningKeyError {
    /// The file cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// It holds nothing.
    #[error("the key is empty")]
    Empty,
    /// It is longer than any key.
    #[error("the key has {bytes} bytes, above the limit {limit}")]
    TooLong {
        /// Its length.
        bytes: usize,
        /// The longest.
        limit: usize,
    },
}

impl fmt::Debug for SigningKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SigningKey(..)")
    }
}

impl SigningKey {
    /// The key with these bytes; white space around it does not count.
    ///
    /// # Errors
    /// [`SigningKeyError::Empty`] if nothing is left, [`SigningKeyError::TooLong`] above 4096 bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, SigningKeyError> {
        let key = bytes.trim_ascii();
        match key.len() {
            0 => Err(SigningKeyError::Empty),
            bytes if bytes > MAX_KEY => Err(SigningKeyError::TooLong { bytes, limit: MAX_KEY }),
            _ => Ok(Self(key.to_vec())),
        }
    }

    /// The key in a file.
    ///
    /// # Errors
    /// [`SigningKeyError::Read`] if it cannot be read, else as [`Self::from_bytes`].
    pub fn read(path: &Path) -> Result<Self, SigningKeyError> {
        let read = std::fs::read(path);
        let bytes =
            read.map_err(|source| SigningKeyError::Read { path: path.to_owned(), source })?;
        Self::from_bytes(&bytes)
    }

    /// The reset with its signature; `boot_id` is the robot's, from its status.
    #[must_use]
    pub fn sign_reset(&self, robot: &RobotName, boot_id: Uuid, params: ResetParams) -> ResetParams {
        let signature = self.sign(&reset_text(robot, boot_id, &params));
        ResetParams { signature: Some(signature), ..params }
    }

    /// Whether a reset is signed with this key for this run of this robot.
    #[must_use]
    pub fn has_signed_reset(&self, robot: &RobotName, boot_id: Uuid, params: &ResetParams) -> bool {
        self.verify(&reset_text(robot, boot_id, params), params.signature.as_deref())
    }

    /// The check-in with its signature.
    #[must_use]
    pub fn sign_check_in(&self, challenge: &StopChallenge, check_in: StopCheckIn) -> StopCheckIn {
        let signature = self.sign(&check_in_text(&challenge.robot, &check_in));
        StopCheckIn { signature: Some(signature), ..check_in }
    }

    /// Whether a check-in is signed with this key for this robot.
    #[must_use]
    pub fn has_signed_check_in(&self, robot: &RobotName, check_in: &StopCheckIn) -> bool {
        self.verify(&check_in_text(robot, check_in), check_in.signature.as_deref())
    }

    fn sign(&self, text: &str) -> String {
        self.mac(text).finalize().into_bytes().iter().map(|byte| format!("{byte:02x}")).collect()
    }

    /// In a time that does not tell where they differ.
    fn verify(&self, text: &str, signature: Option<&str>) -> bool {
        let signature = signature.and_then(from_hex);
        signature.is_some_and(|signature| self.mac(text).verify_slice(&signature).is_ok())
    }

    #[expect(clippy::expect_used, reason = "HMAC takes keys of every length")]
    fn mac(&self, text: &str) -> Hmac<Sha256> {
        let mut mac = Hmac::<Sha256>::new_from_slice(&self.0).expect("a key of any length");
        mac.update(text.as_bytes());
        mac
    }
}

fn reset_text(robot: &RobotName, boot_id: Uuid, params: &ResetParams) -> String {
    let mut ids = params.stop_ids.clone();
    ids.sort_unstable();
    let ids: Vec<String> = ids.iter().map(Uuid::to_string).collect();
    format!("armada-reset\n{robot}\n{boot_id}\n{}\n{}", params.nonce, ids.join(","))
}

fn check_in_text(robot: &RobotName, check_in: &StopCheckIn) -> String {
    let StopCheckIn { source, nonce, pressed, .. } = check_in;
    let pressed = if *pressed { "pressed" } else { "released" };
    format!("armada-check-in\n{source}\n{robot}\n{nonce}\n{pressed}")
}

fn from_hex(text: &str) -> Option<Vec<u8>> {
    let digits: Vec<u8> = text
        .chars()
        .map(|c| c.to_digit(16).and_then(|d| u8::try_from(d).ok()))
        .collect::<Option<_>>()?;
    let pairs = digits.chunks_exact(2);
    if !pairs.remainder().is_empty() {
        return None;
    }
    Some(pairs.map(|pair| pair.iter().fold(0, |byte, digit| byte << 4 | digit)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn robot() -> RobotName {
        "left_arm".parse().expect("a name")
    }

    fn key(text: &str) -> SigningKey {
        SigningKey::from_bytes(text.as_bytes()).expect("a key")
    }

    fn params() -> ResetParams {
        let stop_ids = [9, 2].map(Uuid::from_u128).to_vec();
        ResetParams { stop_ids, nonce: Uuid::from_u128(3), signature: None }
    }

    #[test]
    fn the_function_is_hmac_sha256() {
        // Source: RFC 4231, test case 2.
        let signature = key("Jefe").sign("what do ya want for nothing?");
        assert_eq!(signature, "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
    }

    #[test]
    fn the_text_of_a_reset_is_as_documented() {
        let zeros = "00000000-0000-0000-0000-0000000000";
        let expected = format!("armada-reset\nleft_arm\n{zeros}01\n{zeros}03\n{zeros}02,{zeros}09");
        assert_eq!(reset_text(&robot(), Uuid::from_u128(1), &params()), expected);
    }

    #[test]
    fn a_signed_reset_is_good_for_its_robot_run_nonce_and_stops_only() {
        let (key, boot) = (key("secret\n"), Uuid::from_u128(1));
        let signed = key.sign_reset(&robot(), boot, params());
        assert!(key.has_signed_reset(&robot(), boot, &signed));
        let reordered =
            ResetParams { stop_ids: [2, 9].map(Uuid::from_u128).to_vec(), ..signed.clone() };
        assert!(key.has_signed_reset(&robot(), boot, &reordered));
        let other: RobotName = "right_arm".parse().expect("a name");
        assert!(!key.has_signed_reset(&other, boot, &signed));
        assert!(!key.has_signed_reset(&robot(), Uuid::from_u128(7), &signed));
        let nonce = ResetParams { nonce: Uuid::from_u128(4), ..signed.clone() };
        assert!(!key.has_signed_reset(&robot(), boot, &nonce));
        let fewer = ResetParams { stop_ids: vec![Uuid::from_u128(2)], ..signed.clone() };
        assert!(!key.has_signed_reset(&robot(), boot, &fewer));
        for bad in [None, Some(String::new()), Some("zz".to_owned()), Some("5bd".to_owned())] {
            let unsigned = ResetParams { signature: bad, ..signed.clone() };
            assert!(!key.has_signed_reset(&robot(), boot, &unsigned));
        }
        let another = SigningKey::from_bytes(b"other").expect("a key");
        assert!(!another.has_signed_reset(&robot(), boot, &signed));
    }

    #[test]
    fn a_released_check_in_does_not_pass_for_another() {
        let key = key("secret");
        let challenge = StopChallenge { robot: robot(), nonce: Uuid::from_u128(5) };
        let released = StopCheckIn {
            source: "door_1".to_owned(),
            nonce: challenge.nonce,
            pressed: false,
            signature: None,
        };
        let signed = key.sign_check_in(&challenge, released.clone());
        assert!(key.has_signed_check_in(&robot(), &signed));
        assert!(!key.has_signed_check_in(&robot(), &released));
        let forged = StopCheckIn { pressed: true, ..signed.clone() };
        assert!(!key.has_signed_check_in(&robot(), &forged));
        let moved = StopCheckIn { source: "door_2".to_owned(), ..signed };
        assert!(!key.has_signed_check_in(&robot(), &moved));
    }

    #[test]
    fn a_key_that_is_empty_is_none() {
        assert!(matches!(SigningKey::from_bytes(b" \n"), Err(SigningKeyError::Empty)));
        assert!(SigningKey::from_bytes(&[b'x'; MAX_KEY + 1]).is_err());
        assert_eq!(format!("{:?}", key("secret")), "SigningKey(..)");
    }
}
