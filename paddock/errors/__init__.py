"""The two kinds of failure: the racer's fault and ours. No Django here: sandboxed processes raise these too."""

from __future__ import annotations

from .reasons import REASONS, Reason

Param = str | int | float


class PaddockError(Exception):
    """A failure with a stable code.

    ``code`` must be listed in :data:`paddock.errors.reasons.REASONS` (KeyError otherwise, so that a typo fails
    in tests); ``params`` fill the sentence's placeholders and must be plain JSON values.
    """

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
        return _rebuild, (type(self), self.code, self.params)

    def to_dict(self) -> dict:
        """The form that crosses a pipe: ``{"code", "fault", "params"}``."""
        return {"code": self.code, "fault": self.fault, "params": self.params}


class UserFault(PaddockError):
    """What the racer sent or their model did is wrong. Shown to them; it counts."""

    fault = "user"


class PlatformFault(PaddockError):
    """Paddock failed. Retried, refunded, and an operator should know."""

    fault = "platform"


def fault_from_dict(data: dict) -> PaddockError:
    """Rebuild the error that :meth:`PaddockError.to_dict` wrote. Raises KeyError for an unknown code."""
    kind = UserFault if REASONS[data["code"]].fault == "user" else PlatformFault
    return kind(data["code"], **data.get("params", {}))


def _rebuild(kind: type[PaddockError], code: str, params: dict) -> PaddockError:
    return kind(code, **params)
