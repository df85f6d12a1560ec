"""Exports a model as a ``model.tar.gz`` for physical cars and as OpenVINO files."""

# Both are written from the canonical network by our own writers; neither TensorFlow nor OpenVINO is needed. An exported
# ``model.tar.gz`` that is uploaded again is the same model: a graph defines what a network computes, but not which of
# many equal forms the network had (bytes or floats as input, the shapes of its layers), so the policy's node carries a
# mark with the network but for the large weights, which are in the graph. :mod:`paddock.packages.tensorflow.ours`
# verifies the mark.

import io
import json
import tarfile
import zlib
from collections.abc import Mapping, Sequence

from paddock.errors import UserFault
from paddock.network.canonical import CanonicalNetwork, write_model
from paddock.packages.inputs import InputSpec
from paddock.packages.kinds import CAR
from paddock.packages.metadata import ModelMetadata

from . import lower_layers, lower_math, lower_shape  # they register their converters
from .graphdef import Part, Written, policy_node, write_graph
from .lower import lower
from .plain import Step
from .policy import Head, finish

__all__ = ["export_model", "openvino_ir"]


FORM = 1  # the next one when the same network is written as another graph: see the test of the exported bytes
_LARGE = 64  # numbers; smaller weights are in the mark itself
_LEVEL = 0  # compression takes ten times as long as the rest, and saves a twelfth of the weights
_GZIP = 31  # zlib's value for a gzip header without a name or a time


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


def openvino_ir(onnx: bytes, metadata: ModelMetadata) -> tuple[bytes, bytes]:
    """A canonical network as OpenVINO's intermediate representation: its XML and its numbers."""
    from .ir import write_ir  # the reading of uploads imports this package, and needs no XML

    head, specs = Head.of(metadata), _specs(metadata)
    return write_ir(finish(lower(CanonicalNetwork.read(onnx), specs), head), head)


def _specs(metadata: ModelMetadata) -> dict[str, InputSpec]:
    """The inputs by sensor. Raises UserFault ``export_frame_stack``: what drives these forms keeps no frames."""
    if metadata.frame_stack > 1:
        raise UserFault("export_frame_stack", count=str(metadata.frame_stack))
    return {spec.sensor: spec for spec in metadata.inputs}


def exported(network: CanonicalNetwork, specs: Mapping[str, InputSpec], head: Head) -> list[Part]:
    """The network as a frozen TensorFlow GraphDef with the console's node names, in parts to be joined. Raises
    UserFault ``export_operator``."""
    written = write_graph(finish(lower(network, dict(specs)), head), head)
    return [*written.parts, policy_node(written, head, _mark(network, written, head))]


def _mark(network: CanonicalNetwork, written: Written, head: Head) -> bytes:
    kept = {
        name: place
        for name, place in written.weights.items()
        if name in network.weights and network.weights[name].size > _LARGE and can_be_undone(place[1])
    }
    mark = {
        "form": FORM,
        "sac": head.is_sac,
        "scores": head.scores,
        "weights": {
            name: [node, [[step.kind, *step.numbers] for step in steps]] for name, (node, steps) in kept.items()
        },
    }
    line = json.dumps(mark, sort_keys=True, separators=(",", ":")).encode()
    return line + b"\n" + write_model(network, frozenset(kept))


def can_be_undone(steps: Sequence[Step]) -> bool:
    """Whether nothing is reshaped whose axes were ordered anew before: the input shape of a reshape is not stored
    and not needed, as long as the reshape only changes how the same bytes are read."""
    kinds = [step.kind for step in steps]
    return kinds == sorted(kinds)


def tar_gz(files: Mapping[str, Sequence[Part]]) -> bytes:
    """The files, each in parts to be joined, as a ``.tar.gz`` without times and owners."""
    packer = zlib.compressobj(_LEVEL, zlib.DEFLATED, _GZIP)
    packed = io.BytesIO()
    for name, parts in files.items():
        member = tarfile.TarInfo(name)
        member.size = sum(map(len, parts))
        member.mode = 0o644
        packed.write(packer.compress(member.tobuf(tarfile.USTAR_FORMAT)))
        for part in parts:
            packed.write(packer.compress(part))
        packed.write(packer.compress(bytes(-member.size % tarfile.BLOCKSIZE)))
    packed.write(packer.compress(bytes(2 * tarfile.BLOCKSIZE)))
    packed.write(packer.flush())
    return packed.getvalue()
