"""A placeholder whose name is markup and terminal codes."""

from tests.hostile.parts import Upload, car, small_car


def build() -> Upload:
    return car(
        small_car().replace(b"FRONT_FACING_CAMERA/FRONT_FACING_CAMERA", b"FRONT_FACING_CAMERA/<b>\x1b[31m___________")
    )
