"""Nothing that a guest may not see is in a card, a tag, an embedded page, oEmbed or a site map, whoever asks."""

from __future__ import annotations

from urllib.parse import quote

import pytest
from django.conf import settings
from django.test import Client
from django.utils import timezone

from accounts.models import ClassLearner, Classroom, Racer, RacerGroup
from config.sharing.sitemaps import site_maps
from core.cards.registry import card_kinds
from races.entries.services.entries import accept_invitation, withdraw
from races.models import Race, Redrive, Visibility
from tests.clients import logged_in
from tests.factories import a_race, a_racer, drive, laps
from tests.live_shows import a_live_race, a_show, begun, compute, slot_of

pytestmark = pytest.mark.django_db
NOTHING: dict[str, set[str]] = {name: set() for name in ("guest", "stranger", "member", "owner", "staff")}


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture
def clients() -> dict[str, Client]:
    racers = {name: a_racer(name) for name in ("stranger", "member", "owner")}
    racers["staff"] = a_racer("staff", is_staff=True, is_superuser=True)
    return {"guest": Client()} | {name: logged_in(racer) for name, racer in racers.items()}


def site_map_text() -> str:
    """All site maps in one."""
    parts = (
        f"/sitemap-{name}.xml?p={number}" for name, one in site_maps().items() for number in one.paginator.page_range
    )
    return "".join(Client().get(page).content.decode() for page in ("/sitemap.xml", *parts))


def are_shared(clients: dict[str, Client], kind: str, key: str) -> dict[str, set[str]]:
    """The parts that show something of a page, by reader."""
    page = card_kinds()[kind].address(key)
    asked = {
        "card": f"/cards/en/{kind}/{key}.png",
        "hidden card": f"/cards/ko/{kind}/{key}.png?spoilers=hide",
        "embedded": f"/embed/{kind}/{key}/",
        "oembed": f"/oembed/?url={quote(settings.SITE_URL + page)}",
    }
    mapped = {"site map"} if page in site_map_text() else set()
    found = {}
    for reader, client in clients.items():
        found[reader] = {name for name, address in asked.items() if client.get(address).status_code != 404} | mapped
        answer = client.get(page)
        if answer.status_code == 200 and (b"og:" in answer.content or b"/oembed/" in answer.content):
            found[reader].add("tags")
    return found


def the_member() -> Racer:
    return Racer.objects.get(alias="member")


def in_private_race(now) -> Race:
    """A race by invitation that the member has joined and leads."""
    race = a_race(now, name="Hush", slug="hush", visibility=Visibility.INVITATION)
    accept_invitation(token=race.invitation, racer=the_member(), now=now)
    drive(race, the_member(), laps(9_123, 9_223, 9_323), now)
    return race


def run_of(race: Race, racer) -> str:
    return race.entries.get(racer=racer).best.evaluation.public_id


class TestWhoever:
    def test_a_race_by_invitation_and_its_runs_are_not_shared(self, clients, now):
        race = in_private_race(now)
        assert clients["member"].get("/races/hush/").status_code == 200
        assert are_shared(clients, "race", "hush") == NOTHING
        assert are_shared(clients, "run", run_of(race, the_member())) == NOTHING
        assert "hush" not in site_map_text()

    def test_a_live_event_by_invitation_is_not_shared(self, clients, now):
        race = a_live_race(now, a_racer("host"), slug="hush", visibility=Visibility.INVITATION)
        a_show(now, race.organiser, [], race=race)
        assert are_shared(clients, "live", "hush") == NOTHING

    def test_a_sealed_run_is_not_shared_before_it_is_shown(self, clients, now):
        host = a_racer("host")
        show = begun(a_show(now, host, ["ann"], race=a_live_race(now, host, slug="night")), host, now)
        run = compute(slot_of(show, "ann"), now, 13_457, 12_861)
        assert are_shared(clients, "run", run.public_id) == NOTHING
        for kind in ("race", "live"):
            assert "12.861" not in repr(card_kinds()[kind].card("night", False))
        assert run.public_id not in site_map_text()
        for reader, client in clients.items():
            assert "12.861" not in client.get("/embed/race/night/").content.decode(), reader

    def test_a_run_that_is_not_on_the_board_is_not_shared(self, clients, now):
        race, member = a_race(now, slug="open"), the_member()
        worse = drive(race, member, laps(9_900, 9_900, 9_900), now).evaluation.public_id
        drive(race, member, laps(9_100, 9_100, 9_100), now)
        assert are_shared(clients, "run", worse) == NOTHING
        assert all("card" in parts for parts in are_shared(clients, "run", run_of(race, member)).values())

    def test_a_run_of_a_withdrawn_entry_is_shared_no_more(self, clients, now):
        race, member = a_race(now, slug="open"), the_member()
        run = drive(race, member, laps(9_100, 9_100, 9_100), now).evaluation.public_id
        assert all("card" in parts for parts in are_shared(clients, "run", run).values())
        withdraw(entry=race.entries.get(), now=now)
        assert are_shared(clients, "run", run) == NOTHING
        assert "member" not in repr(card_kinds()["race"].card("open", False))

    def test_a_run_that_is_driven_again_is_not_shared_before_it_counts(self, clients, now):
        race, member = a_race(now, slug="open"), the_member()
        again = drive(race, member, laps(9_100, 9_100, 9_100), now)
        Redrive.objects.create(submission=again, evaluation=again.evaluation, engine="next")
        assert are_shared(clients, "run", again.evaluation.public_id) == NOTHING

    def test_a_pupil_is_not_shared(self, clients, now):
        pupil, group = a_racer("pupil"), RacerGroup.objects.create(slug="7c", name="7c", made_at=now)
        room = Classroom.objects.create(group=group, made_at=now)
        ClassLearner.objects.create(racer=pupil, classroom=room, real_name="Pat Real")
        assert are_shared(clients, "racer", "pupil") == NOTHING

    def test_a_racer_has_no_private_races_in_the_card(self, clients, now):
        in_private_race(now)
        shown = card_kinds()["racer"].card("member", False)
        assert shown.figures == () and shown.picture == ()
        for reader, client in clients.items():
            assert client.get("/cards/en/racer/member.png").status_code == 200, reader
