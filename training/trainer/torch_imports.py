"""Imports torch without its compiler; import this before anything that imports torch.

The first optimiser of a process imports ``torch._dynamo`` (1.2 s, and impossible in a locked process) to mark functions
for the compiler; nothing is compiled here. ``torch._meta_registrations`` (0.3 s) computes the shapes of operations on
tensors without data; there are none here. Both are replaced in the checked version of torch only.
"""

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

_CHECKED = "2.13."
_UNUSED = "torch._meta_registrations"


def version_of_torch() -> str:
    """The installed version of torch by its files, without its import; empty without torch."""
    spec = importlib.util.find_spec("torch")
    if spec is None or spec.origin is None:
        return ""
    text = Path(spec.origin).with_name("version.py").read_text(encoding="utf-8")
    found = re.search(r"__version__ = '([^']+)'", text)
    return found[1] if found else ""


def leave_meta_out() -> bool:
    """Replace ``torch._meta_registrations`` unless torch is loaded or another version; whether it did."""
    if "torch" in sys.modules or not version_of_torch().startswith(_CHECKED):
        return False
    sys.modules[_UNUSED] = ModuleType(_UNUSED)
    return True


leave_meta_out()

import torch  # noqa: E402  now without it


def leave_compiler_out() -> bool:
    """Replace ``torch._dynamo`` unless it is loaded or torch is another version; whether it did."""
    if not torch.__version__.startswith(_CHECKED) or "torch._dynamo" in sys.modules:
        return False
    absent: Any = ModuleType("torch._dynamo")
    absent.disable = lambda fn=None, *_, **__: fn if fn is not None else lambda marked: marked
    absent.graph_break = lambda *_, **__: None
    absent.is_compiling = lambda: False
    sys.modules["torch._dynamo"] = torch._dynamo = absent
    return True


leave_compiler_out()
torch.set_num_threads(1)  # more of them spin against every other process of the machine
