"""What every test may use."""

from __future__ import annotations

import os
import tempfile

# Tests never touch the checkout's data folder.
os.environ["PADDOCK_DATA"] = tempfile.mkdtemp(prefix="paddock-tests-")
os.environ.setdefault("OMP_NUM_THREADS", "1")
