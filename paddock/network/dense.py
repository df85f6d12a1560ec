"""Large dense layers, written as the convolutions that they are.

A dense layer over a row of k values is a convolution over a picture of one pixel and k channels; over all values of a
picture, it is one whose kernel is as large as that picture. For a single row the runtime's convolution reads the
weights faster than its matrix product does, and a layer whose weights are larger than the processor's own cache is
nothing but reading them: 11,264 x 512 values take 0.41 ms in place of 0.72 ms. Only the order of the additions differs.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable

import numpy as np

from .blocked import DOMAIN
from .canonical import CanonicalNetwork, canonicalise
from .model import Model, Node

# Below, measured on processors with 16 lanes of float32 and 1 MB of cache a core, the matrix product is as fast.
LEAST_WEIGHTS = 1 << 21
LEAST_OUTPUTS = 64
_LANES = 16  # channels come in blocks of this many, else the runtime has no fast convolution

Shapes = dict[str, tuple[int, ...]]
Order = Callable[[np.ndarray], np.ndarray | None]


class Read(Shapes):
    """Shapes that remember which of them were asked for."""

    def __init__(self, shapes: Shapes) -> None:
        super().__init__(shapes)
        self._known = dict(shapes)
        self._read: set[str] = set()

    def __getitem__(self, name: str) -> tuple[int, ...]:
        self._read.add(name)
        return super().__getitem__(name)

    @property
    def needed(self) -> Shapes:
        """Those that were asked for, of the ones that were given."""
        return {name: shape for name, shape in self._known.items() if name in self._read}


def dense_as_convolutions(network: CanonicalNetwork, shapes: Shapes, order: Order | None = None) -> CanonicalNetwork:
    """The same network with every large dense layer as a convolution; the very same if there is none.

    ``shapes``: of its values, and written to; :class:`Read` tells which of them were needed. ``order``: what brings
    weights (outputs, inputs) into the runtime's own order, such as :func:`.blocked.in_blocks`: only the runtime reads
    what comes of it. ``network`` is used up. Raises KeyError for a shape that is missing, and nothing that
    :func:`.canonicalise` did not raise before.
    """
    readers = Counter(name for node in network.nodes for name in node.inputs)
    found = [layer for node in network.nodes if (layer := _layer(network, node, shapes, readers))]
    if not found:
        return network
    for layer in found:
        _rewrite(network, *layer, shapes, order)
    model = Model(network.opset, network.nodes, network.weights, network.inputs, [network.output])
    return canonicalise(model)  # leaves out what nobody reads any more, and orders and numbers the rest


def _layer(
    network: CanonicalNetwork, node: Node, shapes: Shapes, readers: Counter[str]
) -> tuple[Node, np.ndarray, list[str]] | None:
    """A large dense layer over one row: its operation, its weights output by output, and the name of its bias."""
    if node.op not in ("Gemm", "MatMul"):
        return None
    row, name, *bias = node.inputs
    weights = network.weights.get(name)
    plain = all(node.attributes.get(scale, 1.0) == 1.0 for scale in ("alpha", "beta"))
    if weights is None or weights.ndim != 2 or weights.dtype != np.float32 or not plain or readers[name] > 1:
        return None
    if not node.whole("transB", 0):
        weights = weights.T
    outputs, inputs = weights.shape
    if weights.size < LEAST_WEIGHTS or outputs < LEAST_OUTPUTS or inputs % _LANES:
        return None
    if shapes[row] != (1, inputs) or shapes[node.outputs[0]] != (1, outputs):
        return None
    if any(one not in network.weights or network.weights[one].shape != (outputs,) for one in bias):
        return None
    return node, weights, bias


def _rewrite(
    network: CanonicalNetwork, node: Node, weights: np.ndarray, bias: list[str], shapes: Shapes, order: Order | None
) -> None:
    row, result = node.inputs[0], node.outputs[0]
    outputs, inputs = weights.shape
    before: list[Node] = []
    ordered = order(weights) if order is not None and outputs % _LANES == 0 else None
    behind = None if ordered is not None else _picture(network, row, shapes)
    if behind is None:
        picture = f"{result}_picture"
        channels, *size = (inputs, 1, 1) if ordered is None else ordered.shape[1:]
        before.append(Node("Reshape", [row, _shape(network, picture, (1, channels, *size))], [picture], {}))
    else:
        picture, turned = behind
        channels, *size = shapes[picture][1:]
        if turned:
            weights = weights.reshape(outputs, *size, channels).transpose(0, 3, 1, 2)
    kernel = f"{result}_kernel"
    if ordered is None:
        ordered, domain = np.ascontiguousarray(weights.reshape(outputs, channels, *size)), ""
    else:
        domain = DOMAIN
    network.weights[kernel] = ordered
    pixels = f"{result}_pixels"
    layer = Node("Conv", [picture, kernel, *bias], [pixels], {"kernel_shape": size}, domain=domain)
    after = [layer]
    place = network.nodes.index(node)
    end = place + 1
    readers = [other for other in network.nodes if result in other.inputs]
    if len(readers) == 1 and readers == network.nodes[end : end + 1] and readers[0].op == "Relu":
        # at once, the runtime makes one operation of both; of its own it did so before
        if domain:
            layer.attributes["activation"] = "Relu"
        else:
            after.append(Node("Relu", [pixels], [f"{pixels}_on"], {}))
            pixels = f"{pixels}_on"
        result = readers[0].outputs[0]
        end += 1
    shapes[pixels] = (1, outputs, 1, 1)
    after.append(Node("Reshape", [pixels, _shape(network, kernel, (1, outputs))], [result], {}))
    network.nodes[place:end] = before + after


def _picture(network: CanonicalNetwork, row: str, shapes: Shapes) -> tuple[str, bool] | None:
    """The picture ``[1, C, H, W]`` whose values the row is, and whether they lie there channels last; or None."""
    makers = {name: node for node in network.nodes for name in node.outputs}
    flat = makers.get(row)
    if flat is None or flat.op not in ("Flatten", "Reshape"):
        return None
    picture, turned = flat.inputs[0], False
    maker = makers.get(picture)
    if maker is not None and maker.op == "Transpose" and maker.wholes("perm") == [0, 2, 3, 1]:
        picture, turned = maker.inputs[0], True
    shape = shapes[picture]
    if picture in network.weights or len(shape) != 4 or shape[1] % _LANES or math.prod(shape) != shapes[row][1]:
        return None
    return (picture, turned) if shape[0] == 1 else None


def _shape(network: CanonicalNetwork, name: str, shape: tuple[int, ...]) -> str:
    network.weights[f"{name}_shape"] = np.array(shape, np.int64)
    return f"{name}_shape"
