"""What somebody tries who wants the league's pages to do what they should not."""

from __future__ import annotations

from collections.abc import Callable
from datetime import timedelta

import pytest
from django.contrib.admin.models import LogEntry
from django.test import Client
from icalendar import Calendar

from accounts.models import Racer
from league.models import Membership, Notice, Round, Season, Stage, Webhook
from league.notices import kinds as notice_kinds
from league.stewarding.official_results import close_round
from league.stewarding.services import disqualify
from league.webhooks.services import add_webhook
from tests.factories import a_racer
from tests.kept import Kept
from tests.league.seasons import HOUR, a_round, a_season, after, board, racers

pytestmark = pytest.mark.django_db
MARK = '<b title="x">&\'evil'


@pytest.fixture(autouse=True)
def _alone(wakes: list[dict]) -> None:
    """No broker."""


@pytest.fixture(scope="session")
def kept_first_race(request: pytest.FixtureRequest, keep: Callable) -> Kept:
    return keep(request, _first)


@pytest.fixture
def first(kept_first_race: Kept, db: None, monkeypatch: pytest.MonkeyPatch, settings) -> Round:
    settings.SESSION_COOKIE_AGE = 10 * 365 * 24 * 3600
    made = kept_first_race.copy()
    monkeypatch.setattr("django.utils.timezone.now", lambda: after(made))
    return made


def _first() -> Round:
    """A season whose first race is official since a minute; its names, reasons and teams are markup."""
    season = a_season(prizes=f"P {MARK}")
    Season.objects.update(name=f"S {MARK}")
    season.refresh_from_db()
    round_ = a_round(season, 1, Stage.OPEN, name=f"R {MARK}", description=f"D {MARK}")
    a_round(season, 2, Stage.PRO, name=f"Q {MARK}")
    Round.objects.update(name=f"M {MARK}")
    field = racers(10)
    Racer.objects.filter(pk=field[0].pk).update(team=f"T {MARK}", country="KR")
    board(round_.race, field)
    now = after(round_)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("django.utils.timezone.now", lambda: now)
        close_round(round=round_, now=now)
        steward = a_racer("steward", is_staff=True)
        disqualify(round=round_, racer=field[9], by=steward, reason=f"Why {MARK}", now=now)
    return Round.objects.select_related("race", "season").get(pk=round_.pk)


def logged_in(racer: Racer, *, csrf: bool = False) -> Client:
    client = Client(enforce_csrf_checks=csrf)
    client.force_login(racer, backend="django.contrib.auth.backends.ModelBackend")
    return client


def addresses(first: Round, alias: str) -> list[str]:
    season, race = first.season.get_absolute_url(), first.race.get_absolute_url()
    pages = ["standings/?of=teams", "standings/", "finales/", "calendar/", "rules/", f"racers/{alias}/"]
    return ["/", "/seasons/", "/hall-of-fame/", race, f"{race}rules/", season, *(season + page for page in pages)]


def test_markup_in_user_text_is_escaped_on_every_page(first):
    leader = Racer.objects.get(round_points__rank=1)
    Notice.objects.create(
        racer=leader, kind=notice_kinds.MESSAGE, about="x", params={"race": MARK, "text": MARK}, at=first.closed_at
    )
    client = logged_in(leader)
    boss = logged_in(a_racer("boss", is_staff=True, is_superuser=True))
    log = ["/admin/league/stewarddecision/", "/admin/league/round/", "/admin/league/season/"]
    seen = 0
    for reader, path in [(client, path) for path in (*addresses(first, leader.alias), "/notices/")] + [
        (boss, path) for path in (*log, first.race.get_absolute_url())
    ]:
        answer = reader.get(path)
        html = answer.content.decode()
        assert answer.status_code == 200, path
        assert "<b title" not in html and "&'evil" not in html, path
        seen += "&lt;b title" in html
    assert seen >= 12, "the marks are on the pages"


def test_a_name_or_reason_cannot_inject_calendar_lines(first):
    race = first.race
    reason = "Rain;, \\ \nEND:VEVENT\r\nBEGIN:VEVENT\nSUMMARY:forged"
    type(race).objects.filter(pk=race.pk).update(cancelled_at=after(first), cancel_reason=reason)
    answer = Client().get(f"{first.season.get_absolute_url()}calendar.ics")
    calendar = Calendar.from_ical(answer.content)
    events = list(calendar.walk("VEVENT"))
    assert len(events) == 2 and "forged" not in [str(event["summary"]) for event in events]
    assert str(events[0]["summary"]) == f"R {MARK}" and str(calendar["x-wr-calname"]) == f"S {MARK}"


