"""Writes the end of a network as the field's graphs have it: values and name of the last node."""

# Cars and tools of the field expect probabilities of a discrete policy (``ppo_head_0/policy`` is a softmax), two values
# of a continuous one, and of SAC the mean before the tanh, because the car applies the tanh itself (see
# :mod:`paddock.packages.tensorflow.convert`).

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
    def of(cls, metadata: ModelMetadata) -> "Head":
        return cls(metadata.algorithm == "sac", metadata.action_space_type == DISCRETE)

    @property
    def inputs(self) -> str:
        return f"main_level/agent/{'policy' if self.is_sac else 'main'}/online/network_0"

    @property
    def scope(self) -> str:
        return self.inputs if self.is_sac else "main_level/agent/main/online/network_1"

    @property
    def name(self) -> str:
        return f"{self.scope}/{'sac_policy_head_0' if self.is_sac else 'ppo_head_0'}/policy"

    def input_name(self, sensor: str) -> str:
        return f"{self.inputs}/{sensor}/{sensor}"


def finish(plain: Plain, head: Head) -> Plain:
    """The network with the last node of the field's graphs."""
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
