"""A constant that claims 2^62 elements."""

from tests.hostile.parts import FLOAT, Attr, GraphWriter, Upload, car, field


def build() -> Upload:
    writer = GraphWriter()
    shape = field(2, field(1, 1 << 31)) * 2
    tensor = field(1, 1) + field(2, shape) + field(4, b"abcd")
    writer.node("w", "Const", dtype=Attr.dtype(FLOAT), value=field(8, tensor))
    writer.op("ppo_head_0/policy", "Softmax", "w")
    return car(writer.build())
