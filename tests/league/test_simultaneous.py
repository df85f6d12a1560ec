"""Two admins at the same moment: nothing is lost silently, and what is checked holds when both are through.

On SQLite here, on PostgreSQL below, where two transactions really run side by side.
"""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.core.exceptions import ValidationError
from django.test import Client

from accounts.models import Racer
from league.models import Membership, Round, RoundPoints
from league.seasons.services.race_changes import postpone_round
from league.stewarding.official_results import close_due_rounds, close_round
from league.stewarding.services import disqualify, put_back, reopen_round
from paddock.errors import PaddockError
from races.models import Race
from races.pages.services import edit_race, edition_of
from tests.factories import a_track
from tests.league.seasons import HOUR, JANUARY, a_round, after, board, racers
from tests.races.test_concurrency import at_once

pytestmark = pytest.mark.django_db(transaction=True)
NOW = JANUARY - timedelta(days=1)
ABOUT_THE_DATABASE = (
    "simultaneous",
    "clock",
    "closing",
    "succession",
    "stewards",
    "moved_rounds",
    "notices",
    "history_attacks",
    "duels_recorded",
    "telling_costs",
)


@pytest.fixture
def steward():
    return Racer.objects.create_superuser("steward", "steward@example.org", None)


def code(call):
    """What the call returns, or the code that it is refused with."""
    try:
        return call()
    except PaddockError as fault:
        return fault.code
    except ValidationError as refused:
        return next(error.code for errors in refused.error_dict.values() for error in errors)


def test_two_concurrent_postponements_add_up(season):
    round_ = a_round(season, 1, "open-qualifier")
    opens, closes = round_.race.opens_at, round_.race.closes_at
    answers = at_once(
        [lambda: postpone_round(round=Round.objects.get(pk=round_.pk), hours=24, reason="Rain.", now=NOW)] * 3
    )
    assert all(isinstance(one, Race) for one in answers), answers
    race = Race.objects.get(pk=round_.race_id)
    assert (race.opens_at, race.closes_at) == (opens + 72 * HOUR, closes + 72 * HOUR)


def test_two_concurrent_edits_of_one_field_apply_once(season):
    race = a_round(season, 1, "open-qualifier").race
    seen = edition_of(Race.objects.get(pk=race.pk))
    names = [f"Name {number}" for number in range(4)]
    answers = at_once([lambda name=name: edit_race(race=race, now=NOW, edition=seen, name=name) for name in names])
    assert sorted(str(one) for one in answers if not isinstance(one, Race)) == ["race_changed_meanwhile"] * 3, answers
    assert Race.objects.get(pk=race.pk).name in names


def test_two_concurrent_saves_of_a_season_form_apply_once(season, steward):
    address = f"/admin/league/season/{season.pk}/change/"
    clients = [Client() for _ in range(3)]
    for client in clients:
        client.force_login(steward, backend="django.contrib.auth.backends.ModelBackend")
    form = clients[0].get(address).context["adminform"].form
    usual = {field.html_name: "" if field.value() is None else str(field.value()) for field in form}
    usual |= {"points": "[10, 6, 3, 1]", "rounds-TOTAL_FORMS": "0", "rounds-INITIAL_FORMS": "0"}
    answers = at_once(
        [
            lambda client=client, number=number: client.post(address, usual | {"name": f"Name {number}"}).status_code
            for number, client in enumerate(clients)
        ]
    )
    assert sorted(answers) == [200, 200, 302], answers


def test_concurrent_edits_of_different_fields_all_apply(season):
    race = a_round(season, 1, "open-qualifier").race
    changes = ({"name": "New"}, {"max_submissions": 7}, {"description": "Words"}, {"laps": 5})
    at_once(
        [lambda change=change: edit_race(race=Race.objects.get(pk=race.pk), now=NOW, **change) for change in changes]
    )
    race.refresh_from_db()
    assert (race.name, race.max_submissions, race.description, race.laps) == ("New", 7, "Words", 5)


