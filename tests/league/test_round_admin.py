"""What admins do with rounds: they are told what will follow, it is done once they say so, and it is logged."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import timedelta

import pytest
from django.contrib.admin.models import LogEntry
from django.contrib.auth.models import Permission
from django.test import Client
from django.urls import reverse

from accounts.models import Racer
from league.models import Decision, Membership, Notice, Round, Stage, StewardDecision
from league.seasons.services.race_changes import consequences_of, postpone_round
from league.stewarding.official_results import close_round
from league.stewarding.services import disqualify, lock_round
from paddock.errors import UserFault
from tests.factories import a_racer
from tests.kept import Kept
from tests.league.seasons import HOUR, a_round, a_season, after, board, racers

pytestmark = pytest.mark.django_db
LIST = "admin:league_round_changelist"


@pytest.fixture(autouse=True)
def _long_sessions(settings) -> None:
    """Nobody is logged out while the clock moves."""
    settings.SESSION_COOKIE_AGE = 10 * 365 * 24 * 3600


@pytest.fixture
def boss(client: Client) -> Client:
    racer = Racer.objects.create_superuser("boss", "boss@example.org", None)
    client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
    return client


@pytest.fixture(scope="session")
def kept_race_of_ten(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, _played)


@pytest.fixture
def played(kept_race_of_ten: Kept, db: None, set_clock) -> tuple[Round, list[Racer]]:
    """An open race of ten that has closed an hour ago: two would be promoted. The clock stands there."""
    round_, field = kept_race_of_ten.copy()
    set_clock(round_.race.closes_at + HOUR)
    return round_, field


def _played() -> tuple[Round, list[Racer]]:
    round_ = a_round(a_season(), 1, Stage.OPEN)
    field = racers(10)
    board(round_.race, field)
    return round_, field


def act(client: Client, round_: Round, action: str, **given: str):
    return client.post(reverse(LIST), {"action": action, "_selected_action": [round_.pk], **given}, follow=True)


def test_publishing_first_shows_who_would_be_promoted(boss, played):
    round_, field = played
    page = act(boss, round_, "publish").content.decode()
    assert f"{field[0].alias} is now promoted" in page and f"{field[2].alias} is now promoted" not in page
    assert not Membership.objects.exists() and Round.objects.get().closed_at is None
    act(boss, round_, "publish", step="confirmed")
    assert set(Membership.objects.values_list("racer", flat=True)) == {field[0].pk, field[1].pk}
    assert "Publish results" in LogEntry.objects.get().change_message


def test_a_disqualification_is_previewed_and_moves_the_next_up(boss, played):
    round_, field = played
    close_round(round=round_, now=after(round_))
    assert "Fill in all fields" in act(boss, round_, "disqualify", step="asked", racer="").content.decode()
    given = {"racer": field[0].alias, "reason": "Two accounts"}
    page = act(boss, round_, "disqualify", step="asked", **given).content.decode()
    assert f"{field[0].alias} is no longer promoted" in page and f"{field[2].alias} is now promoted" in page
    assert not StewardDecision.objects.exists()
    act(boss, round_, "disqualify", step="confirmed", **given)
    assert StewardDecision.objects.get().reason == "Two accounts"
    assert set(Membership.objects.values_list("racer", flat=True)) == {field[1].pk, field[2].pk}
    log = LogEntry.objects.get()
    assert "Two accounts" in log.change_message and log.user.alias == "boss"
    act(boss, round_, "put_back", step="confirmed", racer=field[0].alias, reason="It was a mistake")
    assert set(Membership.objects.values_list("racer", flat=True)) == {field[0].pk, field[1].pk}


def test_a_steward_picks_the_racer_from_the_board(boss, played):
    round_, field = played
    page = act(boss, round_, "disqualify").content.decode()
    offered = re.findall(r'type="radio" name="racer" value="([^"]+)"', page)
    assert offered == [one.alias for one in field], "in the order of the board"
    assert 'type="text"' not in page and f"1. {field[0].alias}" in page
    page = act(boss, round_, "disqualify", step="find", find=field[3].alias[1:], reason="Two accounts").content.decode()
    assert field[3].alias in re.findall(r'name="racer" value="([^"]+)"', page) and "Two accounts" in page
    page = act(boss, round_, "disqualify", step="find", find="nobody at all", racer=field[1].alias).content.decode()
    assert re.findall(r'name="racer" value="([^"]+)" required checked', page) == [field[1].alias], "stays chosen"
    assert not StewardDecision.objects.exists() and "Fill in all fields" not in page
    assert "No racer has been removed from the board." in act(boss, round_, "put_back").content.decode()
    act(boss, round_, "disqualify", step="confirmed", racer=field[0].alias, reason="Two accounts")
    page = act(boss, round_, "put_back").content.decode()
    assert re.findall(r'name="racer" value="([^"]+)"', page) == [field[0].alias] and "Two accounts" in page


class TestRacePage:
    """Everything on a round is one click from its board, and ends there."""

    def actions(self, client: Client, round_: Round) -> list[str]:
        html = client.get(round_.race.get_absolute_url()).content.decode()
        return re.findall(r'name="action" value="(\w+)"', html)

    def test_the_board_offers_only_admins_the_possible_actions(self, boss, played, set_clock):
        round_, field = played
        assert self.actions(boss, round_) == ["publish", "disqualify", "put_back", "announce"]
        close_round(round=round_, now=after(round_))
        assert self.actions(boss, round_) == ["disqualify", "put_back", "take_back", "lock", "announce"]
        for racer in (field[0], a_racer("helper", is_staff=True)):
            other = Client()
            other.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
            assert self.actions(other, round_) == []
        assert self.actions(Client(), round_) == []
        set_clock(after(round_, days=9))
        assert self.actions(boss, round_) == ["announce"]
        set_clock(round_.race.opens_at - HOUR)
        Round.objects.update(closed_at=None)
        assert self.actions(boss, round_) == ["postpone", "announce"]

    def test_an_action_leads_back_to_the_board(self, boss, played):
        round_, field = played
        page = act(boss, round_, "disqualify", back="race")
        assert page.status_code == 200 and 'name="back" value="race"' in page.content.decode()
        given = {"racer": field[0].alias, "reason": "Two accounts", "back": "race"}
        done = act(boss, round_, "disqualify", step="confirmed", **given)
        assert done.redirect_chain == [(round_.race.get_absolute_url(), 302)]
        shown = done.content.decode()
        assert "Two accounts" in shown or not re.search(rf"\b{field[0].alias}\b", shown)

    def test_viewing_an_action_or_forging_a_post_changes_nothing(self, boss, played):
        round_, _field = played
        boss.get(reverse(LIST), {"action": "publish", "_selected_action": round_.pk, "step": "confirmed"})
        forged = Client(enforce_csrf_checks=True)
        forged.cookies = boss.cookies
        data = {"action": "publish", "_selected_action": round_.pk, "step": "confirmed"}
        assert forged.post(reverse(LIST), data).status_code == 403
        assert Round.objects.get().closed_at is None and not Membership.objects.exists()

    def test_removing_a_racer_first_shows_the_consequences(self, boss, played, set_clock):
        round_, field = played
        address = reverse("race_racer_remove", args=[round_.race.slug, field[0].alias])
        assert "Effect on the season" not in boss.get(address).content.decode()
        close_round(round=round_, now=after(round_))
        html = boss.get(address).content.decode()
        assert f"{field[0].alias} is no longer promoted" in html and f"{field[2].alias} is now promoted" in html
        assert Membership.objects.filter(racer=field[0]).exists(), "looking changes nothing"
        boss.post(address, {"reason": "Two accounts"})
        assert not Membership.objects.filter(racer=field[0]).exists()
        assert "Two accounts" in LogEntry.objects.first().change_message
        set_clock(after(round_, days=9))
        last = reverse("race_racer_remove", args=[round_.race.slug, field[1].alias])
        assert "The results are final" in boss.get(last).content.decode()

    def test_cancelling_first_shows_the_consequences(self, boss, set_clock):
        round_ = a_round(a_season(), 1, Stage.OPEN)
        set_clock(round_.race.opens_at + HOUR)
        html = boss.get(reverse("race_cancel", args=[round_.race.slug])).content.decode()
        assert "No racer is promoted from this open race." in html and "No points; not a round" in html
        data = {"action": "cancel", "_selected_action": [round_.race.pk]}
        html = boss.post(reverse("admin:races_race_changelist"), data).content.decode()
        assert "No racer is promoted from this open race." in html


def test_an_impossible_action_is_explained_and_not_offered(boss, played):
    round_, _field = played
    page = act(boss, round_, "disqualify", step="confirmed", racer="nobody", reason="x").content.decode()
    assert "Not possible" in page and "There is no racer nobody." in page
    assert 'value="confirmed"' not in page
    page = act(boss, round_, "take_back", step="asked", reason="x").content.decode()
    assert "not official yet" in page and 'value="confirmed"' not in page


def test_locked_results_cannot_change(boss, played):
    round_, field = played
    close_round(round=round_, now=after(round_))
    act(boss, round_, "lock", step="confirmed", reason="All checked")
    locked = Round.objects.get()
    assert locked.locked_at is not None and not locked.is_under_review(after(round_, hours=2))
    assert StewardDecision.objects.get().decision == Decision.LOCKED
    with pytest.raises(UserFault) as refused:
        disqualify(
            round=locked, racer=field[0], by=Racer.objects.get(alias="boss"), reason="x", now=after(round_, hours=2)
        )
    assert refused.value.code == "steward_window_over"


def test_only_official_results_can_be_locked(played):
    round_, _field = played
    with pytest.raises(UserFault) as refused:
        lock_round(round=round_, by=a_racer(is_staff=True), reason="x", now=after(round_))
    assert refused.value.code == "round_not_official"


class TestPostponing:
    def test_postponing_moves_the_race_and_tells_its_racers_why(self, boss, set_clock):
        round_ = a_round(a_season(), 1, Stage.OPEN)
        field = racers(2)
        board(round_.race, field)
        opens, closes = round_.race.opens_at, round_.race.closes_at
        set_clock(opens - timedelta(days=1))
        act(boss, round_, "postpone", step="confirmed", hours="48", reason="The track is wet")
        round_.race.refresh_from_db()
        assert (round_.race.opens_at, round_.race.closes_at) == (opens + 48 * HOUR, closes + 48 * HOUR)
        assert "The track is wet" in Notice.objects.get(racer=field[0]).params["text"]
        assert "48" in LogEntry.objects.get().change_message

    def test_postponing_an_open_race_moves_only_its_close(self):
        round_ = a_round(a_season(), 1, Stage.OPEN)
        opens, closes = round_.race.opens_at, round_.race.closes_at
        race = postpone_round(round=round_, hours=5, reason="x", now=opens + HOUR)
        assert (race.opens_at, race.closes_at) == (opens, closes + 5 * HOUR)

    def test_postponing_into_the_next_round_or_past_the_end_is_refused(self, boss, set_clock):
        season = a_season()
        first = a_round(season, 1, Stage.OPEN)
        a_round(season, 2, Stage.OPEN)
        set_clock(first.race.opens_at + HOUR)
        page = act(boss, first, "postpone", step="asked", hours="5", reason="x").content.decode()
        assert "overlap" in page and 'value="confirmed"' not in page
        for hours in ("0", "x", "99999"):
            page = act(boss, first, "postpone", step="asked", hours=hours, reason="x").content.decode()
            assert "whole hours" in page
        set_clock(after(first))
        assert (
            'value="confirmed"'
            not in act(boss, first, "postpone", step="asked", hours="5", reason="x").content.decode()
        )
        assert not Notice.objects.exists()


def test_an_announcement_reaches_everybody_in_the_race(boss, played):
    round_, field = played
    act(boss, round_, "announce", step="confirmed", text="Well driven")
    assert Notice.objects.filter(kind="message").count() == len(field)


def test_previewing_changes_nothing(played):
    round_, _field = played
    lines = consequences_of(lambda: close_round(round=round_, now=after(round_)), round_.season)
    assert len(lines) == 2 + 4 and not Membership.objects.exists()
    assert consequences_of(lambda: None, round_.season) == [
        "Promotions, finale fields, championship places and points do not change."
    ]


def test_staff_without_the_permission_can_do_nothing(played):
    round_, _field = played
    helper = a_racer("helper", is_staff=True)
    helper.user_permissions.add(Permission.objects.get(codename="view_round"))
    client = Client()
    client.force_login(helper, backend="django.contrib.auth.backends.ModelBackend")
    assert client.get(reverse(LIST)).status_code == 200
    act(client, round_, "publish", step="confirmed")
    assert Round.objects.get().closed_at is None
    member = Client()
    member.force_login(a_racer(), backend="django.contrib.auth.backends.ModelBackend")
    assert member.get(reverse(LIST)).status_code == 302


def test_the_log_is_read_only(boss, played):
    round_, _field = played
    act(boss, round_, "publish", step="confirmed")
    page = boss.get(reverse("admin:admin_logentry_changelist")).content.decode()
    assert "Publish results" in page and "boss" in page
    entry = LogEntry.objects.get()
    assert boss.post(reverse("admin:admin_logentry_delete", args=[entry.pk]), {"post": "yes"}).status_code == 403
    assert LogEntry.objects.exists()
