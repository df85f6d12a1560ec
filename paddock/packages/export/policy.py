"""How a network ends in the field's graphs: what their last node answers, and what it is called.

Cars and tools of the field expect probabilities of a discrete policy (``ppo_head_0/policy`` is a softmax), two values
of a continuous one, and of SAC the mean before it is squashed, because the car takes the tanh itself (``heads`` of
:mod:`paddock.packages.tensorflow`). Names: deepracer.md 1.4.
"""

from __future__ import annotations

from dataclasses import dataclass

from paddock.packages.metadata import DISCRETE, ModelMetadata

from .lower import Lowering
from .plain import Plain, Value

_ALMOST_ONE = 0.9999999  # what tanh makes of 8.4; that of one itself would be infinite


@dataclass(frozen=True)
class Head:
    """``is_sac``: of the algorithm SAC, else of PPO; ``scores``: one value for each action."""

    is_sac: bool
    scores: bool

    @classmethod
    def of(cls, metadata: ModelMetadata) -> Head:
        """The head that a car's metadata asks for."""
        return cls(metadata.algorithm == "sac", metadata.action_space_type == DISCRETE)

    @property
    def inputs(self) -> str:
        """The scope of what the sensors read."""
        return f"main_level/agent/{'policy' if self.is_sac else 'main'}/online/network_0"

    @property
    def scope(self) -> str:
        """The scope of the layers."""
        return self.inputs if self.is_sac else "main_level/agent/main/online/network_1"

    @property
    def name(self) -> str:
        """The policy's node."""
        return f"{self.scope}/{'sac_policy_head_0' if self.is_sac else 'ppo_head_0'}/policy"

    def input_name(self, sensor: str) -> str:
        """The node of what a sensor reads."""
        return f"{self.inputs}/{sensor}/{sensor}"


def finish(plain: Plain, head: Head) -> Plain:
    """The network with the end that the field expects."""
    output = plain.output
    assert output is not None
    last = plain.made_by(output)
    if head.scores and (last is None or last.kind != "softmax"):
        plain.output = plain.softmax(output)
    if head.is_sac:
        if last is not None and last.kind == "tanh":
            (squashed,) = last.inputs
            assert isinstance(squashed, Value)  # what hangs on no sensor was computed before
            plain.output = squashed
            plain.prune()
        else:
            to = Lowering(0)
            to.plain = plain
            within = to.binary("min", to.binary("max", output, -_ALMOST_ONE), _ALMOST_ONE)
            ratio = to.plain.binary("div", to.binary("add", within, 1.0), to.binary("sub", 1.0, within))
            plain.output = to.binary("mul", plain.unary("log", ratio), 0.5)
    return plain
