"""What one sandboxed process may use. The presets are measured: see ``tests/sandbox/test_limits.py``."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

STDERR_LIMIT = 64 * 1024


@dataclass(frozen=True)
class Limits:
    """Resource limits of one sandboxed process; JSON-able through :meth:`to_dict`.

    ``address_space_mb``: RLIMIT_AS. ``cpu_s``: RLIMIT_CPU, after it SIGXCPU. ``open_files``: RLIMIT_NOFILE.
    ``wall_s``: the launcher's patience, counted from the launch; whoever waits for the process enforces it
    (:attr:`SandboxedProcess.deadline`).
    """

    name: str
    address_space_mb: int
    cpu_s: int
    open_files: int
    wall_s: float

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Limits:
        """The inverse of :meth:`to_dict`."""
        return cls(**data)


POLICY = Limits("policy", address_space_mb=1024, cpu_s=300, open_files=16, wall_s=600)
CONVERTER = Limits("converter", address_space_mb=2048, cpu_s=30, open_files=16, wall_s=60)
RUNNER = Limits("runner", address_space_mb=1024, cpu_s=1200, open_files=64, wall_s=1200)
# torch alone maps 0.85 GB; processor and wall time are those of the job, see training.trainer.client
TRAINER = Limits("trainer", address_space_mb=2560, cpu_s=2 * 86_400, open_files=16, wall_s=2 * 86_400)
# 5 s of computing and a little for itself; numpy, scipy and shapely together map 0.27 GB
REWARD = Limits("reward", address_space_mb=768, cpu_s=7, open_files=16, wall_s=60)
PROBE = Limits("probe", address_space_mb=512, cpu_s=2, open_files=16, wall_s=5)
