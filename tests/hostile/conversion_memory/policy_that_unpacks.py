"""A policy.pth whose weights say of themselves that they unpack to four gigabytes."""

import io
import struct
import zipfile

from tests.hostile.parts import Upload
from tests.hostile.policies import policy, saved, torch

SIZE = 0xFFFFFFF0


def build() -> Upload:
    file, places = io.BytesIO(), []
    small = io.BytesIO(saved({"action_net.weight": torch().zeros(1000)}))
    with zipfile.ZipFile(small) as old, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            new.writestr(name, old.read(name))
            if name.endswith("/data/0"):
                places.append(new.getinfo(name).header_offset + 22)
    content = bytearray(file.getvalue())
    at = content.rindex(b"PK\x01\x02", 0, content.rindex(b"/data/0"))
    for place in (places[0], at + 24):
        struct.pack_into("<I", content, place, SIZE)
    return policy(bytes(content))
