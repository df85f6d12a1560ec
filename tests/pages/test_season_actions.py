"""What admins do with a whole season: copy, stop, continue, replace, delete."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest
from django.contrib.admin.models import LogEntry
from django.test import Client
from django.urls import reverse

from accounts.models import Racer
from league.models import Round, Season, Stage
from league.seasons.selectors import current_season
from league.seasons.services.clock import tick
from league.seasons.services.seasons import create_season
from races.entries.services.entries import enter_race
from races.models import Race
from races.pages.services import cancel_race
from tests.clients import logged_in
from tests.factories import a_racer, a_track
from tests.league.seasons import JANUARY, MONTH, a_round, a_season
from tests.pages.test_season_making import form_data, make
from tests.soak import only

pytestmark = pytest.mark.django_db
NOW = datetime(2026, 11, 15, 12, tzinfo=UTC)
A_DAY = timedelta(days=1)


@pytest.fixture(autouse=True)
def _alone(wakes: list[dict], monkeypatch: pytest.MonkeyPatch) -> None:
    """No broker, and it is November 2026 for every view."""
    monkeypatch.setattr("django.utils.timezone.now", lambda: NOW)


@pytest.fixture
def boss() -> Racer:
    return a_racer("boss", is_staff=True, is_superuser=True)


@pytest.fixture
def client(boss: Racer) -> Client:
    return logged_in(boss)


@pytest.fixture
def season() -> Season:
    """January's open and pro race of 2027, which nobody has entered."""
    season = a_season()
    a_round(season, 1, "open-qualifier", slug="2027-01-open")
    a_round(season, 1, "pro-qualifier", slug="2027-01-pro")
    return season


def short(**changes: object) -> dict[str, object]:
    a_track()
    unused = {f"{kind}_{place}": "" for kind in ("open", "pro") for place in range(4, 13)}
    return form_data(NOW) | unused | changes


def test_an_admin_copies_a_season_with_one_button(client, season):
    page = client.get(season.get_absolute_url()).content.decode()
    assert reverse("season_copy", args=[season.slug]) in page
    answer = client.post(reverse("season_copy", args=[season.slug]), {"months": "", "name": "", "slug": ""})
    copy = Season.objects.get(slug="2028")
    assert answer["Location"] == copy.get_absolute_url() and copy.follows == season
    assert sorted(copy.rounds.values_list("race__slug", flat=True)) == ["2028-01-open", "2028-01-pro"]
    assert LogEntry.objects.filter(change_message__contains="Copied from 2027").exists()
    refused = client.post(reverse("season_copy", args=[season.slug]), {"months": "24", "slug": "NEW"})
    assert refused.status_code == 422 and "belongs to a page" in refused.content.decode()


def test_others_neither_copy_nor_delete_nor_stop_a_season(season):
    for client in (logged_in(a_racer()), logged_in(a_racer(is_staff=True))):
        for name in ("season_copy", "season_continues", "season_delete"):
            assert client.post(reverse(name, args=[season.slug]), {}).status_code == 403
        assert "season-admin" not in client.get(season.get_absolute_url()).content.decode()


def test_an_admin_stops_a_season_and_continues_it(client, season):
    path = reverse("season_continues", args=[season.slug])
    client.post(path, {"continues": "0"})
    assert not Season.objects.get().continues
    assert "Ends without a successor" in client.get(season.get_absolute_url()).content.decode()
    client.post(path, {"continues": "1"})
    assert Season.objects.get().continues


def test_deleting_the_draft_stops_the_season_before_it(boss, season, monkeypatch):
    later = JANUARY + 11 * MONTH
    monkeypatch.setattr("django.utils.timezone.now", lambda: later)
    client = logged_in(boss)
    tick(now=later)
    draft = Season.objects.get(follows=season)
    assert "replaces=2028" in client.get(draft.get_absolute_url()).content.decode()
    client.post(reverse("season_delete", args=[draft.slug]))
    tick(now=later)
    assert list(Season.objects.all()) == [season] and Race.objects.count() == 2
    season.refresh_from_db()
    assert not season.continues


