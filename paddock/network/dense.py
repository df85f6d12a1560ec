"""Converts large dense layers to equivalent convolutions, with weights in the runtime's own order."""

# A dense layer over a row of k values is a convolution over a picture of one pixel and k channels; over all values of a
# picture, a convolution whose kernel is as large as that picture. For a single row the runtime's convolution reads the
# weights faster than its matrix product (11,264 x 512 values in 0.41 ms instead of 0.72 ms).
#
# Those convolutions work on blocks of 8 or 16 channels; the runtime copies 23 MB four times to rearrange them. A row
# read as a picture in blocks of :data:`CHANNELS` channels keeps the order of its values, so only the outputs of a layer
# must be arranged. The runtime's operator for pictures does it once, into the memory that the session reads.

import functools
import math
from collections import Counter
from collections.abc import Callable

import numpy as np
import onnxruntime

from .canonical import CanonicalNetwork, canonicalise
from .model import FLOAT, Model, Node
from .written import message, number, text

# Below, measured on processors with 16 lanes of float32 and 1 MB of cache a core, the matrix product is as fast.
LEAST_WEIGHTS = 1 << 21
LEAST_OUTPUTS = 64
DOMAIN = "com.microsoft.nchwc"  # of the runtime's operators on blocks
CHANNELS = 16  # whole blocks on every processor, else the runtime has no fast convolution
ALIGNED = 64  # bytes: where its kernels read at full speed
_IR_VERSION, _OPSET = 10, 17

Shapes = dict[str, tuple[int, ...]]
Order = Callable[[np.ndarray], np.ndarray | None]


class Read(Shapes):
    """Shapes that record which of them are read."""

    def __init__(self, shapes: Shapes) -> None:
        super().__init__(shapes)
        self._known = dict(shapes)
        self._read: set[str] = set()

    def __getitem__(self, name: str) -> tuple[int, ...]:
        self._read.add(name)
        return super().__getitem__(name)

    @property
    def needed(self) -> Shapes:
        return {name: shape for name, shape in self._known.items() if name in self._read}


def dense_as_convolutions(network: CanonicalNetwork, shapes: Shapes, order: Order | None = None) -> CanonicalNetwork:
    """The network with every large dense layer as a convolution. ``network`` is used up.

    ``shapes``: of its values, and written to. ``order``: arranges weights (outputs, inputs) for the runtime, such as
    :func:`in_blocks`. Raises KeyError for a missing shape.
    """
    readers = Counter(name for node in network.nodes for name in node.inputs)
    found = [layer for node in network.nodes if (layer := _layer(network, node, shapes, readers))]
    if not found:
        return network
    for layer in found:
        _rewrite(network, *layer, shapes, order)
    model = Model(network.opset, network.nodes, network.weights, network.inputs, [network.output])
    return canonicalise(model)


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
    if weights.size < LEAST_WEIGHTS or outputs < LEAST_OUTPUTS or inputs % CHANNELS:
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
    ordered = order(weights) if order is not None and outputs % CHANNELS == 0 else None
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
        # directly after it, so that the runtime fuses both
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
    """The picture ``[1, C, H, W]`` whose values the row has, and whether they are channels last; or None."""
    makers = {name: node for node in network.nodes for name in node.outputs}
    flat = makers.get(row)
    if flat is None or flat.op not in ("Flatten", "Reshape"):
        return None
    picture, turned = flat.inputs[0], False
    maker = makers.get(picture)
    if maker is not None and maker.op == "Transpose" and maker.wholes("perm") == [0, 2, 3, 1]:
        picture, turned = maker.inputs[0], True
    shape = shapes[picture]
    if picture in network.weights or len(shape) != 4 or shape[1] % CHANNELS or math.prod(shape) != shapes[row][1]:
        return None
    return (picture, turned) if shape[0] == 1 else None


def _shape(network: CanonicalNetwork, name: str, shape: tuple[int, ...]) -> str:
    network.weights[f"{name}_shape"] = np.array(shape, np.int64)
    return f"{name}_shape"


def in_blocks(weights: np.ndarray) -> np.ndarray | None:
    """Float32 weights (outputs, inputs), both multiples of ``CHANNELS``, as the aligned kernel of a convolution of
    ``DOMAIN`` over a picture (1, CHANNELS, 1, inputs / CHANNELS). None without such operators on this processor."""
    arrange = arranger()
    if arrange is None:
        return None
    weights = np.ascontiguousarray(weights, np.float32)
    arranged = aligned_room(weights.shape)
    try:
        arrange(weights, arranged)
    except MemoryError:
        raise
    except Exception:  # another runtime arranges them itself
        return None
    outputs, inputs = weights.shape
    return arranged.reshape(outputs, CHANNELS, 1, inputs // CHANNELS)


def aligned_room(shape: tuple[int, ...], dtype: type | np.dtype = np.float32) -> np.ndarray:
    """A new uninitialised array that begins at a multiple of ``ALIGNED``."""
    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    room = np.empty(size + ALIGNED, np.uint8)
    start = -room.ctypes.data % ALIGNED
    return room[start : start + size].view(dtype).reshape(shape)


@functools.cache
def arranger() -> Callable[[np.ndarray, np.ndarray], None] | None:
    """A function that arranges the first array into the second, or None."""
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = 4
    try:
        session = onnxruntime.InferenceSession(_picture_in_blocks(), options, providers=["CPUExecutionProvider"])
    except Exception:  # processors without blocks, whose runtime has no such operator
        return None

    def arrange(weights: np.ndarray, arranged: np.ndarray) -> None:
        outputs, inputs = weights.shape
        binding = session.io_binding()
        picture = [1, outputs, 1, inputs]  # an output is a channel, its weights lie along a line
        binding.bind_input("from", "cpu", 0, np.float32, picture, weights.ctypes.data)
        binding.bind_output("to", "cpu", 0, np.float32, picture, arranged.ctypes.data)
        session.run_with_iobinding(binding)

    return arrange


def _picture_in_blocks() -> bytes:
    floats = message(2, message(1, number(1, FLOAT)))
    graph = message(1, text(1, "from") + text(2, "to") + text(4, "ReorderInput") + text(7, DOMAIN))
    graph += text(2, "blocks") + message(11, text(1, "from") + floats) + message(12, text(1, "to") + floats)
    operators = message(8, text(1, "") + number(2, _OPSET)) + message(8, text(1, DOMAIN) + number(2, 1))
    return number(1, _IR_VERSION) + message(7, graph) + operators
