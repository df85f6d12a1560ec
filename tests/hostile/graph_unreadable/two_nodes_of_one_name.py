"""Two nodes of one name."""

from tests.hostile.parts import Upload, car, field, small_car


def build() -> Upload:
    return car(small_car() + field(1, field(1, "main_level/agent/main/online/network_1/sub") + field(2, "Sub")))
