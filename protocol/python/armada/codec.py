"""Messages to bytes and back."""

from __future__ import annotations

from collections.abc import Hashable
from enum import Enum
from functools import lru_cache
from math import isfinite
from typing import Any, TypeVar, cast

import msgspec

from .errors import CodecError
from .messages._base import decode_hook, encode_hook

MAX_MESSAGE_BYTES = 1024 * 1024
"""Largest message that is taken [bytes]."""

T = TypeVar("T")


class WireEncoding(Enum):
    """An encoding of payloads; the value is Zenoh's label for it."""

    JSON = "application/json"
    """UTF-8; also taken if a sender states none."""
    MESSAGE_PACK = "application/msgpack"
    """Maps with the same names."""

    @classmethod
    def from_label(cls, label: str) -> WireEncoding:
        """The encoding that Zenoh's label names; raises `CodecError` if there is none."""
        name = label.split(";", 1)[0]
        if name in ("application/json", "text/json", "zenoh/bytes", "zenoh/string", ""):
            return cls.JSON
        if name == cls.MESSAGE_PACK.value:
            return cls.MESSAGE_PACK
        raise CodecError(f"encoding {label!r} is not understood")


_JSON = msgspec.json.Encoder(enc_hook=encode_hook)
_MESSAGE_PACK = msgspec.msgpack.Encoder(enc_hook=encode_hook)


def encode(message: Any, encoding: WireEncoding = WireEncoding.JSON) -> bytes:
    """The bytes of a message; raises `ValueError` if a number is not finite."""
    encoder = _JSON if encoding is WireEncoding.JSON else _MESSAGE_PACK
    return encoder.encode(message)


def decode(message_type: type[T], payload: bytes, label: str = WireEncoding.JSON.value) -> T:
    """The message in `payload`, which Zenoh labels `label`.

    Raises `CodecError` if it is too large, in an unknown encoding, not such a message, or if a
    number in it is not finite.
    """
    if len(payload) > MAX_MESSAGE_BYTES:
        raise CodecError(
            f"payload of {len(payload)} bytes is above the limit of {MAX_MESSAGE_BYTES}"
        )
    decoder = _decoder(cast("Hashable", message_type), WireEncoding.from_label(label))
    try:
        if isinstance(decoder, msgspec.msgpack.Decoder):
            _require_finite(msgspec.msgpack.decode(payload), "")
        message: T = decoder.decode(payload)
    except (msgspec.MsgspecError, ValueError) as cause:
        name = getattr(message_type, "__name__", str(message_type))
        raise CodecError(f"payload is not a valid {name}: {cause}") from cause
    return message


def _require_finite(value: Any, path: str) -> None:
    """Raises `ValueError` naming the field of a number that is infinite or not a number.

    JSON has no words for such numbers, MessagePack has, and no field means anything by them.
    """
    if isinstance(value, float):
        if not isfinite(value):
            raise ValueError(f"{path} is {value}, expected a finite number")
    elif isinstance(value, dict):
        for key, inner in value.items():
            _require_finite(inner, f"{path}.{key}" if path else str(key))
    elif isinstance(value, list) and not all(type(x) is float and isfinite(x) for x in value):
        for index, inner in enumerate(value):
            _require_finite(inner, f"{path}[{index}]")


@lru_cache(maxsize=256)
def _decoder(
    message_type: Hashable, encoding: WireEncoding
) -> msgspec.json.Decoder[Any] | msgspec.msgpack.Decoder[Any]:
    if encoding is WireEncoding.JSON:
        return msgspec.json.Decoder(message_type, dec_hook=decode_hook)
    return msgspec.msgpack.Decoder(message_type, dec_hook=decode_hook)
