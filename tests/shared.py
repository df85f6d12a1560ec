"""Where the shared real-world material lies, and how a test says that it needs it."""

from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parent.parent
SHARED = CHECKOUT.parent / "shared"
CONSOLE_CAR = SHARED / "models" / "deepracer-console-15.tar.gz"

needs_shared = pytest.mark.skipif(not SHARED.is_dir(), reason="the shared material is not beside this checkout")
