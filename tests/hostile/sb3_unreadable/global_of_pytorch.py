"""A policy.pth whose pickle names a function of torch that reads another file."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy, torch


class Payload:
    def __reduce__(self) -> tuple:
        return torch().load, ("/etc/passwd",)


def build() -> Upload:
    return policy({"action_net.weight": Payload()})
