"""The resources that one sandboxed process may use, measured in ``tests/sandbox/test_limits.py``."""

from __future__ import annotations

import os
from dataclasses import dataclass

STDERR_LIMIT = 64 * 1024


def _set(text: str | None, default: int) -> int:
    """A whole number that an operator may set; the site's settings report an invalid one."""
    return int(text) if text and text.isascii() and text.isdigit() else default


@dataclass(frozen=True)
class Limits:
    """Resource limits of one sandboxed process. ``address_space_mb``: RLIMIT_AS. ``cpu_s``: RLIMIT_CPU, after it
    SIGXCPU. ``open_files``: RLIMIT_NOFILE. ``wall_s``: counted from the launch; the caller enforces it
    (:attr:`SandboxedProcess.deadline`)."""

    name: str
    address_space_mb: int
    cpu_s: int
    open_files: int
    wall_s: float


# what the console's largest network, of 57 million weights, takes of them: docs/operators.md
_POLICY_MB = _set(os.environ.get("PADDOCK_POLICY_MEMORY_MB"), 2560)
POLICY_S = _set(os.environ.get("PADDOCK_POLICY_SECONDS"), 120)  # of wall time, for all steps of a run
_CONVERTER_MB = _set(os.environ.get("PADDOCK_CONVERTER_MEMORY_MB"), 2048)
_CONVERTER_S = _set(os.environ.get("PADDOCK_CONVERTER_SECONDS"), 30)
POLICY = Limits("policy", address_space_mb=_POLICY_MB, cpu_s=5 * POLICY_S // 2, open_files=16, wall_s=5 * POLICY_S)
CONVERTER = Limits(
    "converter", address_space_mb=_CONVERTER_MB, cpu_s=_CONVERTER_S, open_files=16, wall_s=2 * _CONVERTER_S
)
# the same with torch, which alone maps 0.85 GB
SB3_CONVERTER = Limits(
    "sb3 converter", address_space_mb=_CONVERTER_MB + 1024, cpu_s=_CONVERTER_S, open_files=16, wall_s=2 * _CONVERTER_S
)
RUNNER = Limits("runner", address_space_mb=1024, cpu_s=1200, open_files=64, wall_s=1200)
# torch alone maps 0.85 GB; processor and wall time are those of the job, see training.trainer.client
TRAINER = Limits("trainer", address_space_mb=2560, cpu_s=2 * 86_400, open_files=16, wall_s=2 * 86_400)
# 5 s of computing and a little for itself; numpy, scipy and shapely together map 0.27 GB
REWARD = Limits("reward", address_space_mb=768, cpu_s=7, open_files=16, wall_s=60)
PROBE = Limits("probe", address_space_mb=512, cpu_s=2, open_files=16, wall_s=5)
