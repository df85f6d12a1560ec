"""Topics with messages of their own, and what a hub in this process tells its readers."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from datetime import date

import pytest
from django.db import OperationalError

from accounts.class_accounts.services import add_learners, add_teacher, make_class
from accounts.groups.services import ask_to_join
from config.serving.streams.hub import BEAT_S, Hub
from config.serving.streams.reader import HELD_BYTES, Reader, message
from core.events import KINDS, Event
from core.streams import TOPICS, Backstage, Topic, life, register_topic, topics_of
from core.streams.topics import asked_for
from courses.events import ASSIGNMENT_PUBLISHED
from league.events import SEASON_DRAFTED
from league.seasons.services.seasons import create_season
from races.events import RESULT_DIFFERS
from tests.courses.assignments import a_group, an_assignment
from tests.factories import a_race, a_racer
from tests.league.seasons import a_season

pytestmark = pytest.mark.django_db(transaction=True)


@pytest.fixture
def poses():
    """A topic of a run that is shown: its source counts how often it began and ended."""
    log: list[str] = []

    async def source(key: str, stage: Backstage) -> AsyncIterator[dict]:
        log.append(f"{key} begins")
        try:
            for number in range(1_000):
                yield {"pose": number}
                await asyncio.sleep(0.01)
        finally:
            log.append(f"{key} ends")

    register_topic(Topic("shown", lambda viewer, key: key == "open", lambda key: {"late": True}, source))
    yield log
    del TOPICS["shown"]


def a_reader(*topics: str) -> Reader:
    return Reader(frozenset(topics), "", "127.0.0.1", lambda: None)


def test_a_source_runs_once_while_somebody_follows_it(poses):
    async def look() -> tuple[bytes, bytes, bytes]:
        hub = Hub()
        first, second, refused = a_reader("shown:open"), a_reader("shown:open"), a_reader("shown:secret")
        for reader in (first, second, refused):
            await hub.come(reader, None)
        await asyncio.sleep(0.2)
        seen = [await reader.next() for reader in (first, second, refused)]
        hub.leave(first)
        await asyncio.sleep(0.05)
        assert poses == ["open begins"], "the second still follows it"
        hub.leave(second)
        await asyncio.sleep(0.05)
        await hub.close()
        return tuple(seen)

    first, second, refused = asyncio.run(look())
    assert poses == ["open begins", "open ends"]
    for seen in (first, second):
        assert b'event: said\ndata: {"to":"shown:open","data":{"late":true}}' in seen
        assert b'{"to":"shown:open","data":{"pose":3}}' in seen
    assert b"shown" not in refused


def test_a_welcome_is_made_once_for_a_crowd_and_one_that_fails_costs_nobody_the_stream(poses):
    made: list[str] = []

    def welcome(key: str) -> dict:
        made.append(key)
        return {"many": 1} if key == "open" else {}[key]

    register_topic(Topic("shown", lambda viewer, key: True, welcome, None))

    async def look() -> list[bytes]:
        hub = Hub()
        readers = [a_reader("shown:open", "shown:broken") for _ in range(20)]
        await asyncio.gather(*(hub.come(reader, None) for reader in readers))
        seen = [await reader.next() for reader in readers]
        await hub.close()
        return seen

    seen = asyncio.run(look())
    assert made.count("open") == 1
    assert all(b'{"to":"shown:open","data":{"many":1}}' in each and b"event: hello" in each for each in seen)


def test_its_sign_of_life_comes_again_after_the_database_was_away(monkeypatch):
    async def look() -> None:
        hub, again = Hub(), asyncio.Event()
        faults = [OperationalError("terminating connection due to administrator command")]
        loop = asyncio.get_running_loop()

        def report(figures: dict) -> None:
            if faults:
                raise faults.pop()
            loop.call_soon_threadsafe(again.set)

        monkeypatch.setattr(life, "report", report)
        monkeypatch.setattr(life, "REPORTED_EVERY_S", 0.01)
        hub.start()
        try:
            await asyncio.wait_for(again.wait(), 20)
        finally:
            await hub.close()

    asyncio.run(look())


def test_what_is_said_while_a_reader_is_welcomed_comes_after_it():
    reader = a_reader("races")
    reader.tell(b"new;")
    reader.tell_past([b"welcome;"])
    assert asyncio.run(reader.next()) == b"welcome;new;"


def test_a_stream_that_rests_is_sent_little():
    sent = len(message({"spread": 3000}, event="beat", position=10**12))
    assert sent * 60 / BEAT_S < 2_000 / 5, "with what TCP adds"


def test_a_reader_who_lets_much_wait_is_cut():
    cut: list[bool] = []
    reader = Reader(frozenset(("races",)), "", "", lambda: cut.append(True))
    reader.tell_past([])
    while not reader.is_over:
        reader.tell(b"x" * 1_000)
    assert cut == [True] and HELD_BYTES == 65_536
    assert asyncio.run(reader.next()) == b""


def test_what_is_new_waits_until_the_past_is_told():
    reader = a_reader("races")
    reader.tell_moves([7], ["races"], 7)
    reader.tell_past([b"past;"])
    assert asyncio.run(reader.next()) == b'past;id: 7\ndata: {"of":["races"],"at":[7]}\n\n'


def test_only_what_is_a_topic_may_be_asked_for():
    ann = a_racer("ann")
    assert asked_for(["me", "race:7"], ann) == {f"racer:{ann.pk}", "race:7"}
    assert asked_for(["me"], None) == set()
    for nonsense in ("", "race:", "Race:7", "race:7\n", "race:a b", "race:" + "x" * 65):
        with pytest.raises(ValueError, match="is not a topic"):
            asked_for([nonsense], None)


def test_every_kind_of_event_moves_something(now):
    """A kind that moves nothing would leave a page standing still. No open page shows an alarm of admins."""
    race, ann, season = a_race(now), a_racer("ann"), a_season()
    assignment = an_assignment(a_group(ann, 1, now)[0], now)
    for kind in KINDS.values():
        names = {"racer": ann.pk if "racer" in kind.names else None, "race": race.pk if "race" in kind.names else None}
        subject = assignment.public_id if kind.name.startswith("assignment.") else season.slug
        event = Event(pk=1, kind=kind.name, at=now, racer_id=names["racer"], race=names["race"], subject=subject)
        assert bool(topics_of([event])[1]) == (kind is not RESULT_DIFFERS), kind.name


def test_an_event_of_an_assignment_moves_teachers_and_students(now):
    ann, second, other = a_racer("ann"), a_racer("second"), a_racer("other")
    classroom = make_class(teacher=ann, name="6a", plan=[], now=now)
    add_teacher(classroom=classroom, by=ann, alias="second", now=now)
    (card,) = add_learners(classroom=classroom, by=ann, names=["Kim Minji"], now=now)
    ask_to_join(code=classroom.group.code, racer=other, now=now)  # not confirmed yet
    subject = an_assignment(classroom.group, now).public_id
    event = Event(pk=1, kind=ASSIGNMENT_PUBLISHED.name, at=now, subject=subject)
    gone = Event(pk=2, kind=ASSIGNMENT_PUBLISHED.name, at=now, subject="of-nothing")
    people = {ann.pk, second.pk, card.learner.racer_id}
    assert topics_of([event, gone]) == {1: {f"racer:{pk}" for pk in people}, 2: set()}


def test_an_event_of_a_kind_that_is_gone_moves_nothing(now):
    """The table may hold kinds that the code no longer has; all other events are read on."""
    assert topics_of([Event(pk=1, kind="of.before", at=now, subject="x")]) == {1: set()}


def test_a_draft_moves_itself_and_the_season_that_it_continues(now):
    season = a_season()
    draft = create_season(
        slug="2028", name="2028", starts_on=date(2028, 1, 1), ends_on=date(2028, 12, 31), follows=season
    )
    drafted = Event(pk=1, kind=SEASON_DRAFTED.name, at=now, subject=draft.slug)
    deleted = Event(pk=2, kind=SEASON_DRAFTED.name, at=now, subject="gone")
    assert topics_of([drafted, deleted]) == {1: {f"season:{season.pk}", f"season:{draft.pk}"}, 2: set()}
