"""Finds the output of a network that drives the car."""

# An exported policy may have more outputs than the actions: stable-baselines3's has actions, values and log_prob, many
# have logits and a value. The output that fits the action space is taken, and what only the others need is left out. A
# discrete policy may also output the number of its action; then the scores before it are taken, which give the same
# choice.

from collections.abc import Callable
from typing import TypeVar

from paddock.errors import UserFault
from paddock.network.model import DTYPES, FLOAT, Model, Node, Port
from paddock.network.wire import printable
from paddock.packages.metadata import DISCRETE, ModelMetadata

_MOST = 16  # outputs
_SAME_NUMBER = ("Identity", "Cast", "Reshape", "Squeeze", "Unsqueeze", "Flatten")  # after an ArgMax over one row
# of several that fit, the one of such a name: what libraries call it
_NAMES = ("actions", "action", "logits", "action_logits", "policy", "pi", "probs", "mean", "mu", "scores")


def candidates(model: Model, metadata: ModelMetadata) -> list[tuple[Port, str]]:
    """The outputs that may drive, by their declarations, with their names in the file.

    Raises UserFault ``onnx_output`` or ``onnx_too_big``."""
    if len(model.outputs) > _MOST:
        raise UserFault("onnx_too_big", part="outputs", limit=_MOST)
    makers = {name: node for node in model.nodes for name in node.outputs if name}
    found = []
    for port in model.outputs:
        scores = _chosen_from(port, makers) if metadata.action_space_type == DISCRETE else None
        if scores is not None:
            found.append((Port(scores, FLOAT, [1, None]), port.name))
        elif _may_fit(port, metadata):
            found.append((port, port.name))
    if not found:
        raise UserFault("onnx_output", expected=metadata.output_size, found=_described(model.outputs))
    return found


Result = TypeVar("Result")


def select(model: Model, metadata: ModelMetadata, check: Callable[[Port], Result]) -> tuple[Result, str]:
    """The result of ``check`` for the output that drives, and that output's name where there are several.

    ``check`` raises UserFault for an output that cannot drive. Raises the first of these faults where none can, and
    ``onnx_outputs`` where several can and none has a conventional name.
    """
    result: Result | None = None
    fits: list[str] = []
    faults: list[UserFault] = []
    for port, name in sorted(candidates(model, metadata), key=_rank):
        try:
            result = check(port)
        except UserFault as fault:
            faults = faults or [fault]  # each keeps its network in memory
            continue
        fits.append(name)
        if name.lower() in _NAMES:
            break
    if result is None:
        raise faults[0]
    if len(fits) > 1 and fits[-1].lower() not in _NAMES:
        names = ", ".join(printable(name, 40) for name in fits[:4])
        raise UserFault("onnx_outputs", found=names, expected=metadata.output_size)
    return result, printable(fits[-1], 80) if len(model.outputs) > 1 else ""


def _rank(candidate: tuple[Port, str]) -> int:
    name = candidate[1].lower()
    return _NAMES.index(name) if name in _NAMES else len(_NAMES)


def _described(ports: list[Port]) -> str:
    shown = [f"{printable(port.name, 40)} {DTYPES[port.dtype].name} {port.dims}" for port in ports[:4]]
    return ", ".join(shown) + (", ..." if len(ports) > 4 else "") or "none"


def _may_fit(port: Port, metadata: ModelMetadata) -> bool:
    fits = port.dtype == FLOAT and len(port.dims) == 2 and port.dims[0] in (None, 1)
    return fits and port.dims[1] in (None, metadata.output_size)


def _chosen_from(port: Port, makers: dict[str, Node]) -> str | None:
    """The scores whose greatest has this output as its number; None for another output."""
    node = makers.get(port.name)
    while node is not None and node.op in _SAME_NUMBER and node.inputs:
        node = makers.get(node.inputs[0])
    if node is None or node.op != "ArgMax" or not node.inputs or node.attributes.get("select_last_index", 0) != 0:
        return None
    return node.inputs[0] if node.attributes.get("axis", 0) in (1, -1) else None
