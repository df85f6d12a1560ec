"""A model for others than Paddock: the field's ``model.tar.gz`` of physical cars, and OpenVINO's representation.

Both are written from the canonical network by our own writers; neither TensorFlow nor OpenVINO is needed. What is
uploaded again as a ``model.tar.gz`` is the same model: see :mod:`.marked`.
"""

from __future__ import annotations

import json

from paddock.errors import UserFault
from paddock.network.canonical import CanonicalNetwork
from paddock.packages.inputs import InputSpec
from paddock.packages.kinds import CAR
from paddock.packages.metadata import ModelMetadata

from . import lower_layers, lower_math, lower_shape  # noqa: F401  (they register their converters)
from .archives import tar_gz
from .ir import write_ir
from .lower import lower
from .marked import exported
from .policy import Head, finish

__all__ = ["export_model", "frozen_graph", "openvino_ir"]


def export_model(onnx: bytes, metadata: ModelMetadata, form: str) -> bytes:
    """A canonical network as a ``.tar.gz`` of one of :data:`.kinds.EXPORTS`: ``agent/model.pb`` or ``model.xml`` and
    ``model.bin``, with ``model_metadata.json``.

    Raises UserFault ``export_operator`` for a network that the form cannot say, ``export_frame_stack`` for one that
    reads several observations at once.
    """
    about = json.dumps(metadata.to_dict(), indent=2).encode()
    if form == CAR:
        specs = _specs(metadata)
        parts = exported(CanonicalNetwork.read(onnx), specs, Head.of(metadata))
        return tar_gz({"agent/model.pb": parts, "model_metadata.json": [about]})
    xml, numbers = openvino_ir(onnx, metadata)
    return tar_gz({"model.xml": [xml], "model.bin": [numbers], "model_metadata.json": [about]})


def frozen_graph(onnx: bytes, metadata: ModelMetadata) -> bytes:
    """A canonical network as a frozen TensorFlow GraphDef with the console's node names."""
    specs = _specs(metadata)
    return b"".join(exported(CanonicalNetwork.read(onnx), specs, Head.of(metadata)))


def openvino_ir(onnx: bytes, metadata: ModelMetadata) -> tuple[bytes, bytes]:
    """A canonical network as OpenVINO's intermediate representation: its XML and its numbers."""
    head, specs = Head.of(metadata), _specs(metadata)
    return write_ir(finish(lower(CanonicalNetwork.read(onnx), specs), head), head)


def _specs(metadata: ModelMetadata) -> dict[str, InputSpec]:
    """The inputs by sensor. Raises UserFault ``export_frame_stack``: what drives these forms keeps no frames."""
    if metadata.frame_stack > 1:
        raise UserFault("export_frame_stack", count=str(metadata.frame_stack))
    return {spec.sensor: spec for spec in metadata.inputs}
