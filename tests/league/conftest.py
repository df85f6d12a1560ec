"""The league's tests send no wake-ups; the folder of a small record."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import timedelta
from pathlib import Path

import pytest

from league.models import Season, Webhook
from league.webhooks.services import add_webhook
from tests.league.histories import write_season
from tests.league.records import FEW
from tests.league.seasons import a_season
from tests.listening import Listener, listening


@pytest.fixture(autouse=True)
def _no_broker(wakes: list[dict]) -> None:
    """Submissions send wake-ups; no test here needs a worker to take them."""


@pytest.fixture
def season(db: None) -> Season:
    return a_season()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_season(tmp_path / "record", FEW)


@pytest.fixture
def listener() -> Iterator[Listener]:
    with listening() as made:
        yield made


@pytest.fixture
def hook(db, now, alice, listener, settings) -> Webhook:
    """Alice's webhook for all that may be told her, on a site that allows private addresses."""
    settings.WEBHOOKS_PRIVATE = True
    made = add_webhook(owner=alice, url=listener.url)
    Webhook.objects.filter(pk=made.pk).update(created_at=now - timedelta(days=30))
    return Webhook.objects.get()
