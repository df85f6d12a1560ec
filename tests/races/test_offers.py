"""Which races a model is offered, and in which order."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta

import pytest
from django.contrib.auth.models import AnonymousUser
from django.db import connection
from django.test.utils import CaptureQueriesContext

from races.entries.selectors.offers import offers_for
from races.entries.services.entries import withdraw
from races.entries.services.submissions import submit_model
from races.models import Race
from tests.factories import a_model, a_race, drive, laps
from tests.rows import track_row

pytestmark = pytest.mark.django_db
DAY = timedelta(days=1)


@dataclass(frozen=True)
class Learned:
    track_id: int
    direction: str = "ccw"
    race_type: str = "time_trial"


def test_races_similar_to_the_training_come_first(alice, now):
    here, elsewhere = track_row("oval"), track_row("kuei-raceway")
    boxes = {"race_type": "object_avoidance", "random_boxes": 3}
    other = a_race(now, track=elsewhere, **boxes)
    league = a_race(now, track=elsewhere, kind="league", division="open", **boxes)
    same_type = a_race(now, track=elsewhere)
    same_track = a_race(now, track=here, **boxes)
    other_way = a_race(now, track=here, direction="cw")
    long = a_race(now, track=here, closes_at=now + 90 * DAY)
    short = a_race(now, track=here, closes_at=now + DAY)
    model = a_model(alice)
    offers = offers_for(model=model, racer=alice, now=now, learned=Learned(here.pk))
    assert [offer.race for offer in offers] == [short, long, other_way, same_track, same_type, league, other]
    assert [offer.fits for offer in offers] == [True, True] + [False] * 5
    assert offers_for(model=model, racer=alice, now=now)[0].race == league, "the league's first"


def test_races_that_would_refuse_the_car_are_not_offered(alice, bob, now, monkeypatch):
    """Sensors that are not offered, no submission left, withdrawn, closed, not to be seen, not eligible."""
    model = a_model(alice)
    a_race(now, sensors=["STEREO_CAMERAS"])
    a_race(now, opens_at=now - 9 * DAY, closes_at=now)
    a_race(now, organiser=bob, visibility="invitation")
    left = submit_model(race=a_race(now), racer=alice, model=model, now=now).entry  # sent before it was withdrawn
    withdraw(entry=left, now=now)
    used_up = a_race(now, max_submissions=1)
    drive(used_up, alice, laps(9_000), now)
    assert offers_for(model=model, racer=alice, now=now) == []
    fine = a_race(now)
    assert [offer.race for offer in offers_for(model=model, racer=alice, now=now)] == [fine]
    monkeypatch.setattr("races.entries.selectors.offers.refusal", lambda *_: "somebody else's league")
    assert offers_for(model=model, racer=alice, now=now) == []
    assert offers_for(model=model, racer=AnonymousUser(), now=now) == []


def test_an_offer_tells_of_an_earlier_submission_even_if_none_is_left(alice, now):
    model, race = a_model(alice), a_race(now, max_submissions=1)
    sent = submit_model(race=race, racer=alice, model=model, now=now)
    assert [(offer.race, offer.sent) for offer in offers_for(model=model, racer=alice, now=now)] == [(race, sent)]


def test_more_races_need_no_more_queries(alice, now):
    model = a_model(alice)
    Race.objects.filter(pk=a_race(now).pk).exists()

    def asked() -> int:
        with CaptureQueriesContext(connection) as queries:
            offers_for(model=model, racer=alice, now=now)
        return len(queries)

    before = asked()
    for _ in range(30):
        a_race(now)
    assert asked() <= before
    assert len(offers_for(model=model, racer=alice, now=now)) == 12
