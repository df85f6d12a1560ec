"""Keys that a reward function asks of params and that params do not have: by its text, and while it runs."""

import ast
import difflib
import sys
from collections.abc import Collection, Iterator
from types import CodeType
from typing import Any

from paddock.errors import UserFault

from .call_limits import FILENAME, line_of_frame
from .function import NAME, SELF, Params, Reward, printable, without_mark

MOST = 20
_LONGEST = 60


class AskedParams(dict[str, Any]):
    """Params that note the keys which they do not have, with the line that asked."""

    def __init__(self, params: Params, missed: dict[str, int]) -> None:
        super().__init__(params)
        self._missed = missed

    def __missing__(self, key: object) -> Any:
        self._note(key)
        raise KeyError(key)

    def get(self, key: Any, default: Any = None) -> Any:
        if key not in self:
            self._note(key)
        return super().get(key, default)

    def _note(self, key: object) -> None:
        if type(key) is str and len(self._missed) < MOST:
            self._missed.setdefault(printable(key[:_LONGEST]), line_of_frame(sys._getframe(1)))


class AskingReward(Reward):
    """A reward function that notes the keys which params did not have in ``missed``, by key the line."""

    def __init__(self, program: CodeType, missed: dict[str, int]) -> None:
        super().__init__(program)
        self._missed = missed

    def _copy(self, params: Params) -> Params:
        return AskedParams(super()._copy(params), self._missed)


def foreign_params(code: str, known: Collection[str], missed: dict[str, int]) -> list[UserFault]:
    """A warning for each key that is not ``known``, by line: those in the text, and those ``missed`` at run time.
    ``code`` is known to be Python."""
    found = {printable(name[:_LONGEST]): line for name, line in _in_text(without_mark(code), known)} | missed
    return [_warning(name, line, known) for name, line in sorted(found.items(), key=lambda one: one[1])[:MOST]]


def _warning(name: str, line: int, known: Collection[str]) -> UserFault:
    meant = difflib.get_close_matches(name, known, n=1)
    if meant:
        return UserFault("reward_param_unknown", line=line, name=name, meant=meant[0])
    return UserFault("reward_param_foreign", line=line, name=name)


def _in_text(code: str, known: Collection[str]) -> Iterator[tuple[str, int]]:
    tree = ast.parse(code, FILENAME)
    holders = {"params"}
    for one in tree.body:
        if isinstance(one, ast.FunctionDef) and one.name == NAME:
            names = [each.arg for each in (*one.args.posonlyargs, *one.args.args) if each.arg != SELF]
            holders |= set(names[:1]) if len(names) == 1 else set()
    asked, own = [], set(known)
    for node in ast.walk(tree):
        if isinstance(node, ast.Subscript) and _is_one_of(node.value, holders):
            key: ast.expr = node.slice
        elif (
            isinstance(node, ast.Call)
            and isinstance(node.func, ast.Attribute)
            and node.func.attr == "get"
            and node.args
            and _is_one_of(node.func.value, holders)
        ):
            key = node.args[0]
        else:
            continue
        if isinstance(key, ast.Constant) and isinstance(key.value, str):
            if isinstance(getattr(node, "ctx", None), ast.Store):
                own.add(key.value)
            else:
                asked.append((key.value, node.lineno))
    return ((name, line) for name, line in reversed(asked) if name not in own)


def _is_one_of(node: ast.expr, names: Collection[str]) -> bool:
    return isinstance(node, ast.Name) and node.id in names
