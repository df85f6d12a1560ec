"""The admin site of racers, seasons and divisions."""

from __future__ import annotations

from datetime import date

import pytest
from django.contrib import admin
from django.contrib.auth.models import Permission
from django.urls import reverse

from accounts.models import Racer
from league.models import Membership, Round, Season, Stage
from league.stewarding.official_results import close_round
from tests.factories import a_race, a_racer, drive, laps
from tests.league.seasons import a_round, a_season, after, board, racers, stand

pytestmark = pytest.mark.django_db


@pytest.fixture
def boss(client):
    """A superuser who is logged in."""
    racer = Racer.objects.create_superuser("boss", "boss@example.org", None)
    client.force_login(racer)
    return client


def test_every_page_of_the_admin_site_opens(boss, now):
    race = a_race(now, kind="league", division="open")
    drive(race, a_racer(), laps(9_000, 9_000, 9_000), now)
    season = Season.objects.create(slug="s", name="S", starts_on=date(2026, 1, 1), ends_on=date(2026, 12, 31))
    Round.objects.create(season=season, number=1, race=race)
    Membership.objects.create(season=season, racer=Racer.objects.get(alias="boss"))
    rooms = ("courses", "league", "training", "races", "videos", "tracks", "evaluation", "accounts")
    ours = [model for model in admin.site._registry if model._meta.app_label in rooms]
    assert len(ours) >= 8
    assert boss.get(reverse("admin:index")).status_code == 200
    for model in ours:
        base = f"admin:{model._meta.app_label}_{model._meta.model_name}"
        response = boss.get(reverse(f"{base}_changelist") + "?q=a")
        assert response.status_code == 200, model
        for row in model._default_manager.all()[:2]:
            assert boss.get(reverse(f"{base}_change", args=[row.pk])).status_code == 200, row
        if admin.site._registry[model].has_add_permission(response.wsgi_request):
            assert boss.get(reverse(f"{base}_add")).status_code == 200, model


def test_only_the_list_of_racers_shows_email_addresses(boss, now):
    racer = a_racer("shy")
    drive(a_race(now, organiser=racer), racer, laps(9_000, 9_000, 9_000), now)
    season = Season.objects.create(slug="s", name="S", starts_on=date(2026, 1, 1), ends_on=date(2026, 12, 31))
    Membership.objects.create(season=season, racer=racer)
    showing = set()
    for model in admin.site._registry:
        address = reverse(f"admin:{model._meta.app_label}_{model._meta.model_name}_changelist")
        if "shy@example.org" in boss.get(address).content.decode():
            showing.add(model.__name__)
    assert showing == {"Racer"}


def test_an_admin_creates_a_racer_whose_alias_is_fixed(boss):
    data = {"alias": "fresh", "email": "Fresh@Example.org", "usable_password": "true"}
    data |= {"password1": "a long enough secret", "password2": "a long enough secret"}
    response = boss.post(reverse("admin:accounts_racer_add"), data)
    assert response.status_code == 302, response.context["adminform"].form.errors
    racer = Racer.objects.get(alias="fresh")
    page = boss.get(reverse("admin:accounts_racer_change", args=[racer.pk])).content.decode()
    assert 'name="email"' in page and 'name="alias"' not in page


def test_a_racer_with_results_is_deactivated_or_loses_the_name(boss, now):
    racer = a_racer()
    drive(a_race(now), racer, laps(9_000, 9_000, 9_000), now)
    data = {"action": "deactivate", "_selected_action": [racer.pk]}
    boss.post(reverse("admin:accounts_racer_changelist"), data, follow=True)
    racer.refresh_from_db()
    assert not racer.is_active
    boss.post(reverse("admin:accounts_racer_changelist"), data | {"action": "activate"}, follow=True)
    racer.refresh_from_db()
    assert racer.is_active
    boss.post(reverse("admin:accounts_racer_delete", args=[racer.pk]), {"post": "yes"})
    racer.refresh_from_db()
    assert racer.alias == f"deleted-racer-{racer.pk}" and racer.entries.count() == 1