def test_an_admin_replaces_the_draft_by_another_season(boss, season, monkeypatch):
    first, later = season, JANUARY + 11 * MONTH
    monkeypatch.setattr("django.utils.timezone.now", lambda: later)
    client = logged_in(boss)
    tick(now=later)
    draft = Season.objects.get(follows=first)
    page = client.get(f"/seasons/new/?replaces={draft.slug}")
    assert page.context["form"]["replaces"].value() == draft.slug
    data = short(replaces=draft.slug, slug=draft.slug, first_month="1", year="2028")
    seen = client.post("/seasons/new/", data)
    assert seen.status_code == 200 and Season.objects.filter(pk=draft.pk).exists(), "a preview deletes nothing"
    client.post("/seasons/new/", data | {"seen": seen.context["form"]["seen"].value(), "do": "make"})
    made = Season.objects.get(follows=first)
    assert made.pk != draft.pk and made.slug == draft.slug
    tick(now=later)
    assert Season.objects.count() == 2


def test_an_unopened_season_and_single_rounds_of_it_can_be_deleted(client, season):
    page = client.get(reverse("season_delete", args=[season.slug])).content.decode()
    assert "Delete the season" in page
    round_ = season.rounds.get(stage=Stage.PRO)
    client.post(reverse("season_delete", args=[season.slug]), {"round": round_.pk})
    assert list(Race.objects.values_list("slug", flat=True)) == ["2027-01-open"]
    client.post(reverse("season_delete", args=[season.slug]))
    assert not Season.objects.exists() and not Race.objects.exists()


def test_the_admin_site_deletes_an_unopened_season_and_gives_a_reason_otherwise(client, season):
    path = reverse("admin:league_season_delete", args=[season.pk])
    enter_race(race=season.rounds.get(stage=Stage.OPEN).race, racer=a_racer(), now=NOW)
    answer = client.post(path, {"post": "yes"}, follow=True)
    assert "has entries and cannot be deleted" in answer.content.decode() and Season.objects.exists()
    client.post(reverse("season_delete", args=[season.slug]), {"round": season.rounds.get(stage=Stage.PRO).pk})
    Race.objects.get().entries.all().delete()
    client.post(path, {"post": "yes"})
    assert not Season.objects.exists() and not Race.objects.exists()


def test_an_opened_round_stays_with_a_reason(boss, season, monkeypatch):
    monkeypatch.setattr("django.utils.timezone.now", lambda: JANUARY)
    client = logged_in(boss)
    answer = client.post(reverse("season_delete", args=[season.slug]))
    assert answer.status_code == 409 and "has opened and cannot be deleted" in answer.content.decode()
    round_ = season.rounds.get(stage=Stage.PRO)
    assert client.post(reverse("season_delete", args=[season.slug]), {"round": round_.pk}).status_code == 409
    assert Round.objects.count() == 2


def test_a_cancelled_season_frees_its_address(client):
    data = short()
    make(client, data)
    season = Season.objects.get()
    for round_ in season.rounds.select_related("race"):
        cancel_race(race=round_.race, reason="Another plan", now=NOW)
    seen = client.post("/seasons/new/", data)
    client.post("/seasons/new/", data | {"seen": seen.context["form"]["seen"].value(), "do": "make"})
    season.refresh_from_db()
    assert season.slug == f"{data['slug']}-cancelled" and Season.objects.get(slug=data["slug"]).rounds.exists()


@pytest.mark.parametrize("slug", only(["now", "NEW"], ["now", "Now", "NEW", "new"]))
def test_reserved_addresses_are_refused_in_the_preview_and_by_their_name(client, slug):
    answer = client.post("/seasons/new/", short(slug=slug))
    assert answer.status_code == 422
    assert answer.context["form"].errors.as_data()["slug"][0].code == "season_address_reserved"
    assert client.post("/api/v1/seasons/", {}).status_code in (400, 401, 403, 415)


