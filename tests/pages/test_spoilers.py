"""No spoilers: while results are hidden from a reader no page, feed, badge, notice or mail of theirs tells them."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.core import mail
from django.test import Client
from django.urls import URLPattern, get_resolver, reverse
from django.utils import timezone

from accounts.models import Racer
from league.models import Notice
from league.notices import kinds as notice_kinds
from league.notices.selectors import notices_of
from league.notices.services import mark_read, send_mails
from league.notices.writer import NewNotice, notify
from races.models import Entry, LiveEvent, Race, Visibility, WatchedRace
from races.spoilers.hidden_addresses import SCOPES
from races.spoilers.selectors import COOKIE, Spoilers, spoilers_of_racer
from races.spoilers.services import hide_results, note_watched, show_results
from tests.clients import logged_in
from tests.factories import a_race, a_racer, drive, laps
from tests.live_shows import an_ended_show

pytestmark = pytest.mark.django_db

# Pages that show results among other things, and leave hidden ones out.
MASKED = {"home", "races", "race", "race_rules", "model", "models", "notices", "notices_bell", "live_again", "spoilers"}
# What is for who holds a race, runs the site or teaches, and what tells of one's own cars outside races.
NOT_COVERED = {
    *(
        "live_console",
        "race_racers",
        "race_timing",
        "race_invited",
        "workers",
        "failed_runs",
        "classroom",
        "classrooms",
    ),
    *("track", "tracks"),  # their record: a time without a name
    *("own_runs", "own_new", "reports", "report", "report_live", "training", "trainings", "training_live"),
    *("live_speed", "live_plan", "race_close", "race_edit", "race_cancel"),
    # a script of the page that plays it again asks them: places, no result
    *("live_again_data", "live_poses", "live_frames", "live_ghost"),
}


@pytest.fixture
def alice():
    return a_racer("alice")


@pytest.fixture
def now():
    return timezone.now()


def hiding(racer: Racer | None, now) -> Client:
    """A reader who hides results since a day ago."""
    client = logged_in(racer)
    if racer is None:
        client.post("/spoilers/", {"do": "hide"})
    else:
        Racer.objects.filter(pk=racer.pk).update(hides_results_since=now - timedelta(days=1))
        racer.refresh_from_db()
    return client


def a_led_race(now, **fields) -> Race:
    """An open race that zelda leads."""
    race = a_race(now, **({"name": "Night race", "slug": "night-race"} | fields))
    zelda = Racer.objects.filter(alias="zelda").first() or a_racer("zelda")
    drive(race, zelda, laps(9_123, 9_123, 9_123), now)
    return race


def _names(patterns):
    for pattern in patterns:
        if isinstance(pattern, URLPattern):
            if pattern.name:
                yield pattern.name
        elif pattern.namespace != "admin":
            yield from _names(pattern.url_patterns)


def test_what_is_covered_are_addresses_that_there_are():
    names = set(_names(get_resolver().url_patterns))
    assert not SCOPES.keys() - names
    assert not MASKED - names
    assert not SCOPES.keys() & (MASKED | NOT_COVERED)


def test_every_address_of_a_race_a_run_or_a_season_is_decided_on():
    """A new page about one of them is covered, or named here as one that tells nothing."""
    harmless = {
        *("race_duels", "race_draw", "enter", "submit", "withdraw", "race_invitation_reset", "race_racer_remove"),
        "race_spectators_renew",
        *("race_racer_restore", "race_timing_worker", "race_timing_setup", "timekeeper_name", "timekeeper_dismiss"),
        *(
            "sensor_revoke",
            "guest_link",
            "car_choose",
            "lap_correct",
            "live_mine",
            "live_beat",
            "live_panel",
            "live_act",
            "live_react",
        ),
        "live_highlights",
        *("evaluation_stop", "evaluation_video", "own_again", "own_delete", "video_stop"),
        *("season_rules", "season_calendar", "season_calendar_file", "follow", "unfollow"),
        *("season_copy", "season_continues", "season_delete"),  # names of races, for admins
    }
    beginnings = ("races/<slug", "evaluations/<str", "videos/<str", "seasons/<slug", "racers/<str")
    found = {
        pattern.name
        for entry in get_resolver().url_patterns
        if not isinstance(entry, URLPattern) and str(entry.pattern) == ""
        for pattern in entry.url_patterns
        if isinstance(pattern, URLPattern) and str(pattern.pattern).startswith(beginnings)
    }
    assert not found - SCOPES.keys() - MASKED - NOT_COVERED - harmless


def test_pages_of_a_hidden_race_tell_nothing(now):
    race = a_led_race(now)
    run = Entry.objects.get(race=race).best.evaluation
    told = [
        *("/", "/races/", "/races/night-race/", "/races/night-race/rules/", "/racers/zelda/"),
        *(f"/races/night-race/{name}" for name in ("board.csv", "board.json", "board.atom", "badge.svg")),
        *(f"/evaluations/{run.public_id}/", f"/evaluations/{run.public_id}/trace.csv"),
    ]
    for reader in (None, a_racer("bob")):
        shown = logged_in(reader)
        seen = [address for address in told if "9.123" in shown.get(address).content.decode()]
        assert {"/", "/races/", "/races/night-race/"} <= set(seen)
        client = hiding(reader, now)
        for address in told:
            answer = client.get(address)
            text = answer.content.decode()
            assert "9.123" not in text, address
            assert "9123" not in text, address
            assert answer.status_code in (200, 403), address
        assert "Results are hidden" in client.get("/races/night-race/").content.decode()
        client.post("/spoilers/", {"do": "watched", "race": "night-race", "next": "/races/night-race/"})
        assert "9.123" in client.get("/races/night-race/").content.decode()
        assert "9.123" in client.get("/").content.decode()


def test_one_page_is_shown_all_the_same(now):
    a_led_race(now)
    client = hiding(a_racer("bob"), now)
    assert "9.123" in client.get("/races/night-race/?spoilers=show").content.decode()
    assert "9.123" not in client.get("/races/night-race/").content.decode()


def test_programs_ask_for_it(now):
    a_led_race(now)
    client = logged_in(None)
    assert client.get("/races/night-race/board.json").status_code == 200
    assert client.get("/races/night-race/board.json?spoilers=hide").json()["code"] == "results_hidden"
    assert client.get("/api/v1/races/night-race/board/").status_code == 200
    answer = client.get("/api/v1/races/night-race/board/", headers={"X-Paddock-Spoilers": "hide"})
    assert (answer.status_code, answer.json()["code"]) == (403, "results_hidden")
    feed = client.get("/races/night-race/board.atom?spoilers=hide").content.decode()
    assert "zelda" not in feed
    badge = client.get("/races/night-race/badge.svg?spoilers=hide").content.decode()
    assert "hidden" in badge
    assert "zelda" not in badge


def test_what_was_over_before_stays_shown(now):
    race = a_led_race(now, opens_at=now - timedelta(days=5), closes_at=now + timedelta(seconds=1))
    bob = a_racer("bob")
    later = now + timedelta(hours=1)
    hide_results(racer=bob, now=later)
    assert Spoilers(bob.hides_results_since, racer=bob, now=later).hidden == frozenset()
    assert race.pk in Spoilers(now - timedelta(days=1), now=later).hidden


def test_what_has_not_opened_and_what_was_called_off_is_not_hidden(now):
    coming = a_race(now, opens_at=now + timedelta(days=1), closes_at=now + timedelta(days=2))
    off = a_race(now, cancelled_at=now, cancel_reason="rain")
    hidden = Spoilers(now - timedelta(days=3), now=now).hidden
    assert coming.pk not in hidden
    assert off.pk not in hidden


def test_a_live_event_is_hidden_again_after_its_qualifying_was_seen(alice, now):
    bob = a_racer("bob")
    hide_results(racer=bob, now=now - timedelta(days=1))
    race = a_led_race(now, organiser=alice, ranking_method="best", minimum_laps=1)
    note_watched(racer=bob, race=race, now=now)
    assert not spoilers_of_racer(bob).hides(race)
    an_ended_show(now, alice, laps={"carl": (8_000,)}, race=race)
    assert spoilers_of_racer(bob).hides(race)
    note_watched(racer=bob, race=race, now=now)
    assert not spoilers_of_racer(bob).hides(race)
    assert WatchedRace.objects.count() == 1


def test_the_switch_off_shows_all_and_keeps_what_was_watched(now):
    race, bob = a_led_race(now), a_racer("bob")
    hide_results(racer=bob, now=now - timedelta(days=1))
    note_watched(racer=bob, race=race, now=now)
    show_results(racer=bob)
    assert not spoilers_of_racer(bob).on
    hide_results(racer=bob, now=now - timedelta(days=1))
    assert not spoilers_of_racer(bob).hides(race)


def told_of(race: Race, racer: Racer, now) -> Notice:
    params = {"race": race.name, "leader": "zelda"}
    notify(NewNotice(notice_kinds.LOST_LEAD, "x", [racer.pk], race.get_absolute_url(), params), now)
    return Notice.objects.get(racer=racer, kind=notice_kinds.LOST_LEAD)


def test_notices_and_their_number_wait(now):
    race, bob = a_led_race(now), a_racer("bob")
    told_of(race, bob, now)
    notify(NewNotice(notice_kinds.OPENS, "o", [bob.pk], race.get_absolute_url(), {"race": race.name}), now)
    client = hiding(bob, now)
    assert [one.kind for one in notices_of(bob)] == [notice_kinds.OPENS]
    assert "zelda" not in client.get("/notices/").content.decode()
    assert '<span class="bell-count">1<' in client.get("/notices/").content.decode()
    mark_read(racer=bob, now=now)
    note_watched(racer=bob, race=race, now=now)
    assert '<span class="bell-count">1<' in client.get("/notices/").content.decode()
    assert "zelda" in client.get("/notices/").content.decode()


def test_a_mail_says_only_that_there_is_news(now):
    from allauth.account.models import EmailAddress

    race, bob = a_led_race(now), a_racer("bob")
    EmailAddress.objects.create(user=bob, email=bob.email, verified=True, primary=True)
    hiding(bob, now)
    told_of(race, bob, now)
    send_mails(now=now)
    [sent] = mail.outbox
    assert "zelda" not in sent.subject + sent.body
    assert "Night race" in sent.subject


def test_a_private_race_is_not_named_to_strangers(alice, now):
    race = a_led_race(now, organiser=alice, name="Secret race")
    Race.objects.update(visibility=Visibility.INVITATION)
    for reader in (None, a_racer("mallory")):
        client = hiding(reader, now)
        for address in ("/races/night-race/", "/races/night-race/board.json", "/racers/zelda/", "/spoilers/"):
            answer = client.get(address)
            assert "Secret race" not in answer.content.decode(), address
        assert client.post("/spoilers/", {"do": "watched", "race": race.slug}).status_code == 404
    stella = a_racer("stella", is_staff=True)
    for reader in (alice, stella, Racer.objects.get(alias="zelda")):
        assert "Secret race" in hiding(reader, now).get("/spoilers/").content.decode()


@pytest.mark.parametrize("cookie", ["", "x", "[1,[]]:forged", "[1e99,[[1,1]]]:x", "null"])
def test_a_forged_cookie_hides_nothing_and_breaks_nothing(cookie, now):
    a_led_race(now)
    client = logged_in(None)
    client.cookies[COOKIE] = cookie
    assert "9.123" in client.get("/races/night-race/").content.decode()


def test_a_guest_turns_it_off_again(now):
    a_led_race(now)
    client = hiding(None, now)
    assert "9.123" not in client.get("/").content.decode()
    client.post("/spoilers/", {"do": "show"})
    assert "9.123" in client.get("/").content.decode()


def test_the_way_back_leads_nowhere_else(now):
    answer = logged_in(None).post("/spoilers/", {"do": "hide", "next": "https://evil.example/"})
    assert answer.url == "/spoilers/"


def test_watching_again_tells_nothing_by_itself_and_everything_to_its_script(alice, now):
    event = an_ended_show(now, alice)
    client = hiding(None, now)
    assert client.get(reverse("live_event", args=[event.race.slug])).content.decode().count("0:08.000") == 0
    page = client.get(reverse("live_again", args=[event.race.slug]))
    assert "carl" not in page.content.decode()
    told = client.get(reverse("live_again_data", args=[event.race.slug])).json()
    assert [step["state"]["current"]["racer"] for step in told["steps"]] == ["bob", "carl", "dora"]
    leaders = [step["after"]["standings"][0]["racer"] for step in told["steps"]]
    assert leaders == ["bob", "carl", "carl"]
    assert told["steps"][0]["state"]["standings"][0]["rank"] is None
    assert all(step["state"]["podium"] == [] and step["state"]["winner"] is None for step in told["steps"])
    assert told["steps"][1]["state"]["leader"]["racer"] == "bob"


def test_an_event_that_has_not_ended_is_not_watched_again(alice, now):
    event = an_ended_show(now, alice, end=False)
    assert logged_in(None).get(reverse("live_again_data", args=[event.race.slug])).status_code == 404
    assert logged_in(None).get(reverse("live_again", args=[event.race.slug])).status_code == 302
    Race.objects.update(visibility=Visibility.INVITATION)
    LiveEvent.objects.update(state="ended", ended_at=now)
    assert logged_in(None).get(reverse("live_again", args=[event.race.slug])).status_code == 404
    assert logged_in(a_racer("mallory")).get(reverse("live_again_data", args=[event.race.slug])).status_code == 404