def test_only_superusers_grant_permissions(client):
    helper = a_racer("helper", is_staff=True)
    helper.user_permissions.set(Permission.objects.filter(content_type__app_label__in=("accounts", "league")))
    client.force_login(helper)
    boss = Racer.objects.create_superuser("boss", "boss@example.org", None)
    address = reverse("admin:accounts_racer_change", args=[helper.pk])
    page = client.get(address).content.decode()
    assert 'name="is_superuser"' not in page and 'name="user_permissions"' not in page
    client.post(address, {"email": "helper@example.org", "is_superuser": "on", "is_active": "on"})
    helper.refresh_from_db()
    assert not helper.is_superuser
    page = client.get(reverse("admin:accounts_racer_change", args=[boss.pk])).content.decode()
    assert 'name="email"' not in page, "a superuser is looked at, not changed"
    assert client.get(reverse("admin:auth_user_password_change", args=[boss.pk])).status_code == 403


# what the form of a season is filled with from the start
NUMBERS = {
    "promotion_percent": "10",
    "finale_size": "16",
    "championship_places": "3",
    "points": "[25, 18, 15]",
    "drop_worst": "0",
    "steward_hours": "48",
}


def test_a_season_takes_one_league_race_per_stage_and_number(boss, now):
    opened = a_race(now, kind="league", division="open")
    again = a_race(now, kind="league", division="open")
    community = a_race(now)
    data = {
        "slug": "2026",
        "name": "2026",
        "starts_on": "2026-01-01",
        "ends_on": "2026-12-31",
        **NUMBERS,
        "rounds-TOTAL_FORMS": "1",
        "rounds-INITIAL_FORMS": "0",
        "rounds-0-number": "1",
        "rounds-0-race": str(community.pk),
    }
    page = boss.post(reverse("admin:league_season_add"), data)
    assert "community race" in page.content.decode()
    assert not Season.objects.exists()
    twice = {"rounds-TOTAL_FORMS": "2", "rounds-0-race": str(opened.pk), "rounds-1-number": "1"}
    page = boss.post(reverse("admin:league_season_add"), data | twice | {"rounds-1-race": str(again.pk)})
    assert "already has a race in this round" in page.content.decode()
    assert not Season.objects.exists()
    assert boss.post(reverse("admin:league_season_add"), data | {"rounds-0-race": str(opened.pk)}).status_code == 302
    season = Season.objects.get()
    assert season.rounds.get().race == opened
    assert season.rounds.get().stage == "open-qualifier"
    data |= {
        "rounds-TOTAL_FORMS": "2",
        "rounds-INITIAL_FORMS": "1",
        "rounds-0-id": str(season.rounds.get().pk),
        "rounds-0-season": str(season.pk),
        "rounds-0-race": str(opened.pk),
        "rounds-1-season": str(season.pk),
        "rounds-1-number": "1",
        "rounds-1-race": str(again.pk),
    }
    page = boss.post(reverse("admin:league_season_change", args=[season.pk]), data)
    assert "already has a race in this round" in page.content.decode()
    data["rounds-1-race"] = str(a_race(now, kind="league", division="pro").pk)
    assert boss.post(reverse("admin:league_season_change", args=[season.pk]), data).status_code == 302
    assert set(season.rounds.values_list("number", "stage")) == {(1, "open-qualifier"), (1, "pro-qualifier")}


@pytest.mark.parametrize(
    "field, value, told",
    [
        ("promotion_percent", "100", "less than 100"),
        ("points", "[1, 2]", "must not increase"),
        ("championship_places", "17", "too few cars"),
    ],
)
def test_invalid_season_numbers_are_reported_on_their_field(boss, field, value, told):
    data = {"slug": "x", "name": "X", "starts_on": "2026-01-01", "ends_on": "2026-02-01"} | NUMBERS
    data |= {"rounds-TOTAL_FORMS": "0", "rounds-INITIAL_FORMS": "0", field: value}
    page = boss.post(reverse("admin:league_season_add"), data)
    assert told in page.content.decode() and field in page.context["adminform"].errors
    assert not Season.objects.exists()