def test_an_address_is_taken_in_capital_letters_too(client, season):
    Season.objects.filter(pk=season.pk).update(slug="spring")
    answer = client.post("/seasons/new/", short(slug="Spring"))
    assert answer.context["form"].errors.as_data()["slug"][0].code == "season_exists"


def test_a_pro_track_without_an_open_race_is_named_in_the_preview(client):
    answer = client.post("/seasons/new/", short(open_2=""))
    page = answer.content.decode()
    assert "February has no open race, so its pro race and finale (Paddock Oval) are left out." in page
    assert "January has no open race" not in page


@pytest.mark.parametrize("field", ["open_1", "pro_1", "direction_1", "championship_turn_2", "replaces"])
def test_every_refused_field_of_the_form_says_so(client, field):
    answer = client.post("/seasons/new/", short(**{field: "nowhere"}))
    assert answer.status_code == 422
    (error,) = answer.context["form"].errors[field]
    assert str(error) in answer.content.decode().replace("&#x27;", "'")


def test_a_season_that_goes_on_is_shown_before_one_that_is_done():
    done, goes_on = a_season(), create_season(slug="2026", name="2026", starts_on=JANUARY.date(), ends_on="2027-12-30")
    Season.objects.filter(pk=goes_on.pk).update(starts_on=(JANUARY - A_DAY).date())
    a_round(done, 1, "open-qualifier")
    a_round(goes_on, 3, "open-qualifier")
    now = JANUARY + 2 * MONTH + A_DAY
    assert current_season(now).slug == "2026"
    assert current_season(JANUARY + A_DAY).slug == "2027"


def test_a_season_of_single_races_explains_no_divisions_and_finales(client):
    season = a_season()
    a_round(season, 1, "single")
    pages = [client.get(f"/seasons/2027/{page}").content.decode() for page in ("", "rules/", "standings/")]
    for page in pages:
        for word in ("promoted", "Finale", "finale", "championship", "Pro division", "Open division"):
            assert word not in page.split("</nav>", 1)[1].split("<footer")[0].replace("season-admin", ""), word
    assert "points" in pages[1]
    rules = client.get("/api/v1/seasons/2027/").json()["rules"]
    assert len(rules) == 2


def test_a_racer_of_an_imported_season_has_raced_since_their_first_race(client, season):
    racer = Racer.objects.create(alias="old-hand", email="x@record.invalid", is_active=False, record_id="abc")
    race = Race.objects.get(slug="2027-01-open")
    Race.objects.filter(pk=race.pk).update(opens_at=datetime(2021, 3, 1, tzinfo=UTC))
    race.entries.create(racer=racer, entered_at=NOW)
    assert "racing since March 2021" in client.get("/racers/old-hand/").content.decode()


def test_the_track_of_a_race_of_the_league_is_no_page_of_the_site():
    a_track()
    season = a_season()
    with pytest.raises(Exception) as refused:
        a_round(season, 1, "single", slug="New")
    assert "race_address_reserved" in {error.code for error in refused.value.errors.error_dict["slug"]}


def test_a_double_click_copies_a_season_once(client, season):
    path = reverse("season_copy", args=[season.slug])
    once = client.get(path).context["once"]
    for _ in range(2):
        assert client.post(path, {"months": "", "name": "", "slug": "", "once": once}).status_code == 302
    assert Season.objects.count() == 2


@pytest.mark.parametrize("by_api", [False, True])
def test_a_refused_deletion_is_not_in_the_audit(client, season, by_api):
    enter_race(race=Race.objects.get(slug="2027-01-open"), racer=a_racer(), now=JANUARY)
    if by_api:
        client.delete(f"/api/v1/seasons/{season.slug}/")
    else:
        assert client.post(reverse("season_delete", args=[season.slug])).status_code == 409
    assert Season.objects.exists()
    assert not LogEntry.objects.filter(change_message__startswith="Deleted").exists()
