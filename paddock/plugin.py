"""Registers the environments with Gymnasium without an import of this package."""

# So ``gymnasium.make("Paddock/TimeTrial-v1")`` works. Gymnasium before 1.0 read the entry point group
# ``gymnasium.envs``; later versions do not. So the wheel installs ``paddock_racing.pth``, which calls :func:`watch`
# when Python starts. Once Gymnasium is imported, the environments are registered by their names, and nothing else is
# loaded before one is created. This module runs at every start of Python, so it imports next to nothing: it takes half
# a millisecond.

from __future__ import annotations

import sys

TYPE_CHECKING = False  # that of typing, which takes six milliseconds to import
if TYPE_CHECKING:
    from typing import Any

WATCHED = "gymnasium.envs"  # where Gymnasium registers its own
_NAMES = ("TimeTrial", "ObjectAvoidance", "HeadToHead")


def register_envs() -> None:
    """Register the environments, here and in processes that this one starts with :mod:`multiprocessing`; those that are
    known already stay as they are."""
    from multiprocessing.process import current_process

    from gymnasium.envs.registration import register, registry

    # multiprocessing passes this on to every child; without it a spawned child knows no environment
    getattr(current_process(), "_config", {})["paddock"] = _InChildren()

    for name in _NAMES:
        if f"Paddock/{name}-v1" not in registry:
            register(
                id=f"Paddock/{name}-v1",
                entry_point=f"paddock.simulator.envs:{name}Env",
                vector_entry_point=f"paddock.simulator.vector:{name}VectorEnv",
            )


class _InChildren:
    """Calls :func:`watch` where it is unpickled."""

    def __reduce__(self) -> tuple[Any, tuple[()]]:
        return _in_child, ()


def _in_child() -> _InChildren:
    watch()
    return _InChildren()


def watch() -> None:
    """Register them when Gymnasium is imported; at once, where it has been."""
    if WATCHED in sys.modules:
        register_envs()
    elif not any(isinstance(finder, _Watcher) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Watcher())


class _Watcher:
    """Finds nothing itself: it asks the others for Gymnasium, once, and adds what comes after."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> Any:
        """See :class:`importlib.abc.MetaPathFinder`."""
        if name != WATCHED:
            return None
        sys.meta_path.remove(self)
        found = (finder.find_spec(name, path, target) for finder in list(sys.meta_path))
        spec = next((spec for spec in found if spec is not None), None)
        if spec is not None and spec.loader is not None:
            execute = spec.loader.exec_module

            def and_ours(module: Any) -> None:
                execute(module)
                register_envs()

            spec.loader.exec_module = and_ours  # type: ignore[method-assign]
        return spec
