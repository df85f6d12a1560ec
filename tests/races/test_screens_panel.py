"""The console's panel of screens, their lamps, and the podium of the big screen."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.core.cache import cache
from django.test import Client
from django.utils import timezone

from accounts.models import Racer
from races.live.services import end_live, show_podium
from races.live.views.screens import OVERLAYS, SCREENS
from races.models import LiveEvent, Race, Visibility
from races.web.spectator_links import spectator_token
from tests.clients import logged_in
from tests.live_shows import a_live_race, a_show, an_ended_show

pytestmark = pytest.mark.django_db


@pytest.fixture(autouse=True)
def _alone(wakes: list[dict]) -> None:
    cache.clear()


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture
def event(alice, now) -> LiveEvent:
    return a_show(now, alice, ["bob", "carl"])


def lamps(client: Client, event: LiveEvent) -> list[bool]:
    answer = client.get(f"/races/{event.race.slug}/event/console/")
    assert answer.status_code == 200
    return [row["is_connected"] for row in answer.context["screens"]]


def test_the_console_lists_every_screen_with_address_size_and_code(alice, event):
    page = logged_in(alice).get(f"/races/{event.race.slug}/event/console/")
    text, base = page.content.decode(), f"http://testserver/races/{event.race.slug}/live"
    for address in (f"{base}/screen/", f"{base}/phone/", *(f"{base}/overlay/{piece}/" for piece in OVERLAYS)):
        assert f'href="{address}"' in text and Client().get(address).status_code == 200
    assert "1920 × 1080" in text and "480 × 800" in text
    assert text.count('class="qr"') == len(SCREENS)


def test_the_screens_of_a_race_by_invitation_open_with_the_spectators_link(alice, event):
    Race.objects.filter(pk=event.race_id).update(visibility=Visibility.INVITATION)
    race = Race.objects.get(pk=event.race_id)
    page = logged_in(alice).get(f"/races/{race.slug}/live/panel/")
    assert page.status_code == 200 and f"/watch/{spectator_token(race)}/screen/" in page.content.decode()
    for row in page.context["screens"]:
        assert Client().get(row["address"], follow=True).status_code == 200, row["name"]


def test_a_lamp_is_lit_while_its_screen_tells_that_it_is_there(alice, event):
    client, address = logged_in(alice), f"/races/{event.race.slug}/live/beat/"
    assert not any(lamps(client, event))
    assert Client().get(address, {"screen": "overlay/tower"}).status_code == 204
    names = list(SCREENS)
    assert [name for name, lit in zip(names, lamps(client, event), strict=True) if lit] == ["overlay/tower"]
    assert Client().get(address, {"screen": "nonsense"}).status_code == 404
    cache.clear()
    assert not any(lamps(client, event))


def test_only_who_watches_lights_a_lamp_and_only_organisers_see_the_panel(alice, bob, event):
    Race.objects.filter(pk=event.race_id).update(visibility=Visibility.INVITATION)
    assert Client().get(f"/races/{event.race.slug}/live/beat/", {"screen": "screen"}).status_code == 404
    assert logged_in(bob).get(f"/races/{event.race.slug}/live/panel/").status_code == 404
    assert Client().get(f"/races/{event.race.slug}/live/panel/").status_code == 302


def test_the_podium_shows_prize_picture_team_and_car(alice, now):
    race = a_live_race(now, alice, prize="A helmet")
    event = an_ended_show(now, alice, race=race, end=False)
    address = f"/races/{race.slug}/live/screen/"
    assert 'class="podium-picture"' not in Client().get(address).content.decode(), "nothing of it before it is shown"
    Racer.objects.filter(alias="carl").update(team="Rockets")
    end_live(event=event, by=alice, seen=None, now=timezone.now() + timedelta(hours=1))
    show_podium(event=event, by=alice, seen=None, now=timezone.now() + timedelta(hours=1))
    text = Client().get(address).content.decode()
    assert "A helmet" in text and "Rockets" in text
    assert text.count('class="podium-picture"') == text.count('class="podium-car"') == 3
    assert text.index("carl") < text.index("dora")
