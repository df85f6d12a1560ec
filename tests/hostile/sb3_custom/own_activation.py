"""An activation of the uploader's own."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy


def build() -> Upload:
    return policy(policy_kwargs={"activation_fn": "<class '__main__.Mine'>"})
