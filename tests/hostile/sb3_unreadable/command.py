"""A policy.pth whose pickle would run a command."""

import os

from tests.hostile.parts import Upload
from tests.hostile.policies import policy


class Payload:
    def __reduce__(self) -> tuple:
        return os.system, ("touch PWNED",)


def build() -> Upload:
    return policy({"action_net.weight": Payload()})