def test_concurrent_moves_cannot_make_rounds_overlap(season):
    first = a_round(season, 1, "open-qualifier")
    end = first.race.closes_at
    second = a_round(season, 2, "open-qualifier", opens_at=end + 10 * HOUR)
    answers = at_once(
        [
            lambda: code(lambda: edit_race(race=first.race, now=NOW, closes_at=end + 8 * HOUR)),
            lambda: code(lambda: edit_race(race=second.race, now=NOW, opens_at=end + 2 * HOUR)),
        ]
    )
    assert [one for one in answers if not isinstance(one, Race)] == ["rounds_overlap"], answers
    before, after_ = Race.objects.order_by("opens_at")
    assert before.closes_at <= after_.opens_at


def test_concurrent_scheduling_cannot_make_races_overlap(season):
    times = {"opens_at": JANUARY, "closes_at": JANUARY + 9 * HOUR, "track": a_track()}

    def schedule(number: int):
        return code(lambda: a_round(season, number, "open-qualifier", **times))

    answers = at_once([lambda number=number: schedule(number) for number in (1, 2, 3)])
    assert [one for one in answers if not isinstance(one, Round)] == ["rounds_overlap"] * 2, answers
    assert Round.objects.count() == Race.objects.count() == 1


def test_a_round_is_closed_once_by_concurrent_closings(season):
    rounds = [a_round(season, number, "open-qualifier") for number in (1, 2, 3)]
    cast = racers(20)
    for round_ in rounds:
        board(round_.race, cast)
    now = after(rounds[-1])
    calls = [lambda: len(close_due_rounds(now=now))] * 3 + [
        lambda: code(lambda: close_round(round=rounds[2], now=now))
    ] * 3
    answers = at_once(calls)
    assert not [one for one in answers if isinstance(one, BaseException)], answers
    assert not Round.objects.filter(closed_at=None).exists()
    assert Membership.objects.count() == 4 and RoundPoints.objects.count() == 3 * 4


def test_concurrent_decisions_of_stewards_all_take_effect(season, steward):
    january, ten = a_round(season, 1, "open-qualifier"), racers(10)
    board(january.race, ten)
    close_round(round=january, now=after(january))
    now = after(january, hours=1)
    out = [
        lambda racer=racer: disqualify(round=january, racer=racer, by=steward, reason="Cut.", now=now)
        for racer in ten[:4]
    ]
    answers = at_once([*out, lambda: close_due_rounds(now=now)])
    assert not [one for one in answers if isinstance(one, BaseException | str)], answers
    assert set(Membership.objects.values_list("racer", flat=True)) == {ten[4].pk}, "a fifth of the six that are left"
    back = [
        lambda racer=racer: put_back(round=january, racer=racer, by=steward, reason="Seen.", now=now)
        for racer in ten[:4]
    ]
    answers = at_once(back)
    assert not [one for one in answers if isinstance(one, BaseException | str)], answers
    assert set(Membership.objects.values_list("racer", flat=True)) == {ten[0].pk, ten[1].pk}


def test_reopening_during_a_closing_is_never_half_done(season, steward):
    january = a_round(season, 1, "open-qualifier")
    board(january.race, racers(10))
    close_round(round=january, now=after(january))
    now = after(january, hours=1)
    answers = at_once(
        [
            lambda: reopen_round(round=january, by=steward, reason="Protest.", now=now),
            *[lambda: code(lambda: close_round(round=january, now=now))] * 3,
        ]
    )
    assert not [one for one in answers if isinstance(one, BaseException)], answers
    january.refresh_from_db()
    official = january.closed_at is not None
    assert official == (january.held_at is None)
    assert (Membership.objects.count(), RoundPoints.objects.count()) == ((2, 4) if official else (0, 0))


@pytest.mark.postgres
@pytest.mark.soak
@pytest.mark.django_db(transaction=False)
def test_the_leagues_rules_hold_on_postgresql_too(again_on_postgresql):
    again_on_postgresql(*(f"tests/league/test_{name}.py" for name in ABOUT_THE_DATABASE))
