"""The two kinds of failure: faults of the user and faults of the platform."""

# No Django here: sandboxed processes raise these too.

from collections.abc import Mapping
from typing import Any

from .reasons import REASONS, Reason

Param = str | int | float


class PaddockError(Exception):
    """A failure with a stable ``code`` of :data:`paddock.errors.reasons.REASONS` (KeyError otherwise). ``params`` fill
    the sentence's placeholders and must be plain JSON values."""

    fault: str = ""

    def __init__(self, code: str, **params: Param) -> None:
        reason = REASONS[code]
        if reason.fault != self.fault:
            raise ValueError(f"{code!r} is a {reason.fault} fault and cannot be raised as {type(self).__name__}")
        self.reason: Reason = reason
        self.code = code
        self.params = params
        super().__init__(code)

    def __str__(self) -> str:
        return self.reason.render(self.params)

    def __reduce__(self) -> tuple:
        return fault_from_dict, (self.to_dict(),)

    def to_dict(self) -> dict:
        """The form that crosses a pipe: ``{"code", "fault", "params"}``."""
        return {"code": self.code, "fault": self.fault, "params": self.params}


class UserFault(PaddockError):
    """A fault of the racer's request or model, which the racer sees."""

    fault = "user"


class PlatformFault(PaddockError):
    """A failure of Paddock, which is retried and refunded."""

    fault = "platform"


def fault_from_dict(data: Mapping[str, Any]) -> PaddockError:
    """Rebuild the error that :meth:`PaddockError.to_dict` wrote. Raises KeyError for an unknown code."""
    kind = UserFault if REASONS[data["code"]].fault == "user" else PlatformFault
    return kind(data["code"], **data.get("params", {}))
