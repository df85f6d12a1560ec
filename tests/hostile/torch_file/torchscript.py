"""A TorchScript archive: a program and its constants."""

from tests.hostile.parts import Upload, zipped


def build() -> Upload:
    return [
        (
            "car.pt",
            zipped(("car/data.pkl", b"\x80\x02."), ("car/code/__torch__.py", b"import os"), ("car/version", b"3")),
        )
    ]
