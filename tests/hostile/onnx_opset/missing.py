"""No operator set at all."""

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    model = network()
    del model.opset_import[:]
    return pair(model)
