"""A policy.pth whose pickle would evaluate Python."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy


class Payload:
    def __reduce__(self) -> tuple:
        return eval, ("open('PWNED', 'w')",)


def build() -> Upload:
    return policy({"action_net.weight": Payload()})
