"""Torch without its compiler. Import this before anything that imports torch's optimisers.

The first optimiser of a process imports ``torch._dynamo``, only to mark functions that the compiler must leave alone:
1.2 of the 2.7 CPU seconds that a training needs to start, and an import that a locked process cannot do. Nothing is
compiled here, so with the version of torch that this was checked with the marks are no-ops.
"""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any

import torch

_CHECKED = "2.13."


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
