"""A live event in words: its log, and what its commentator is told."""

from __future__ import annotations

import re
from datetime import timedelta
from pathlib import Path

import pytest
from django.utils.translation import override

from evaluation.models import Evaluation
from evaluation.running.queue.jobs import finish_evaluation
from races.live import services as live
from races.live.commentary import ordinal, story_of
from races.live.services import launch
from races.templatetags.live import ACTS, act
from tests.factories import a_racer, lap, outcome, start
from tests.live_shows import a_show, begun, compute, show, slot_of

WRITTEN = re.compile(r'acting\(\s*event, "(\w+)"|action="(\w+)"|_to\(event, slot, [\w.]+, "(\w+)"')


def test_everything_that_is_done_has_words():
    sources = "".join(file.read_text() for file in Path(live.__file__).parent.glob("*.py"))
    done = {next(filter(None, found)) for found in WRITTEN.findall(sources)}
    assert {"plan", "launch", "undo", "release"} <= done
    assert done == ACTS.keys()


def test_what_has_no_words_is_said_as_it_is():
    assert (act("launch"), act("something")) == ("launched", "something")


@pytest.mark.django_db
@pytest.mark.parametrize(
    ("driven", "said"),
    [
        ((8_700,), ["carl needs 3.200 s in the last sector for the fastest lap."]),
        ((15_000,), ["No fastest lap for carl."]),
        ((11_100,), []),
        (
            (9_600, 9_300),
            [
                "carl needs 2.600 s in the last sector for the fastest lap.",
                "carl needs 2.800 s in the last sector for the fastest lap: 0.400 s quicker than ever there.",
            ],
        ),
    ],
)
def test_a_commentator_is_told_what_is_needed_in_the_last_sector(now, wakes, driven, said):
    alice = a_racer("alice")
    event = begun(a_show(now, alice, ["bob", "carl"], order="as_entered"), alice, now)
    compute(slot_of(event, "bob"), now, 9_000)
    at = show(event, slot_of(event, "bob"), alice, now)
    times, begins = [], 0
    for number, time_ms in enumerate(driven, 1):
        times.append({**lap(number, time_ms), "start_ms": begins})
        begins += time_ms
    run = start(Evaluation.with_sealed.get(pk=slot_of(event, "carl").evaluation_id), at)
    assert finish_evaluation(pk=run.pk, lease=run.lease, outcome=outcome(times), now=at)
    launch(event=event, slot=slot_of(event, "carl"), by=alice, seen=None, now=at)
    slot = slot_of(event, "carl")
    needs = [each for each in story_of(event, slot.ends_at + timedelta(seconds=2)) if each.kind == "needs"]
    assert [each.text for each in reversed(needs)] == said
    if not needs:
        return
    begins_at = needs[-1].at
    assert not [each for each in story_of(event, begins_at - timedelta(milliseconds=600)) if each.kind == "needs"]


@pytest.mark.django_db
def test_a_sentence_comes_when_spectators_see_it_and_is_the_same_ever_after(now, wakes):
    """What the page follows has keys, so nothing in it may be of the moment at which it is asked for."""
    alice = a_racer("alice")
    event = begun(a_show(now, alice, ["bob"]), alice, now)
    compute(slot_of(event, "bob"), now, 9_000)
    launch(event=event, slot=slot_of(event, "bob"), by=alice, seen=None, now=now)
    slot = slot_of(event, "bob")
    soon = [story_of(event, now + timedelta(seconds=after)) for after in (1, 9.5, 11.4)]
    assert soon[0] == soon[1] == soon[2] and [each.text for each in soon[0]] == ["bob is about to start."]
    lap = slot.starts_at + timedelta(seconds=9 + 1.5)
    assert "bob sets the first time: 9.000 s." not in [
        each.text for each in story_of(event, lap - timedelta(seconds=0.001))
    ]
    told = story_of(event, lap)
    assert told[0].text == "bob sets the first time: 9.000 s."
    assert len({each.key for each in told}) == len(told)


@pytest.mark.parametrize(
    ("place", "said"),
    [(1, "1st"), (2, "2nd"), (3, "3rd"), (4, "4th"), (11, "11th"), (12, "12th"), (23, "23rd"), (113, "113th")],
)
def test_places_are_ordinals_in_each_language(place, said):
    assert ordinal(place) == said
    with override("ko"):
        assert ordinal(place) == f"{place}위"
