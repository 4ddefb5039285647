r"""Keys that resets and check-ins of stop sources are signed with: HMAC-SHA256, in hexadecimal.

```text
reset     armada-reset\n{robot}\n{boot_id}\n{nonce}\n{sorted stop_ids, comma separated}
check-in  armada-check-in\n{source}\n{robot}\n{nonce}\n{pressed | released}
```
"""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from uuid import UUID

from .messages import ResetParams, RobotStatus, StopChallenge

_WHITE_SPACE = b" \t\n\r\f"
_NO_NONCE = UUID(int=0)
"""What is returned to a robot that has no stop and so asks for no number."""


@dataclass(frozen=True)
class SigningKey:
    """A key that both ends have; it never shows in a log."""

    secret: bytes = field(repr=False)

    @classmethod
    def read(cls, path: str | Path | None) -> SigningKey | None:
        """The key in a file, without the white space around it; none if there is no file.

        Raises `OSError` if the file cannot be read, `ValueError` if it is empty.
        """
        if path is None:
            return None
        secret = Path(path).read_bytes().strip(_WHITE_SPACE)
        if not secret:
            raise ValueError(f"the key file {path} is empty")
        return cls(secret)

    def sign_reset(self, robot: str, boot_id: UUID, nonce: UUID, stop_ids: Collection[UUID]) -> str:
        """The signature of a reset; `boot_id` is the robot's, from its status."""
        stops = ",".join(sorted(str(stop_id) for stop_id in stop_ids))
        return self._sign("armada-reset", robot, str(boot_id), str(nonce), stops)

    def sign_check_in(self, source: str, challenge: StopChallenge, *, pressed: bool) -> str:
        """The signature of a stop source's answer."""
        word = "pressed" if pressed else "released"
        return self._sign("armada-check-in", source, challenge.robot, str(challenge.nonce), word)

    def _sign(self, *lines: str) -> str:
        return hmac.new(self.secret, "\n".join(lines).encode(), hashlib.sha256).hexdigest()


def reset_params(
    status: RobotStatus, stop_ids: Collection[UUID] | None, key: SigningKey | None
) -> ResetParams:
    """The reset of a robot: of all its stops, or of these, signed if there is a key."""
    latch = status.stop
    if stop_ids is None:
        stop_ids = () if latch is None else [stop.stop_id for stop in latch.stops]
    nonce = _NO_NONCE if latch is None else latch.reset.nonce
    signature = None
    if key is not None:
        signature = key.sign_reset(status.robot, status.boot_id, nonce, stop_ids)
    return ResetParams(stop_ids=tuple(stop_ids), nonce=nonce, signature=signature)
