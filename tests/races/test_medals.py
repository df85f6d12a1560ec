"""Medals stand where a best lap is shown, and only there."""

from __future__ import annotations

import json
from collections.abc import Callable
from datetime import timedelta

import pytest
from django.db import connection
from django.test import Client
from django.test.utils import CaptureQueriesContext
from django.utils import timezone

from accounts.models import Racer
from races.boards.medals import medal_in, medal_of_run, medal_target, race_reference_ms
from races.models import Entry, Race
from tests.drawn_runs import a_driven_run
from tests.factories import a_race, a_racer, drive, laps
from tests.kept import Kept
from tests.reference_laps import a_reference
from tracks.models import ReferenceLap
from tracks.reference.medals import Medal

pytestmark = pytest.mark.django_db
REFERENCE_MS = 10_000


@pytest.fixture(scope="session")
def kept_medals(request: pytest.FixtureRequest, keep: Callable, now) -> Kept:
    return keep(request, lambda: _race(now))


@pytest.fixture
def race(kept_medals: Kept, db: None) -> Race:
    return kept_medals.copy()


def _race(now) -> Race:
    """Alice has silver, carl none, the house car steady is slower than bronze."""
    race = a_race(now)
    for alias, time in (("alice", 11_000), ("carl", 14_000), ("steady", 13_560)):
        drive(race, a_racer(alias), laps(time, time, time), now)
    Entry.objects.filter(racer__alias="steady").update(is_baseline=True)
    a_reference(race.track, REFERENCE_MS, now)
    return Race.objects.get(pk=race.pk)


def page(address: str, alias: str | None = None) -> str:
    client = Client()
    if alias is not None:
        client.force_login(Racer.objects.get(alias=alias), backend="django.contrib.auth.backends.ModelBackend")
    response = client.get(address)
    assert response.status_code == 200
    return response.content.decode()


def test_a_best_lap_has_the_medal_of_its_race(race):
    assert medal_in(race, 11_000) == Medal.SILVER and medal_in(race, 14_000) is None and medal_in(race, None) is None


@pytest.mark.parametrize(
    "change",
    [
        {"physical": True},
        {"race_type": "object_avoidance"},
        {"off_track_penalty_ms": 0},
        {"direction": "cw"},
        {"engine": "an older one"},
    ],
)
def test_races_whose_laps_do_not_compare_give_no_medal(race, change):
    for name, value in change.items():
        setattr(race, name, value)
    assert race_reference_ms(race) is None and medal_in(race, 9_000) is None and medal_target(race, None) is None


def test_a_profile_shows_medals_beside_best_laps(race):
    assert "medal silver" in page("/racers/alice/") and 'class="medal ' not in page("/racers/carl/")


def test_a_profile_with_medals_needs_no_query_a_race(race, now):
    alice = Racer.objects.get(alias="alice")
    counts = []
    for name in ("second", "third", "fourth"):
        other = a_race(now, name=name, slug=name, track=race.track)
        drive(other, alice, laps(10_400, 10_400, 10_400), now)
        with CaptureQueriesContext(connection) as queries:
            html = page("/racers/alice/")
        of_references = sum("tracks_referencelap" in query["sql"] for query in queries)
        assert of_references <= 1, "one for all rows"
        counts.append(len(queries) - of_references)
    assert html.count('class="medal gold"') == 3
    assert counts[1] == counts[2]


def test_who_wants_no_spoilers_sees_no_medal(race):
    Racer.objects.filter(alias="carl").update(hides_results_since=race.opens_at - timedelta(days=1))
    html = page("/racers/alice/", "carl")
    assert "Results are hidden" in html and 'class="medal ' not in html


def test_the_garage_shows_the_medal_of_the_last_run(race, now):
    assert "medal silver" in page("/models/", "alice") and 'class="medal ' not in page("/models/", "carl")


def test_a_board_shows_my_medal_and_the_next_one(race):
    html = page(race.get_absolute_url(), "alice")
    assert "medal silver" in html and "medal gold" in html and "0:10.500" in html


def test_a_board_names_the_house_car_to_beat_for_a_medal(race):
    html = page(race.get_absolute_url(), "carl")
    assert "Beat steady by 0.560 s for bronze" in html


