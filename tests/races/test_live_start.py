"""A live event's start and seed: announced with it, told to its runs, and to no other."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.urls import reverse
from django.utils import timezone

from evaluation.models import Evaluation
from evaluation.running.queue.services import queue_evaluation
from paddock.rules.race import RaceRules
from races.boards.selectors.board import board
from races.entries.services.submissions import submit_model
from races.live.document import live_document
from races.live.services import change_live, plan_live, prepare_ahead
from races.models import LiveEvent, RaceType
from races.rules.layout import laid_out, race_rules
from races.rules.live_start import MOST_SEED, live_layout
from tests.clients import logged_in
from tests.factories import a_model, a_racer, drive, laps
from tests.live_shows import START, a_live_race, a_show, begun, compute, show, slot_of
from tests.refusals import refused

pytestmark = pytest.mark.django_db


@pytest.fixture
def alice():
    return a_racer("alice")


@pytest.fixture
def client_now():
    """The clock of a browser."""
    return timezone.now()


def rules_of(run_pk):
    return RaceRules.from_dict(Evaluation.with_sealed.get(pk=run_pk).spec["rules"])


def test_a_start_and_a_seed_are_drawn_and_announced(alice, now):
    events = [a_show(now, alice, []) for _ in range(3)]
    assert len({(event.start_m, event.seed) for event in events}) == 3
    for event in events:
        assert 0 < event.start_m < event.race.track.length_m
        told = live_document(event, now)
        assert (told["start_m"], told["seed"]) == (event.start_m, event.seed)
        page = logged_in(None).get(reverse("live_event", args=[event.race.slug])).content.decode()
        assert f"{event.start_m:.1f} m after the finish line · seed {event.seed}" in page
        api = logged_in(None).get(f"/api/v1/races/{event.race.slug}/live/").json()
        assert (api["start_m"], api["seed"]) == (event.start_m, event.seed)


def test_every_run_of_the_event_is_told_them(alice, now):
    event = begun(a_show(now, alice, ["bob", "carl"], start_m=3.5, seed=77), alice, now)
    for name in ("bob", "carl"):
        rules = rules_of(slot_of(event, name).evaluation_id)
        assert (rules.start_m, rules.seed) == (3.5, 77)


def test_other_runs_of_the_race_are_as_they_were(alice, now):
    race = a_live_race(now, alice)
    before = race_rules(race).to_dict()
    a_show(now, alice, [], race=race, start_m=3.5, seed=77)
    sent = submit_model(race=race, racer=(bob := a_racer("bob")), model=a_model(bob), now=now)
    assert sent.evaluation.spec["rules"] == before
    assert "start_m" not in before


def test_an_event_from_before_has_the_race_s_own(alice, now):
    event = a_show(now, alice, ["bob"])
    LiveEvent.objects.filter(pk=event.pk).update(start_m=None, seed=None)
    event.refresh_from_db()
    begun(event, alice, now)
    rules = rules_of(slot_of(event, "bob").evaluation_id)
    assert (rules.start_m, rules.seed) == (0.0, event.race.seed)


@pytest.mark.parametrize(
    ("plan", "code"),
    [
        ({"start_m": -0.1}, "live_start"),
        ({"start_m": 1e6}, "live_start"),
        ({"start_m": float("nan")}, "live_start"),
        ({"seed": -1}, "live_format"),
        ({"seed": MOST_SEED + 1}, "live_format"),
    ],
)
def test_what_makes_no_sense_is_refused(alice, now, plan, code):
    race = a_live_race(now, alice)
    refused(code, plan_live, race=race, by=alice, now=now, starts_at=now + START, **plan)


def test_a_changed_plan_keeps_start_and_seed_unless_it_names_them(alice, now):
    event = a_show(now, alice, [], start_m=3.5, seed=77)
    change_live(event=event, by=alice, seen=None, now=now, rounds=2)
    assert (event.start_m, event.seed) == (3.5, 77)
    change_live(event=event, by=alice, seen=None, now=now, start_m=4.5)
    assert (event.start_m, event.seed) == (4.5, 77)
    change_live(event=event, by=alice, seen=None, now=now, seed=None)
    assert event.start_m == 4.5
    assert event.seed != 77


def test_drawn_boxes_stand_elsewhere_live_and_the_map_shows_them(alice, now):
    race = a_live_race(now, alice, race_type=RaceType.OBJECT_AVOIDANCE, random_boxes=3)
    event = a_show(now, alice, ["bob"], race=race)
    assert [box.fraction for box in live_layout(event).boxes] != [box.fraction for box in laid_out(race).boxes]
    rules = rules_of(slot_of(begun(event, alice, now), "bob").evaluation_id)
    run = queue_evaluation(owner=alice, model=a_model(alice), track=race.track, rules=rules, now=now)
    assert run.spec["rules"]["seed"] == event.seed


def test_sectors_of_another_start_are_not_compared(alice, now):
    race = a_live_race(now, alice)
    drive(race, a_racer("dora"), laps(9_000), now)
    before = race.fastest_sectors_ms
    event = begun(a_show(now, alice, ["bob"], race=race, start_m=3.5), alice, now)
    prepare_ahead(event=event, now=now)
    compute(slot_of(event, "bob"), now, 8_000)
    show(event, slot_of(event, "bob"), alice, now)
    race.refresh_from_db()
    before = [3_000] * 3 if before == (None, None, None) else list(before)
    assert list(race.fastest_sectors_ms) == before
    assert race.fastest_lap_ms == 8_000
    first = board(race).rows[0]
    assert (first.alias, first.sector_colours) == ("bob", (None, None, None))


def test_an_organiser_names_them_in_the_form_or_leaves_them_open(alice, client_now):
    race = a_live_race(client_now, alice)
    sent = {
        "starts_at": f"{client_now + timedelta(days=2):%Y-%m-%d}T20:15",
        "time_zone": "UTC",
        "rounds": "1",
        "attempt_ms": "60",
        "order": "as_entered",
        "gap_s": "5",
    }
    client, address = logged_in(alice), reverse("live_plan", args=[race.slug])
    refused_ = client.post(address, sent | {"start_m": "999999"})
    assert (refused_.status_code, "The start must be on the lap" in refused_.content.decode()) == (422, True)
    assert client.post(address, sent | {"seed": "5"}).status_code == 302
    event = LiveEvent.objects.get(race=race)
    assert event.start_m > 0
    assert event.seed == 5
    client.post(address, sent | {"start_m": "2.5", "seed": "5"})
    event.refresh_from_db()
    assert (event.start_m, event.seed) == (2.5, 5)
