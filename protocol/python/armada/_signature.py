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

from .messages import ResetParams, StopChallenge, StopLatch

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

    def signed(self, robot: str, boot_id: UUID, reset: ResetParams) -> ResetParams:
        """A reset with its signature."""
        signature = self.sign_reset(robot, boot_id, reset.nonce, reset.stop_ids)
        return ResetParams(stop_ids=reset.stop_ids, nonce=reset.nonce, signature=signature)

    def sign_check_in(self, source: str, challenge: StopChallenge, *, pressed: bool) -> str:
        """The signature of a stop source's answer."""
        word = "pressed" if pressed else "released"
        return self._sign("armada-check-in", source, challenge.robot, str(challenge.nonce), word)

    def _sign(self, *lines: str) -> str:
        return hmac.new(self.secret, "\n".join(lines).encode(), hashlib.sha256).hexdigest()


def reset_params(latch: StopLatch | None, stop_ids: Collection[UUID] | None) -> ResetParams:
    """The reset of what a robot has latched: of all its stops, or of these; not signed."""
    if stop_ids is None:
        stop_ids = () if latch is None else [stop.stop_id for stop in latch.stops]
    nonce = _NO_NONCE if latch is None else latch.reset.nonce
    return ResetParams(stop_ids=tuple(stop_ids), nonce=nonce)
