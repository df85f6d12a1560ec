"""A pickle that would run a command."""

import os
import pickle

from tests.hostile.parts import Upload, pair


class Payload:
    def __reduce__(self) -> tuple:
        return os.system, ("touch PWNED",)


def build() -> Upload:
    return pair(pickle.dumps(Payload()))
