"""Comparisons that never hold in a reward function: hints about a text that runs, and does not do what it should.

``steps`` begins at 2 in an episode, and ``progress`` runs to 100.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import Any

from paddock.errors import UserFault

from .function import FILENAME, printable, without_mark

STEPS, PROGRESS = "steps", "progress"
FIRST_STEPS = 2  # of an episode, when the function is called for the first time
_MOST = 10
_NAMES = {STEPS, PROGRESS}
_MIRRORED: dict[type[ast.cmpop], type[ast.cmpop]] = {ast.Gt: ast.Lt, ast.GtE: ast.LtE}


def hints_of(code: str) -> list[UserFault]:
    """Hints by line, at most ten. ``code`` is known to be Python."""
    tree = ast.parse(without_mark(code), FILENAME)
    meant = _meant(tree)
    found = [hint for node in ast.walk(tree) if isinstance(node, ast.Compare) for hint in _compared(node, meant)]
    return sorted(found, key=lambda hint: hint.params["line"])[:_MOST]


def _meant(tree: ast.Module) -> dict[str, str]:
    """What variables and attributes stand for: those that are set to ``params["steps"]`` or ``params["progress"]``, and
    the arguments of these names."""
    meant: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.arg) and node.arg in _NAMES:
            meant[node.arg] = node.arg
        for target, value in _assigned(node):
            key, name = _key_of(value, {}), _name_of(target)
            if key and name:
                meant[name] = key
    return meant


def _assigned(node: ast.AST) -> Iterator[tuple[ast.expr, ast.expr]]:
    """The pairs of target and value that a statement sets."""
    targets: list[ast.expr]
    if isinstance(node, ast.Assign):
        targets, value = node.targets, node.value
    elif isinstance(node, ast.AnnAssign | ast.NamedExpr) and node.value is not None:
        targets, value = [node.target], node.value
    else:
        return
    for target in targets:
        if isinstance(target, ast.Tuple | ast.List) and isinstance(value, ast.Tuple | ast.List):
            yield from zip(target.elts, value.elts, strict=False)
        else:
            yield target, value


def _name_of(node: ast.AST) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def _key_of(node: ast.AST, meant: dict[str, str]) -> str:
    """``"steps"`` or ``"progress"`` where the expression is that value of params; else ``""``."""
    if isinstance(node, ast.NamedExpr):
        node = node.value
    if isinstance(node, ast.Call) and node.args:
        called = node.func
        if isinstance(called, ast.Name) and called.id in ("int", "float", "round", "abs"):
            return _key_of(node.args[0], meant)
        if not (isinstance(called, ast.Attribute) and called.attr == "get"):
            return ""
        key: ast.AST = node.args[0]
    elif isinstance(node, ast.Subscript):
        key = node.slice
    else:
        return meant.get(_name_of(node), "")
    value = key.value if isinstance(key, ast.Constant) else None
    return value if isinstance(value, str) and value in _NAMES else ""


def _compared(node: ast.Compare, meant: dict[str, str]) -> Iterator[UserFault]:
    sides = [node.left, *node.comparators]
    for left, operator, right in zip(sides, node.ops, sides[1:], strict=False):
        kind: Any = type(operator)
        key, other = _key_of(left, meant), right
        if not key:
            key, other, kind = _key_of(right, meant), left, _MIRRORED.get(kind, kind)
            if isinstance(operator, ast.In | ast.NotIn | ast.Lt | ast.LtE):
                continue
        values = _numbers(other)
        line = node.lineno
        if key == STEPS and _never(kind, values):
            yield UserFault("reward_first_step", line=line, value=printable(ast.unparse(other)))
        elif key == PROGRESS and kind in (ast.Eq, ast.Is, ast.In) and 1 in values and max(values) <= 1:
            yield UserFault("reward_percent", line=line, value=printable(ast.unparse(other)))


def _numbers(node: ast.AST) -> list[float]:
    """The numbers of a constant, or of a list of constants; none where anything else is among them."""
    parts = node.elts if isinstance(node, ast.Tuple | ast.List | ast.Set) else [node]
    values = [part.value if isinstance(part, ast.Constant) else None for part in parts]
    if None in values:
        return []
    return [float(value) for value in values if isinstance(value, int | float) and not isinstance(value, bool)]


def _never(kind: type[ast.cmpop], values: list[float]) -> bool:
    """Whether no number of steps compares so."""
    if not values:
        return False
    if kind in (ast.Eq, ast.Is, ast.In, ast.LtE):
        return max(values) < FIRST_STEPS
    return kind is ast.Lt and values[0] <= FIRST_STEPS
