"""Checks the text of a reward function, inside the sandbox, before it runs; the sandbox does not rely on them.

Rules (the reward function validation of DeepRacer on AWS): 1 to 140,000 characters; imports of math, random, numpy,
scipy and shapely (here also inside functions) and of :mod:`.allowed_modules`; no names that mean files or other code;
one ``reward_function``, defined or assigned.
"""

import ast
from collections.abc import Callable, Collection, Iterator

from pyflakes import checker, messages

from paddock.errors import UserFault

from .allowed_modules import is_allowed, leak_in
from .function import FILENAME, NAME, compile_reward, form_of, printable, without_mark

MAX_CHARACTERS = 140_000
_FORBIDDEN_NAMES = frozenset({"open", "exec", "eval", "compile", "input", "breakpoint", "__import__"})
_FORBIDDEN_ANYWHERE = frozenset(
    {"fromfile", "genfromtxt", "loadtxt", "tofile", "savez", "savez_compressed", "savetxt", "memmap"}
)
# A racer's own class may have a method "save".
_FORBIDDEN_IN_MODULES = _FORBIDDEN_ANYWHERE | {"load", "save", "chdir", "FileHandler"}
_MOST = 20

# Of what pyflakes finds, that which fails for sure when it runs: an import too many hurts nobody.
_MISTAKES = (
    messages.UndefinedLocal,
    messages.InvalidPrintSyntax,
    messages.StringDotFormatMissingArgument,
    messages.StringDotFormatInvalidFormat,
    messages.StringDotFormatMixingAutomatic,
    messages.PercentFormatInvalidFormat,
    messages.PercentFormatExpectedMapping,
    messages.PercentFormatExpectedSequence,
    messages.PercentFormatMissingArgument,
    messages.PercentFormatPositionalCountMismatch,
    messages.PercentFormatMixedPositionalAndNamed,
    messages.PercentFormatUnsupportedFormatCharacter,
)

_Function = ast.FunctionDef | ast.AsyncFunctionDef


def check_text(code: str) -> list[UserFault]:
    """All that is wrong with the text, by line, at most twenty; empty if it may run."""
    if not 1 <= len(code) <= MAX_CHARACTERS:
        return [UserFault("reward_length", length=len(code), limit=MAX_CHARACTERS)]
    try:
        compile_reward(code)
        tree = ast.parse(without_mark(code), FILENAME)
        found = [*_imports(tree), *_forbidden(tree), *_definitions(tree), *_mistakes(tree)]
    except UserFault as fault:
        return [fault]
    except (RecursionError, MemoryError):
        return [UserFault("reward_syntax", line=1, detail="it is nested too deeply")]
    return sorted(found, key=lambda fault: fault.params.get("line", 0))[:_MOST]


def _imports(tree: ast.Module) -> Iterator[UserFault]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = ["." * node.level + (node.module or "")]
        else:
            continue
        for name in names:
            if not is_allowed(name):
                yield UserFault("reward_import_not_allowed", line=node.lineno, name=printable(name))


def _forbidden(tree: ast.Module) -> Iterator[UserFault]:
    modules = _modules_by_name(tree)
    for node in ast.walk(tree):
        for name in (*_names(node, modules), *_leaks(node, modules)):
            line = getattr(node, "lineno", 1)  # whatever has a name has a line
            yield UserFault("reward_forbidden_name", line=line, name=printable(name))


def _names(node: ast.AST, modules: Collection[str]) -> Iterator[str]:
    if isinstance(node, ast.Name) and node.id in _FORBIDDEN_NAMES:
        yield node.id
    elif isinstance(node, ast.Attribute):
        owner = node.value
        while isinstance(owner, ast.Attribute):
            owner = owner.value
        of_a_module = isinstance(owner, ast.Name) and owner.id in modules
        if node.attr in (_FORBIDDEN_IN_MODULES if of_a_module else _FORBIDDEN_ANYWHERE):
            yield node.attr
    elif isinstance(node, ast.ImportFrom):
        yield from (alias.name for alias in node.names if alias.name in _FORBIDDEN_IN_MODULES)
    elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "getattr":
        texts = [part.value for part in node.args if isinstance(part, ast.Constant)]
        yield from (text for text in texts if isinstance(text, str) and text in _FORBIDDEN_IN_MODULES)


def _modules_by_name(tree: ast.Module) -> dict[str, str]:
    found = {}
    for node in ast.walk(tree):
        for alias in node.names if isinstance(node, ast.Import) else ():
            top = alias.name.split(".")[0]
            found[alias.asname or top] = alias.name if alias.asname else top
    return found


def _leaks(node: ast.AST, modules: dict[str, str]) -> Iterator[str]:
    """Modules that may not be imported and that this node takes out of one that may, such as ``logging.os``."""
    if isinstance(node, ast.ImportFrom) and node.module is not None and not node.level:
        for alias in node.names:
            if (leak := leak_in([node.module, alias.name])) != "":
                yield leak
    if not isinstance(node, ast.Attribute):
        return
    names: list[str] = []
    way: ast.expr = node
    while isinstance(way, ast.Attribute):
        names.append(way.attr)
        way = way.value
    if isinstance(way, ast.Name) and way.id in modules and (leak := leak_in([modules[way.id], *reversed(names)])) != "":
        yield leak


def _definitions(tree: ast.Module) -> Iterator[UserFault]:
    functions = [node for node in tree.body if isinstance(node, _Function) and node.name == NAME]
    if _is_assigned(tree):  # what it then is shows when it is loaded
        return
    if not functions:
        yield UserFault("reward_function_missing")
        return
    for second in functions[1:]:
        yield UserFault("reward_function_twice", line=second.lineno)
    function = functions[0]
    if isinstance(function, ast.AsyncFunctionDef) or _yields(function):
        yield UserFault("reward_function_kind", line=function.lineno)
    arguments = function.args
    try:
        names = [argument.arg for argument in (*arguments.posonlyargs, *arguments.args)]
        by_name = sum(default is None for default in arguments.kw_defaults)
        form_of(names, len(names) - len(arguments.defaults), by_name, function.lineno)
    except UserFault as fault:
        yield fault


def _is_assigned(tree: ast.Module) -> bool:
    targets: list[ast.expr] = []
    for node in tree.body:
        if isinstance(node, ast.Assign):
            targets += node.targets
        elif isinstance(node, ast.AnnAssign) and node.value is not None:
            targets.append(node.target)
    return any(isinstance(target, ast.Name) and target.id == NAME for target in targets)


def _yields(function: _Function) -> bool:
    """Whether it is a generator: a yield of its own, not of a function inside."""
    waiting: list[ast.AST] = list(function.body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.Yield | ast.YieldFrom):
            return True
        if not isinstance(node, _Function | ast.Lambda | ast.ClassDef):
            waiting += ast.iter_child_nodes(node)
    return False


def _mistakes(tree: ast.Module) -> Iterator[UserFault]:
    make: Callable[..., checker.Checker] = checker.Checker
    for message in make(tree, filename=FILENAME).messages:
        if isinstance(message, messages.UndefinedName):
            yield UserFault("reward_undefined_name", line=message.lineno, name=printable(str(message.message_args[0])))
        elif isinstance(message, _MISTAKES):
            detail = printable(message.message % message.message_args)
            yield UserFault("reward_mistake", line=message.lineno, detail=detail)
