"""Operations that pass values on, choose between them or declare them."""

from __future__ import annotations

from paddock.errors import UserFault

from .graph import TensorflowNode
from .registry import Context, converts, known, require
from .values import DEAD, Flow, Known, Value


@converts("Identity", "StopGradient", "PreventGradient", "CheckNumerics", "Snapshot", "ReadVariableOp")
def _pass_on(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
    require(len(inputs) == 1)
    return inputs


@converts("IdentityN")
def _pass_all_on(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
    require(bool(inputs))
    return inputs


@converts("PlaceholderWithDefault")
def _default(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
    """Training flags and keep probabilities: nothing feeds them when a car drives."""
    require(len(inputs) == 1)
    return inputs


@converts("Const")
def _constant(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
    return [Known(node.attributes.tensor("value", context.limits))]


@converts("Switch")
def _switch(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Flow]:
    """``Switch(data, condition)``: output 0 if false, output 1 if true. The condition (is_training) is frozen."""
    require(len(inputs) == 2)
    condition = known(inputs[1])
    require(condition.dtype.kind == "b" and condition.size == 1)
    return [DEAD, inputs[0]] if condition.reshape(-1)[0] else [inputs[0], DEAD]


NOT_FROZEN = ("Variable", "VariableV2", "VarHandleOp", "Assign", "AssignVariableOp")


@converts(*NOT_FROZEN)
def _not_frozen(context: Context, node: TensorflowNode, inputs: list[Value]) -> list[Value]:
    raise UserFault("graph_not_frozen", node=node.op)
