"""Warnings about a reward function: comparisons that are never true, and slow calls.

``steps`` begins at 2 in an episode, and ``progress`` runs to 100.
"""

import ast
from collections.abc import Iterator, Sequence
from typing import Any

from paddock.errors import UserFault

from .function import FILENAME, printable, without_mark

STEPS, PROGRESS = "steps", "progress"
FIRST_STEPS = 2  # of an episode, when the function is called for the first time
_MOST = 10
_NAMES = {STEPS, PROGRESS}
ast.unparse(ast.Constant(0))  # from Python 3.14 on the first call imports a module, and a locked process opens no file
_MIRRORED: dict[type[ast.cmpop], type[ast.cmpop]] = {ast.Gt: ast.Lt, ast.GtE: ast.LtE}


def hints_of(code: str) -> list[UserFault]:
    """Hints by line, at most ten. ``code`` is known to be Python."""
    tree = ast.parse(without_mark(code), FILENAME)
    meant = _meant(tree)
    found = [hint for node in ast.walk(tree) if isinstance(node, ast.Compare) for hint in _compared(node, meant)]
    return sorted(found, key=lambda hint: hint.params["line"])[:_MOST]


def _meant(tree: ast.Module) -> dict[str, str]:
    """Variables and attributes that hold ``params["steps"]`` or ``params["progress"]``, and arguments of these
    names."""
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
    parts = node.elts if isinstance(node, ast.Tuple | ast.List | ast.Set) else [node]
    values = [part.value if isinstance(part, ast.Constant) else None for part in parts]
    if None in values:
        return []
    return [float(value) for value in values if isinstance(value, int | float) and not isinstance(value, bool)]


def _never(kind: type[ast.cmpop], values: list[float]) -> bool:
    if not values:
        return False
    if kind in (ast.Eq, ast.Is, ast.In, ast.LtE):
        return max(values) < FIRST_STEPS
    return kind is ast.Lt and values[0] <= FIRST_STEPS


SLOW_MS = 5.0  # of a call: from here on it is worth a warning
SLOW_LOAD_MS = 500.0  # of the lines outside of the function, which run once for each car
UPDATE_STEPS = 2_000  # that a training drives between two updates by default: 20 episodes
CARS = 20  # that load it: 16 that gather experience, and those of the evaluations


def slowness(call_ms: Sequence[float], load_ms: float) -> list[UserFault]:
    """Warnings about the processor time of calls and of loading. The slowest of several calls does not count."""
    warnings = []
    usual = sorted(call_ms)[: max(1, len(call_ms) - 1)]
    mean = sum(usual) / len(usual) if usual else 0.0
    if mean >= SLOW_MS:
        warnings.append(
            UserFault("reward_slow", ms=round(mean), steps=UPDATE_STEPS, seconds=round(mean * UPDATE_STEPS / 1000.0))
        )
    if load_ms >= SLOW_LOAD_MS:
        params = {"ms": round(load_ms), "count": CARS, "seconds": round(load_ms * CARS / 1000.0)}
        warnings.append(UserFault("reward_slow_start", **params))
    return warnings