class TestViewingChangesNothing:
    def test_every_change_needs_a_post(self, first, alice):
        notice = Notice.objects.create(racer=alice, kind=notice_kinds.OPENS, about="1", at=first.closed_at)
        hook = add_webhook(owner=alice, url="https://example.org/")
        client, race = logged_in(alice), first.race.get_absolute_url()
        for path in (
            *("/notices/read/", f"/notices/{notice.pk}/", f"/settings/webhooks/{hook.pk}/remove/", "/theme/"),
            *(f"{race}enter/", f"{race}submit/"),
        ):
            assert client.get(path).status_code == 405, path
        notice.refresh_from_db()
        assert notice.read_at is None and Webhook.objects.exists()

    def test_an_admin_who_follows_a_link_changes_nothing(self, first):
        boss = logged_in(a_racer("boss", is_staff=True, is_superuser=True))
        race = first.race.get_absolute_url()
        loser = first.race.entries.filter(withdrawn_at=None).first().racer
        before = LogEntry.objects.count(), Membership.objects.count()
        for path in (
            f"/admin/league/round/?action=take_back&_selected_action={first.pk}&step=confirmed&reason=x",
            f"{race}cancel/?reason=x",
            f"{race}racers/{loser.alias}/remove/?reason=x",
            "/seasons/new/?name=x",
        ):
            assert boss.get(path).status_code in (200, 302), path
        first.refresh_from_db()
        assert first.closed_at is not None and first.race.cancelled_at is None
        assert first.race.entries.get(racer=loser).removed_at is None
        assert (LogEntry.objects.count(), Membership.objects.count()) == before and Season.objects.count() == 1

    def test_a_form_from_another_site_is_refused(self, first):
        boss = a_racer("boss", is_staff=True, is_superuser=True)
        hook = add_webhook(owner=boss, url="https://example.org/")
        race = first.race.get_absolute_url()
        client = logged_in(boss, csrf=True)
        for path in (
            *("/seasons/new/", "/settings/notices/", "/settings/webhooks/", f"/settings/webhooks/{hook.pk}/remove/"),
            *("/notices/read/", f"{race}cancel/", f"{race}edit/", "/admin/league/round/"),
        ):
            assert client.post(path, {"reason": "x"}).status_code == 403, path
        assert Webhook.objects.exists()


def test_strangers_and_members_reach_no_steward_or_organiser_page(first, alice):
    race = first.race.get_absolute_url()
    other = first.race.entries.filter(withdrawn_at=None).first().racer
    paths = ["/seasons/new/", f"{race}edit/", f"{race}cancel/", f"{race}racers/", f"{race}racers/{other.alias}/remove/"]
    admin = ["/admin/league/round/", "/admin/league/season/add/", "/admin/admin/logentry/", "/admin/league/membership/"]
    member = logged_in(alice)
    for path in paths:
        assert member.get(path).status_code in (403, 404), path
        assert member.post(path, {"reason": "x"}).status_code in (403, 404, 405), path
        answer = Client().get(path)
        assert answer.status_code in (302, 404) and "/accounts/login/" in answer.get("Location", "/accounts/login/")
    for path in admin:
        for client in (member, Client()):
            assert client.get(path)["Location"].startswith("/admin/login/"), path
            assert client.post(path, {"action": "publish"}).status_code == 302, path
    assert first.race.entries.get(racer=other).removed_at is None


@pytest.mark.parametrize(
    "target", ["https://evil.example/", "//evil.example/", "/\\evil.example", "javascript:alert(1)"]
)
def test_no_form_redirects_to_another_site(first, alice, target):
    client = logged_in(alice)
    for path, data in (
        ("/theme/", {"theme": "dark", "next": target}),
        ("/i18n/setlang/", {"language": "ko", "next": target}),
    ):
        assert "evil" not in client.post(path, data)["Location"] and "script" not in client.post(path, data)["Location"]
    alice.set_password("a long enough passphrase")
    alice.save()
    answer = Client().post(
        "/accounts/login/", {"login": "alice", "password": "a long enough passphrase", "next": target}
    )
    assert answer.status_code == 302 and "evil" not in answer["Location"] and "script" not in answer["Location"]


def test_a_forged_form_cannot_reopen_a_closed_window(first, monkeypatch):
    boss = logged_in(a_racer("boss", is_staff=True, is_superuser=True))
    late = first.closed_at + timedelta(days=9) + HOUR
    monkeypatch.setattr("django.utils.timezone.now", lambda: late)
    before = set(Membership.objects.values_list("racer", flat=True))
    for action in ("disqualify", "put_back", "take_back", "lock"):
        data = {"action": action, "_selected_action": [first.pk], "step": "confirmed", "reason": "x"}
        alias = first.race.entries.filter(withdrawn_at=None).first().racer.alias
        html = boss.post("/admin/league/round/", data | {"racer": alias}, follow=True).content.decode()
        assert "The steward window ended" in html, action
    assert set(Membership.objects.values_list("racer", flat=True)) == before
