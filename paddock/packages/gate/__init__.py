"""The static gate: checks an ONNX network before any runtime loads it, and returns its canonical form."""

# It runs inside the sandboxed admission process, for uploaded and for converted networks alike.

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from paddock.errors import UserFault
from paddock.network.bound import NetworkFacts
from paddock.network.canonical import CanonicalNetwork, canonicalise, write_model
from paddock.network.dense import Read, dense_as_convolutions
from paddock.network.model import DTYPES, FLOAT, UINT8, Model, Port, read_model
from paddock.network.wire import printable
from paddock.packages.inputs import InputSpec
from paddock.packages.limits import DEFAULT_LIMITS, PackageLimits
from paddock.packages.metadata import ModelMetadata, identity

from .cost import Cost, measure
from .operators import check_operator
from .outputs import select
from .sizes import fold_sizes

__all__ = ["Canonical", "check_onnx"]

_SMALL = 4 << 20


@dataclass(frozen=True)
class Canonical:
    """A network that may race. ``inputs`` and ``output`` are ``(name, "uint8"|"float32", shape)``; ``facts``:
    of its arithmetic, without a bound until it was tried out."""

    onnx: bytes
    sha256: str
    inputs: tuple[tuple[str, str, tuple[int, ...]], ...]
    output: tuple[str, str, tuple[int, ...]]
    parameters: int
    macs: int
    facts: NetworkFacts
    taken: str = ""  # the output's name in the file, where that has several


def check_onnx(
    data: bytes,
    metadata: ModelMetadata,
    limits: PackageLimits = DEFAULT_LIMITS,
    weights: Mapping[str, bytes] | None = None,
) -> Canonical:
    """Check a serialised ONNX model against the contract and write it anew.

    The contract: one input for each sensor, named as the sensor unless it is the only one (pictures uint8 or float32,
    0-255, NHWC or NCHW); a float32 output, ``[1, n]`` scores over n discrete actions or ``[1, 2]`` in [-1, 1], perhaps
    beside others (:mod:`.outputs`). A free batch size becomes one. ``weights``: files of weights beside it, by name.
    Raises UserFault with a code of the gate section.
    """
    if len(data) + sum(map(len, (weights or {}).values())) > limits.model_bytes:
        raise UserFault("model_too_large", limit_mb=limits.model_bytes >> 20)
    model = read_model(data, limits, weights)
    del data, weights  # its weights are views into them, and go one by one as they are written anew
    check = partial(_drawn_from, model, metadata, limits)
    (network, cost), output = select(model, metadata, check)
    del model, check
    network.output = Port(network.output.name, FLOAT, list(cost.output[1]))
    written = write_model(network)
    parameters, inputs, described = network.parameters, network.inputs, _described(network.output)
    shapes = Read(cost.shapes)
    dense_as_convolutions(network, shapes)
    return Canonical(
        onnx=written,
        sha256=identity(written, metadata),
        inputs=tuple(_described(port) for port in inputs),
        output=described,
        parameters=parameters,
        macs=cost.macs,
        facts=NetworkFacts(shapes=shapes.needed),
        taken=output,
    )


def _drawn_from(
    model: Model, metadata: ModelMetadata, limits: PackageLimits, port: Port
) -> tuple[CanonicalNetwork, Cost]:
    """The part of the model that makes this output, checked, and its cost."""
    network = canonicalise(model, port)
    for node in network.nodes:
        check_operator(node)
    network = fold_sizes(network)
    _fix_inputs(network, metadata)
    if not all(np.isfinite(array).all() for array in network.weights.values() if array.dtype.kind == "f"):
        raise UserFault("non_finite_weights")
    network.weights = {name: _detached(array) for name, array in network.weights.items()}
    cost = measure(network, limits)
    if cost.output != (FLOAT, (1, metadata.output_size)):
        raise UserFault("onnx_output", expected=metadata.output_size, found=str(list(cost.output[1])))
    return network, cost


def _detached(array: np.ndarray) -> np.ndarray:
    """A copy of a small weight, so that it does not keep the whole file in memory."""
    return array.copy() if array.nbytes < _SMALL else array


def _described(port: Port) -> tuple[str, str, tuple[int, ...]]:
    return port.name, DTYPES[port.dtype].name, port.sizes


def _fix_inputs(network: CanonicalNetwork, metadata: ModelMetadata) -> None:
    """Check the inputs against the sensors, fix the batch to one and order them by name."""
    specs = {spec.sensor: spec for spec in metadata.inputs}
    if len(specs) == len(network.inputs) == 1:  # whatever its name, there is nothing to mistake it for
        ((sensor,), (port,)) = specs, network.inputs
        _rename_input(network, port, sensor)
    found = {port.name: port for port in network.inputs}
    if set(found) != set(specs):
        raise UserFault(
            "onnx_inputs", found=printable(", ".join(sorted(found)) or "none"), expected=", ".join(sorted(specs))
        )
    network.inputs = [_fixed(found[name], specs[name]) for name in sorted(specs)]


def _rename_input(network: CanonicalNetwork, port: Port, sensor: str) -> None:
    for node in network.nodes:
        node.inputs = [sensor if name == port.name else name for name in node.inputs]
    network.inputs = [Port(sensor, port.dtype, port.dims)]


def _fixed(port: Port, spec: InputSpec) -> Port:
    allowed = (FLOAT, UINT8) if spec.is_picture else (FLOAT,)
    if port.dtype not in allowed:
        raise UserFault(
            "onnx_input_type", sensor=spec.sensor, expected="uint8 or float32" if spec.is_picture else "float32"
        )
    dims = [port.dims[0] or 1, *port.dims[1:]] if port.dims else []
    if tuple(dims) not in (spec.channels_last, spec.channels_first):
        expected = " or ".join(str(list(shape)) for shape in dict.fromkeys((spec.channels_last, spec.channels_first)))
        raise UserFault("onnx_input_shape", sensor=spec.sensor, found=str(port.dims), expected=expected)
    return Port(port.name, port.dtype, dims)
