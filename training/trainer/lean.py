"""Torch without its compiler. Import this before anything that imports torch.

Of the CPU seconds that a training needs to start, importing torch takes most, and two parts of it are the compiler's
alone:

- The first optimiser of a process imports ``torch._dynamo``, only to mark functions that the compiler must leave alone:
  1.2 s, and an import that a locked process cannot do. Nothing is compiled here, so the marks are no-ops.
- ``torch._meta_registrations`` tells what shapes operations would give that are not carried out, for tensors that hold
  no numbers: 0.3 of the 1.3 s that are left. There are no such tensors here.

Both hold for the version of torch that this was checked with, and are left alone in another.
"""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

_CHECKED = "2.13."
_UNUSED = "torch._meta_registrations"


def version_of_torch() -> str:
    """What is installed, read off its files: to ask torch is to import it. "" where there is none."""
    spec = importlib.util.find_spec("torch")
    if spec is None or spec.origin is None:
        return ""
    text = Path(spec.origin).with_name("version.py").read_text(encoding="utf-8")
    found = re.search(r"__version__ = '([^']+)'", text)
    return found[1] if found else ""


def leave_meta_out() -> bool:
    """Stand in for ``torch._meta_registrations`` unless torch is loaded already or is another version. Whether it
    did."""
    if "torch" in sys.modules or not version_of_torch().startswith(_CHECKED):
        return False
    sys.modules[_UNUSED] = ModuleType(_UNUSED)
    return True


leave_meta_out()

import torch  # noqa: E402  now without it


def leave_compiler_out() -> bool:
    """Stand in for ``torch._dynamo`` unless it is loaded already or torch is another version. Whether it did."""
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
