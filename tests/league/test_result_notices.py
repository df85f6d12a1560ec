"""The notice of a result says the result."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.utils import translation

from accounts.models import Racer
from evaluation.models import Evaluation
from league.models import Notice
from league.notices.sentences import sentence
from paddock.errors import UserFault
from races.entries.services.submissions import submit_model
from tests.factories import a_model, a_race, a_racer, drive, fail, lap, laps
from tests.happened import tell_what_happened

pytestmark = pytest.mark.django_db


def said(racer: Racer, now) -> str:
    """The last result that the racer is told."""
    tell_what_happened(now=now)
    return sentence(Notice.objects.filter(racer=racer, kind="result").order_by("-pk").first())


@pytest.fixture
def alice(wakes) -> Racer:
    return a_racer("alice")


def test_it_names_the_score_the_place_and_what_changed(alice, now):
    race = a_race(now, name="Oval")
    drive(race, a_racer(), laps(11_000, 11_000, 11_000), now)
    drive(race, alice, laps(12_000, 13_000, 12_500), now)
    assert said(alice, now) == ("Your car in Oval: 0:12.500. Place 2 of 2. Your first result in this race.")
    drive(race, alice, laps(12_000, 12_000, 12_000), now)
    assert said(alice, now) == "Your car in Oval: 0:12.000. Place 2 of 2. 0.500 s faster than before."
    drive(race, alice, laps(12_000, 12_000, 12_300), now)
    assert said(alice, now) == (
        "Your car in Oval: 0:12.100. Place 2 of 2. 0.100 s slower than before: the board did not change."
    )


def test_it_says_what_an_unclassified_car_lacks(alice, now):
    drive(a_race(now, name="Oval"), alice, [lap(1), lap(2, complete=False, percentage=40)], now)
    assert said(alice, now) == (
        "Your car in Oval is not classified: 1 of 3 complete laps in a row. Your first result in this race."
    )


def test_it_says_why_a_car_was_not_timed_in_the_readers_language(alice, now):
    race = a_race(now, name="Oval")
    failed = submit_model(race=race, racer=alice, model=a_model(alice), now=now)
    fail(failed, UserFault("non_finite_action", step=7), now)
    reason = Evaluation.objects.get(submission=failed).reason
    assert reason and said(alice, now) == f"Your car in Oval has no time. {reason}"
    with translation.override("ko"):
        assert reason not in said(alice, now)


def test_an_old_notice_keeps_its_text(alice, now):
    notice = Notice(racer=alice, kind="result", about="x", params={"race": "Oval"}, at=now - timedelta(days=9))
    assert sentence(notice) == "The result of your car in Oval is in."
