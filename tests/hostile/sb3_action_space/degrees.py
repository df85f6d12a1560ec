"""A policy that answers degrees and metres."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy


def build() -> Upload:
    return policy(
        action_space={":type:": "<class 'gymnasium.spaces.box.Box'>", "low": "[-30. 0.5]", "high": "[30. <b>]"}
    )
