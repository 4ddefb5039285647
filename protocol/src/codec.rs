//! Messages to bytes and back.

use serde::Serialize;
use serde::de::DeserializeOwned;
use zenoh::bytes::Encoding;

use crate::finite::first_not_finite;
use crate::messages::{Denial, DenialCode};

/// Largest request that is taken \[bytes\]: a trajectory of some ten thousand waypoints.
pub const MAX_REQUEST_BYTES: usize = 4 * 1024 * 1024;
/// Largest message of any other kind \[bytes\].
pub const MAX_MESSAGE_BYTES: usize = 1024 * 1024;

/// An encoding of payloads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum WireEncoding {
    /// `application/json`, UTF-8; also taken if a sender states none.
    #[default]
    Json,
    /// `application/msgpack`: maps with the same names.
    MessagePack,
}

/// Why bytes are not a message.
#[derive(Debug, thiserror::Error)]
pub enum CodecError {
    /// An encoding that is not understood.
    #[error("encoding {0:?} is not understood: send application/json or application/msgpack")]
    UnknownEncoding(String),
    /// More bytes than allowed.
    #[error("payload of {len} bytes is above the limit of {limit}")]
    TooLarge {
        /// Size of the payload.
        len: usize,
        /// Largest size.
        limit: usize,
    },
    /// Not JSON of this message.
    #[error("payload is not valid: {0}")]
    Json(#[from] serde_json::Error),
    /// Not MessagePack of this message.
    #[error("payload is not valid: {0}")]
    Decode(#[from] rmp_serde::decode::Error),
    /// A number that is infinite or not a number, which no field means anything by.
    #[error("{field} is {value}, expected a finite number")]
    NotFinite {
        /// Path of the field in the message.
        field: String,
        /// The number.
        value: f64,
    },
    /// Cannot be written as MessagePack.
    #[error("message cannot be encoded: {0}")]
    Encode(#[from] rmp_serde::encode::Error),
}

impl WireEncoding {
    /// The encoding that Zenoh's label names.
    ///
    /// Senders that label nothing, as a bare `session.put(key, text)` does, mean JSON.
    ///
    /// # Errors
    /// [`CodecError::UnknownEncoding`] for any other label.
    pub fn from_zenoh(label: &Encoding) -> Result<Self, CodecError> {
        let text = label.to_string();
        match text.split(';').next().unwrap_or_default() {
            "application/json" | "text/json" | "zenoh/bytes" | "zenoh/string" | "" => {
                Ok(Self::Json)
            }
            "application/msgpack" => Ok(Self::MessagePack),
            _ => Err(CodecError::UnknownEncoding(text)),
        }
    }

    /// Zenoh's label for it.
    #[must_use]
    pub fn to_zenoh(self) -> Encoding {
        match self {
            Self::Json => Encoding::APPLICATION_JSON,
            Self::MessagePack => Encoding::from("application/msgpack"),
        }
    }

    /// The bytes of a message.
    ///
    /// # Errors
    /// [`CodecError::Json`] or [`CodecError::Encode`] if the message has a value that cannot be
    /// written, such as a map with keys that are not text.
    pub fn encode<T: Serialize>(self, message: &T) -> Result<Vec<u8>, CodecError> {
        self.encode_with_room(message, 256)
    }

    /// As [`Self::encode`], with one allocation for a message of up to `room` bytes.
    ///
    /// # Errors
    /// As [`Self::encode`].
    pub fn encode_with_room<T: Serialize>(
        self,
        message: &T,
        room: usize,
    ) -> Result<Vec<u8>, CodecError> {
        let mut bytes = Vec::with_capacity(room);
        match self {
            Self::Json => serde_json::to_writer(&mut bytes, message)?,
            Self::MessagePack => {
                let mut serializer =
                    rmp_serde::Serializer::new(&mut bytes).with_struct_map().with_human_readable();
                message.serialize(&mut serializer)?;
            }
        }
        Ok(bytes)
    }

    /// The message in `bytes`, of at most `limit` bytes.
    ///
    /// # Errors
    /// [`CodecError::TooLarge`] above the limit; [`CodecError::NotFinite`] if a number, in any field,
    /// is infinite or not a number; [`CodecError::Json`] or [`CodecError::Decode`] if the bytes are
    /// not such a message.
    pub fn decode<T: DeserializeOwned>(self, bytes: &[u8], limit: usize) -> Result<T, CodecError> {
        if bytes.len() > limit {
            return Err(CodecError::TooLarge { len: bytes.len(), limit });
        }
        match self {
            Self::Json => Ok(serde_json::from_slice(bytes)?),
            Self::MessagePack => {
                if let Some((field, value)) = first_not_finite(bytes) {
                    return Err(CodecError::NotFinite { field, value });
                }
                let mut deserializer =
                    rmp_serde::Deserializer::from_read_ref(bytes).with_human_readable();
                Ok(T::deserialize(&mut deserializer)?)
            }
        }
    }
}

impl From<CodecError> for Denial {
    fn from(error: CodecError) -> Self {
        let denial = |code| Self::new(code, error.to_string());
        match &error {
            CodecError::UnknownEncoding(_) => denial(DenialCode::BadEncoding),
            CodecError::TooLarge { len, limit } => {
                denial(DenialCode::TooLarge).with("bytes", *len).with("limit", *limit)
            }
            CodecError::Json(cause) if cause.is_data() => denial(DenialCode::InvalidArgument),
            CodecError::Json(_) => denial(DenialCode::BadEncoding),
            CodecError::Decode(_) => denial(DenialCode::InvalidArgument),
            CodecError::NotFinite { field, .. } => {
                denial(DenialCode::InvalidArgument).with("field", field.as_str())
            }
            CodecError::Encode(_) => denial(DenialCode::Internal),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{CancelParams, Request};

    fn request() -> Request<CancelParams> {
        Request::new("test", CancelParams { motion_id: uuid::Uuid::nil() })
    }

    #[test]
    fn both_encodings_carry_the_same_message() {
        for encoding in [WireEncoding::Json, WireEncoding::MessagePack] {
            let bytes = encoding.encode(&request()).expect("encodes");
            let back: Request<CancelParams> = encoding.decode(&bytes, 1000).expect("decodes");
            assert_eq!(back.params, request().params);
            assert_eq!(WireEncoding::from_zenoh(&encoding.to_zenoh()).expect("known"), encoding);
        }
    }

    #[test]
    fn an_unknown_encoding_is_refused_by_its_name() {
        let error = WireEncoding::from_zenoh(&Encoding::IMAGE_PNG).expect_err("a picture");
        let denial = Denial::from(error);
        assert_eq!(denial.code, DenialCode::BadEncoding);
        assert!(denial.message.contains("image/png"), "{denial}");
    }

    #[test]
    fn a_payload_above_the_limit_is_refused_with_both_sizes() {
        let error = WireEncoding::Json
            .decode::<Request<CancelParams>>(&[b' '; 11], 10)
            .expect_err("eleven bytes");
        let denial = Denial::from(error);
        assert_eq!(denial.code, DenialCode::TooLarge);
        assert_eq!(denial.details["bytes"], 11);
        assert_eq!(denial.details["limit"], 10);
    }

    #[test]
    fn a_field_that_is_not_known_is_refused_by_name() {
        let text = br#"{"client":"x","params":{"motion_id":"00000000-0000-0000-0000-000000000000","speed":2}}"#;
        let error = WireEncoding::Json
            .decode::<Request<CancelParams>>(text, 1000)
            .expect_err("speed is no field");
        let denial = Denial::from(error);
        assert_eq!(denial.code, DenialCode::InvalidArgument);
        assert!(denial.message.contains("speed"), "{denial}");
    }
}
