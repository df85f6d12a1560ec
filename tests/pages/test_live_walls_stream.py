"""No byte of the future on the stream: while a sealed run is played, everybody follows every topic that there is."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Collection
from datetime import timedelta

import pytest
from django.utils import timezone

from config.serving.streams.hub import Hub
from config.serving.streams.reader import Reader
from core.streams import TOPICS
from core.streams.topics import asked_for
from evaluation.models import Evaluation
from races.live.services import set_message
from tests.pages.test_live_walls import PLAYED_S, VIEWERS, Show, show  # noqa: F401  (the fixture)
from tests.streams.process import session_of

pytestmark = [pytest.mark.django_db(transaction=True), pytest.mark.slow]
HEARD_S, LONGEST_S = 0.6, 30.0  # what must not come is waited for so long, what must come at most so long
HELLO = b'"message":"Hello"'


@pytest.fixture(autouse=True)
def looks_at_once(monkeypatch) -> None:
    monkeypatch.setattr("races.live.streaming.event_stream.LEAST_S", 0.0)  # the clock of the show stands still


def topics_around(shown: Show) -> set[str]:
    """Every topic with every key that has to do with the event or its runs."""
    runs = [Evaluation.with_sealed.get(pk=slot.evaluation_id) for slot in (shown.playing, shown.coming)]
    keys = {"", str(shown.event.race_id), str(shown.event.pk), shown.event.race.slug}
    keys |= {str(run.pk) for run in runs} | {run.public_id for run in runs} | {str(shown.playing.pk)}
    return {f"{name}:{key}" if key else name for name in TOPICS for key in keys} | {"me"}


def heard(shown: Show, told_to: Collection[str] = VIEWERS) -> dict[str, bytes]:
    """What each viewer is told who comes now, while the organiser says something that ``told_to`` hear."""
    sessions = {name: session_of(racer) for name, racer in shown.viewers.items()}
    readers = {
        name: Reader(frozenset(asked_for(topics_around(shown), shown.viewers[name])), session, "", lambda: None)
        for name, session in sessions.items()
    }

    async def told(reader: Reader, content: bytearray) -> None:
        while HELLO not in content and not reader.is_over:
            content += await reader.next()

    async def listen() -> dict[str, bytes]:
        hub, contents = Hub(), {name: bytearray() for name in readers}
        hub.start()
        for reader in readers.values():
            await hub.come(reader, None)
        loop = asyncio.get_running_loop()
        await loop.run_in_executor(None, said, shown)
        async with asyncio.timeout(LONGEST_S):
            await asyncio.gather(*(told(readers[name], contents[name]) for name in told_to))
        await asyncio.sleep(HEARD_S)
        await hub.close()
        for name, reader in readers.items():
            contents[name] += await reader.next()
        return {name: bytes(content) for name, content in contents.items()}

    return asyncio.run(listen())


def said(shown: Show) -> None:
    from django.db import connection

    set_message(event=shown.event, message="Hello", by=shown.world.alice, seen=None, now=timezone.now())
    connection.close()


def test_nothing_of_what_is_to_come_is_on_the_stream(show: Show):  # noqa: F811
    needles, told = show.needles(), heard(show)
    assert set(told) == set(VIEWERS)
    for name, content in told.items():
        assert b'"poses":{"slot":%d' % show.playing.pk in content, f"{name} is played to"
        assert HELLO in content, f"{name} is told what changed"
        assert b'"x":[' in content
        assert not [what for what, needle in needles.items() if needle.search(content)], name
        strips = re.findall(rb'"sees:\d+","data":{"slot":(\d+),"n":(\d+)', content)
        assert all(int(of) == show.playing.pk and int(n) < 2 * PLAYED_S for of, n in strips), f"{name}: frames"


def test_what_is_sought_is_found_on_the_stream_once_it_was_played(show: Show, monkeypatch):  # noqa: F811
    needles, later = show.needles(), timezone.now() + timedelta(seconds=15)
    monkeypatch.setattr(timezone, "now", lambda: later)
    content = heard(show)["guest"]
    found = {what for what, needle in needles.items() if needle.search(content)}
    assert {"pose at 20 s", "13457 ms"} <= found and "12861 ms" not in found


def test_a_private_show_is_played_to_those_who_may_see_it(show: Show):  # noqa: F811
    type(show.event.race).objects.filter(pk=show.event.race_id).update(visibility="invitation")
    insiders = {"member", "racer", "organiser", "staff"}
    told = heard(show, insiders)
    assert {name for name, content in told.items() if b"poses" in content or b"state" in content} == insiders
