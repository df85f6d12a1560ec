"""A policy.pth that is a TorchScript program."""

import io

from tests.hostile.parts import Upload
from tests.hostile.policies import policy, torch


def build() -> Upload:
    file = io.BytesIO()
    torch().jit.save(torch().jit.script(torch().nn.Linear(2, 2)), file)
    return policy(file.getvalue())
