"""No broker is called, and what waits for a commit is done at once."""

from tests.races.conftest import _no_broker, commits

__all__ = ["_no_broker", "commits"]