def test_the_row_of_a_house_car_has_its_medal_and_what_beating_it_earns(race, now):
    entry = drive(race, a_racer("flyer"), laps(11_000, 11_000, 11_000), now).entry
    Entry.objects.filter(pk=entry.pk).update(is_baseline=True)

    def row(alias: str) -> str:
        pk = Entry.objects.get(race=race, racer__alias=alias).pk
        return page(race.get_absolute_url()).partition(f'id="car-{pk}"')[2].partition("</td></tr>")[0]

    assert "Beat flyer by 0.500 s for gold" in " ".join(row("flyer").split()) and "medal silver" in row("flyer")
    assert "Beat steady by 0.560 s for bronze" in " ".join(row("steady").split())
    assert "Beat alice" not in row("alice"), "of racers only a board of their own says it"
    ReferenceLap.objects.all().delete()
    assert "for gold" not in row("flyer"), "a line is drawn anew when the reference changes"


def test_the_house_car_of_a_target_is_the_fastest_that_is_slower_than_the_medal(race, now):
    for alias, time in (("brisk", 13_200), ("flyer", 12_000)):
        entry = drive(race, a_racer(alias), laps(time, time, time), now).entry
        Entry.objects.filter(pk=entry.pk).update(is_baseline=True)
    house = list(Entry.objects.filter(race=race, is_baseline=True).order_by("best_lap_ms"))
    assert [entry.racer.alias for entry in house] == ["flyer", "brisk", "steady"]
    target = medal_target(race, None, house)
    assert target is not None and target.house is not None
    assert (target.medal, target.house.racer.alias, target.by_ms) == (Medal.BRONZE, "brisk", 200)
    target = medal_target(race, 13_000, house)
    assert target is not None and target.house is not None
    assert (target.medal, target.house.racer.alias, target.by_ms) == (Medal.SILVER, "flyer", 500)
    assert medal_target(race, 9_000, house) is None


def test_a_track_lists_its_reference_laps_and_the_time_of_each_medal(race):
    html = page(race.track.get_absolute_url())
    assert all(time in html for time in ("0:10.000", "0:09.999", "0:10.500", "0:11.500", "0:13.000"))
    assert f"/tracks/{race.track.slug}/reference/?direction=ccw" in html


def test_a_track_without_a_reference_lists_none(wakes, now):
    assert 'id="reference"' not in page(a_race(now).track.get_absolute_url())


def test_a_reference_is_a_run_document(race):
    document = json.loads(page(f"/tracks/{race.track.slug}/reference/replay.json?direction=ccw"))
    assert (document["name"], document["track"], document["direction"]) == ("Reference lap", race.track.slug, "ccw")
    assert [lap["time_ms"] for lap in document["laps"]] == [10_200, 10_000, 10_100]
    assert len(document["columns"]["x"]) == 450 and document["columns"]["t"][0] == 0
    assert document["bots"] == document["boxes"] == document["rivals"] == []


@pytest.mark.parametrize("query", ["?direction=cw", "?direction=up"])
def test_a_missing_reference_is_not_found(race, client, query):
    for address in ("reference/", "reference/replay.json"):
        assert client.get(f"/tracks/{race.track.slug}/{address}{query}").status_code == 404


def test_the_page_of_a_reference_plays_its_best_lap(race):
    html = page(f"/tracks/{race.track.slug}/reference/")
    assert f"/tracks/{race.track.slug}/reference/replay.json?direction=ccw" in html and "&quot;lap&quot;: 2" in html


def test_a_replay_takes_the_reference_lap_as_a_ghost(race, now):
    run = a_driven_run(race, a_racer("gina"), now)
    without = page(f"/evaluations/{run.public_id}/replay/", "gina")
    assert "ghost=reference" in without and "reference/replay.json" not in without
    assert "reference/replay.json" in page(f"/evaluations/{run.public_id}/replay/?ghost=reference", "gina")


def test_a_run_by_other_rules_has_no_medal(race, now):
    run = a_driven_run(race, a_racer("gina"), now)
    assert medal_of_run(run) == Medal.AUTHOR
    run.spec["rules"]["race_type"] = "object_avoidance"
    assert medal_of_run(run) is None


def test_the_home_page_says_which_house_car_to_beat_for_a_medal(wakes):
    now = timezone.now()
    race = a_race(now)
    entry = drive(race, a_racer("steady"), laps(13_560, 13_560, 13_560), now).entry
    Entry.objects.filter(pk=entry.pk).update(is_baseline=True)
    a_reference(race.track, REFERENCE_MS, now)
    assert "Beat steady by 0.560 s for bronze" in page("/")