class TestSeasonWithResults:
    """What its official rounds were worked out from stays as it was."""

    @pytest.fixture
    def round_(self, boss) -> Round:
        made = a_round(a_season(), 1, Stage.OPEN)
        board(made.race, racers(10))
        return close_round(round=made, now=after(made))

    def form(self, round_: Round, **changes: str) -> dict[str, str]:
        season = round_.season
        data = {"slug": season.slug, "name": season.name, "starts_on": "2027-01-01", "ends_on": "2027-12-31"}
        data |= NUMBERS | {"rounds-TOTAL_FORMS": "1", "rounds-INITIAL_FORMS": "1", "rounds-0-id": str(round_.pk)}
        data |= {"rounds-0-season": str(season.pk), "rounds-0-race": str(round_.race_id), "rounds-0-number": "1"}
        data |= {"rounds-0-stage": round_.stage, "rounds-0-name": round_.name}
        return data | changes

    def test_its_numbers_are_read_only(self, boss, round_):
        address = reverse("admin:league_season_change", args=[round_.season_id])
        html = boss.get(address).content.decode()
        assert 'name="points"' not in html and 'name="promotion_percent"' not in html and 'name="prizes"' in html
        data = self.form(round_, points="[100]", promotion_percent="90", prizes="A mug")
        assert boss.post(address, data).status_code == 302
        season = Season.objects.get()
        assert season.points == [10, 6, 3, 1] and season.promotion_percent == 20 and season.prizes == "A mug"

    @pytest.mark.parametrize("changes", [{"rounds-0-DELETE": "on"}, {"rounds-0-number": "2"}])
    def test_its_official_rounds_cannot_be_removed_or_moved(self, boss, round_, changes):
        page = boss.post(reverse("admin:league_season_change", args=[round_.season_id]), self.form(round_, **changes))
        assert page.status_code == 200 and "official" in page.content.decode()
        assert Round.objects.get().number == 1 and Membership.objects.count() == 2

    def test_a_round_that_is_not_official_can_be_removed(self, boss, round_):
        other = a_round(round_.season, 2, Stage.OPEN)
        data = self.form(round_) | {"rounds-TOTAL_FORMS": "2", "rounds-INITIAL_FORMS": "2", "rounds-1-number": "2"}
        data |= {"rounds-1-id": str(other.pk), "rounds-1-season": str(round_.season_id), "rounds-1-DELETE": "on"}
        data |= {"rounds-1-race": str(other.race_id), "rounds-1-stage": other.stage, "rounds-1-name": other.name}
        assert boss.post(reverse("admin:league_season_change", args=[round_.season_id]), data).status_code == 302
        assert list(Round.objects.values_list("pk", flat=True)) == [round_.pk]

    def test_a_racer_moved_back_to_open_leaves_the_pro_race(self, boss, round_):
        pro = a_round(round_.season, 2, Stage.PRO)
        member = Membership.objects.first()
        stand(pro.race, member.racer, 20_000)
        address = reverse("admin:league_membership_change", args=[member.pk])
        assert boss.post(address, {"division": "open"}).status_code == 302
        member.refresh_from_db()
        assert member.division == "open" and member.promoted_in is None
        assert pro.race.entries.get(racer=member.racer).removed_at is not None

    def test_a_division_set_by_hand_can_be_deleted_but_no_promotion(self, boss, round_, alice):
        member = Membership.objects.first()
        assert (
            boss.post(reverse("admin:league_membership_delete", args=[member.pk]), {"post": "yes"}).status_code == 403
        )
        by_hand = Membership.objects.create(season=round_.season, racer=alice)
        boss.post(reverse("admin:league_membership_delete", args=[by_hand.pk]), {"post": "yes"})
        assert not Membership.objects.filter(racer=alice).exists()


