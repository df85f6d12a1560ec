"""A policy class of the uploader's own, with markup in its module's name."""

from tests.hostile.parts import Upload
from tests.hostile.policies import policy


def build() -> Upload:
    return policy(policy_class={"__module__": "<script>alert(1)</script>\u202e"})
