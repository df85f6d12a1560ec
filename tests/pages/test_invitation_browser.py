"""An invitation is followed in a real browser, whoever opens the link."""

from __future__ import annotations

import pytest
from django.utils import timezone

from races.models import Entry, Race, Visibility
from tests.factories import a_race, a_racer
from tests.pages.browsing import IN_A_BROWSER, chromium, visitor

PASSWORD = "a long enough passphrase"

pytestmark = [*IN_A_BROWSER, pytest.mark.django_db(transaction=True)]


@pytest.fixture
def race() -> Race:
    """A race by invitation with two boxes on the road."""
    return a_race(
        timezone.now(),
        slug="friends",
        name="Among friends",
        organiser=a_racer("host"),
        visibility=Visibility.INVITATION,
        race_type="object_avoidance",
        boxes=[{"fraction": 0.25, "lane": "inner"}, {"fraction": 0.6, "lane": "outer"}],
    )


def joined(race: Race) -> set[str]:
    return set(Entry.objects.filter(race=race).values_list("racer__alias", flat=True))


def test_everybody_who_opens_the_link_joins(race: Race, live_server) -> None:
    """Logged in; a guest who has an account; a guest who signs up: each presses one button of the invitation."""
    link = f"/races/join/{race.invitation}/"
    member = a_racer("member")
    member.set_password(PASSWORD)
    member.save()
    with chromium() as browser:
        page = visitor(browser, live_server.url, a_racer("insider")).new_page()
        page.goto(link)
        page.get_by_role("button", name="Join the race").click()
        page.get_by_text("You have joined.").wait_for()
        assert page.url.endswith(race.get_absolute_url()) and joined(race) == {"insider"}

        page = visitor(browser, live_server.url).new_page()
        page.goto(link)
        page.get_by_role("button", name="Log in and join").click()
        page.get_by_label("Alias or e-mail address").fill("member")
        page.get_by_label("Password").fill(PASSWORD)
        page.get_by_role("main").get_by_role("button", name="Log in").click()
        page.get_by_text("You have joined.").wait_for()
        assert joined(race) == {"insider", "member"}

        page = visitor(browser, live_server.url).new_page()
        page.goto(link)
        page.get_by_role("button", name="Sign up and join").click()
        page.get_by_label("Alias").fill("fresh")
        page.get_by_label("Email").fill("fresh@example.org")
        page.get_by_label("Password", exact=True).fill(PASSWORD)
        page.get_by_label("Password (again)").fill(PASSWORD)
        page.get_by_role("main").get_by_role("button", name="Sign up").click()
        page.get_by_text("You have joined.").wait_for()
        assert joined(race) == {"insider", "member", "fresh"}


def test_the_invitation_shows_the_layout_and_all_its_buttons_work(race: Race, live_server) -> None:
    with chromium() as browser:
        page = visitor(browser, live_server.url).new_page()
        page.goto(f"/races/join/{race.invitation}/")
        card = page.locator(".invite")
        assert card.locator(".track-box").count() == 2
        assert "object avoidance" in card.inner_text() and "2 boxes" in card.inner_text()
        page.get_by_role("button", name="한국어").click()
        page.get_by_text("초대받았습니다").wait_for()
        assert joined(race) == set()