class TestTwoAdmins:
    """The second to save is told, and overwrites nothing."""

    @pytest.fixture
    def round_(self):
        return a_round(a_season(), 1, Stage.OPEN)

    def opened(self, boss, season: Season) -> dict[str, str]:
        """What a browser that opened the form would send."""
        page = boss.get(reverse("admin:league_season_change", args=[season.pk]))
        forms = [page.context["adminform"].form, *page.context["inline_admin_formsets"][0].formset.forms]
        forms.append(page.context["inline_admin_formsets"][0].formset.management_form)
        sent = {field.html_name: field.value() for form in forms for field in form}
        return {name: "" if value is None else str(value) for name, value in sent.items() if value is not False}

    def save(self, boss, season: Season, data: dict[str, str]) -> list[str]:
        """The codes that the form is refused with, none when it was saved."""
        answer = boss.post(reverse("admin:league_season_change", args=[season.pk]), data)
        if answer.status_code == 302:
            return []
        form = answer.context["adminform"].form
        assert form.errors, answer.context["errors"]
        return [error.code for errors in form.errors.as_data().values() for error in errors]

    def test_the_second_save_is_refused_and_the_first_stands(self, boss, round_):
        season = round_.season
        first, second = self.opened(boss, season), self.opened(boss, season)
        assert self.save(boss, season, first | {"prizes": "A mug"}) == []
        assert self.save(boss, season, second | {"name": "Another"}) == ["season_changed_meanwhile"]
        season.refresh_from_db()
        assert (season.prizes, season.name) == ("A mug", "2027")
        assert self.save(boss, season, self.opened(boss, season) | {"name": "Another"}) == []
        season.refresh_from_db()
        assert (season.prizes, season.name) == ("A mug", "Another")

    def test_adding_moving_or_closing_a_round_counts_as_a_change(self, boss, round_):
        season = round_.season
        other = a_round(season, 2, Stage.OPEN)
        seen = self.opened(boss, season)
        Round.objects.filter(pk=other.pk).update(number=3)
        assert self.save(boss, season, seen) == ["season_changed_meanwhile"]
        seen = self.opened(boss, season)
        a_round(season, 4, Stage.OPEN)
        assert self.save(boss, season, seen) == ["season_changed_meanwhile"]
        seen = self.opened(boss, season) | {"points": "[100]"}
        Round.objects.filter(pk=round_.pk).update(closed_at=round_.race.closes_at)
        assert self.save(boss, season, seen) == ["season_changed_meanwhile"]
        season.refresh_from_db()
        assert season.points == [10, 6, 3, 1]

    def test_consequences_of_a_race_do_not_count_as_a_change(self, boss, round_):
        """An hour later more cars have been sent, and another round has become official."""
        season = round_.season
        Round.objects.filter(pk=round_.pk).update(closed_at=round_.race.closes_at)
        other = a_round(season, 2, Stage.OPEN)
        seen = self.opened(boss, season)
        board(other.race, racers(3))
        Round.objects.filter(pk=other.pk).update(closed_at=other.race.closes_at)
        assert self.save(boss, season, seen | {"prizes": "A mug"}) == []

    def test_an_unchanged_form_can_be_saved_repeatedly(self, boss, round_):
        for _ in range(2):
            assert self.save(boss, round_.season, self.opened(boss, round_.season)) == []


def test_a_season_ending_before_its_start_gives_a_readable_error(boss):
    data = {"slug": "x", "name": "X", "starts_on": "2026-02-01", "ends_on": "2026-01-01"}
    data |= {"rounds-TOTAL_FORMS": "0", "rounds-INITIAL_FORMS": "0"}
    page = boss.post(reverse("admin:league_season_add"), data).content.decode()
    assert "The season ends before it starts" in page


def test_an_admin_promotes_a_racer_by_hand(boss, alice):
    season = Season.objects.create(slug="s", name="S", starts_on=date(2026, 1, 1), ends_on=date(2026, 12, 31))
    data = {"season": season.pk, "racer": alice.pk, "division": "pro"}
    assert boss.post(reverse("admin:league_membership_add"), data).status_code == 302
    assert Membership.objects.get().racer == alice
    page = boss.post(reverse("admin:league_membership_add"), data).content.decode()
    assert "already exists" in page
