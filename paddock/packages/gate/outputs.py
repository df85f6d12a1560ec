"""Which output of a network drives the car.

An exported policy may answer more than the actions: stable-baselines3's gives actions, values and log_prob, many give
logits and a value. The one that fits the action space is taken, and what only the others need is left out. A
discrete policy may also answer the number of its action; then the scores that it chose from are taken, which is the
same choice.
"""

from __future__ import annotations

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
    """The outputs that may drive, by what the file says of them, with their names in the file.

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
        raise UserFault("onnx_output", expected=metadata.output_size, found=described(model.outputs))
    return found


Result = TypeVar("Result")


def select(model: Model, metadata: ModelMetadata, check: Callable[[Port], Result]) -> tuple[Result, str]:
    """What ``check`` makes of the output that drives, and that output's name where there are several.

    ``check`` raises UserFault for an output that cannot drive; with only one candidate, that is the answer. Raises
    ``onnx_outputs`` where several can, and none has a name that says it.
    """
    found = candidates(model, metadata)
    if len(found) == 1:
        ((port, name),) = found
        return check(port), _told(model, name)
    result: Result | None = None
    fits: list[str] = []
    first_fault: UserFault | None = None
    for port, name in _by_name(found):
        try:
            result = check(port)
        except UserFault as fault:
            first_fault = first_fault or fault
            continue
        fits.append(name)
        if name.lower() in _NAMES:
            break
    if result is None:
        raise first_fault or UserFault("onnx_output", expected=metadata.output_size, found=described(model.outputs))
    if len(fits) > 1 and fits[-1].lower() not in _NAMES:
        names = ", ".join(printable(name, 40) for name in fits[:4])
        raise UserFault("onnx_outputs", found=names, expected=metadata.output_size)
    return result, _told(model, fits[-1])


def described(ports: list[Port]) -> str:
    """Outputs for a sentence."""
    shown = [f"{printable(port.name, 40)} {DTYPES[port.dtype].name} {port.dims}" for port in ports[:4]]
    return ", ".join(shown) + (", ..." if len(ports) > 4 else "") or "none"


def _by_name(found: list[tuple[Port, str]]) -> list[tuple[Port, str]]:
    """Those of a known name first, as the list orders them."""

    def rank(one: tuple[Port, str]) -> int:
        name = one[1].lower()
        return _NAMES.index(name) if name in _NAMES else len(_NAMES)

    return sorted(found, key=rank)


def _told(model: Model, name: str) -> str:
    return printable(name, 80) if len(model.outputs) > 1 else ""


def _may_fit(port: Port, metadata: ModelMetadata) -> bool:
    fits = port.dtype == FLOAT and len(port.dims) == 2 and port.dims[0] in (None, 1)
    return fits and port.dims[1] in (None, metadata.output_size)


def _chosen_from(port: Port, makers: dict[str, Node]) -> str | None:
    """The scores of which this output is the number of the greatest; None for another output."""
    node = makers.get(port.name)
    while node is not None and node.op in _SAME_NUMBER and node.inputs:
        node = makers.get(node.inputs[0])
    if node is None or node.op != "ArgMax" or not node.inputs or node.attributes.get("select_last_index", 0) != 0:
        return None
    return node.inputs[0] if node.attributes.get("axis", 0) in (1, -1) else None
