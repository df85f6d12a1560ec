"""More nodes than a frozen policy has."""

from tests.hostile.parts import Upload, car, field, small_car


def build() -> Upload:
    return car(small_car() + b"".join(field(1, field(1, f"n{number}") + field(2, "NoOp")) for number in range(5_000)))
