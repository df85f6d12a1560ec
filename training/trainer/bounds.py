"""What a training can weigh: the most that the files which come out of its process may have, by its network alone.

Measured with both algorithms, all depths, one camera and two: a network is its weights and less than 2 kB; a checkpoint
and stable-baselines3's file are 3.0 to 3.2 times the weights with PPO (Adam remembers two numbers for each) and 7.1 to
8.6 times with SAC, whose two critics each have their own, and less than 0.15 MB. No torch here.
"""

from __future__ import annotations

from dataclasses import dataclass

from .network import NetworkLayout
from .spec import TrainerSpec

_FLOAT = 4  # bytes
_TIMES = {"ppo": 3.2, "sac": 9.0}
_NETWORK_ROOM, _STATE_ROOM = 64 * 1024, 512 * 1024
SIMTRACE_PACKED, SIMTRACE_CSV = 1024 * 1024, 2 * 1024 * 1024  # 6000 rows are 0.3 and 1.2 MB


@dataclass(frozen=True)
class Bounds:
    """In bytes: ``network``, one policy as ONNX; ``state``, a checkpoint or stable-baselines3's file."""

    network: int
    state: int

    @property
    def message(self) -> int:
        """The most that the blobs of one message may have together."""
        return max(self.network + SIMTRACE_PACKED, self.state)


def bounds_of(spec: TrainerSpec) -> Bounds:
    """What this training can weigh. Raises LookupError for a network that no training here has."""
    weights = _FLOAT * NetworkLayout.of(spec.metadata, spec.build).parameters
    return Bounds(weights + _NETWORK_ROOM, int(_TIMES[spec.algorithm] * weights) + _STATE_ROOM)
