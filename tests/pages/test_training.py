"""Pages of the training room: who sees what, what the wizard refuses and takes, what a training shows."""

from __future__ import annotations

import pytest

from tests.pages.conftest import World


def test_smoke(world: World) -> None:
    client = world.client("alice")
    for path in ("/train/", "/train/new/", "/vehicles/", "/vehicles/new/", "/learn/", "/learn/agent/", "/learn/laboratory/"):
        assert client.get(path).status_code == 200, path
