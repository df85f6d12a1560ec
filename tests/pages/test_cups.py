"""Pages of the cup of the day, as a guest and as a racer."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.urls import reverse

from league.models import Cup, CupDivision, CupPlace, CupStarter
from tests.factories import a_model, a_race, a_racer
from tests.pages.test_queries import FEW, queries

pytestmark = pytest.mark.django_db


def a_cup(now, **fields) -> Cup:
    race = a_race(now, opens_at=now - timedelta(minutes=5), closes_at=now + timedelta(minutes=10))
    return Cup.objects.create(day=now.date(), race=race, **fields)


@pytest.fixture
def real_now():
    from django.utils import timezone

    return timezone.now()


def test_the_cup_under_way_is_shown_with_its_clock_also_on_the_first_page(client, real_now):
    cup = a_cup(real_now)
    for page in (reverse("cups"), reverse("home")):
        shown = client.get(page).content.decode()
        assert cup.get_absolute_url() in shown and "qualifying" in shown


def test_a_cup_that_is_over_names_its_winners_and_what_they_did(client, real_now):
    cup, won, second = a_cup(real_now, drawn_at=real_now, over_at=real_now), a_racer("won"), a_racer("second")
    CupDivision.objects.create(cup=cup, number=1, race=a_race(real_now))
    CupPlace.objects.create(cup=cup, division=1, racer=won, place=1, qualified=2)
    CupPlace.objects.create(cup=cup, division=1, racer=second, place=2, qualified=1)
    shown = client.get(cup.get_absolute_url()).content.decode()
    assert shown.index("won") < shown.index("second")
    assert "won gained 1 place over qualifying" in shown
    assert "won" in client.get(reverse("cups")).content.decode()
    assert cup.get_absolute_url() in client.get(won.get_absolute_url()).content.decode()


def test_a_cup_that_is_over_costs_as_many_queries_whoever_raced(client, real_now, django_assert_max_num_queries):
    cup = a_cup(real_now, drawn_at=real_now, over_at=real_now)
    for number in range(1, 13):
        CupPlace.objects.create(cup=cup, division=1, racer=a_racer(), place=number, qualified=number)
    with django_assert_max_num_queries(15):
        client.get(cup.get_absolute_url())


def test_pages_of_cups_need_few_queries_for_any_number(client, real_now, wakes):
    racer = a_racer()
    client.force_login(racer)
    CupStarter.objects.create(racer=racer, model=a_model(racer), since=real_now)
    a_cup(real_now)
    sent = {}
    for days in range(1, 4):
        race = a_race(
            real_now, opens_at=real_now - timedelta(days=days, hours=1), closes_at=real_now - timedelta(days=days)
        )
        over = Cup.objects.create(day=race.opens_at.date(), race=race, drawn_at=real_now, over_at=real_now)
        for place in range(1, 4):
            CupPlace.objects.create(cup=over, division=1, racer=a_racer(), place=place, qualified=place)
        for page in (reverse("cups"), over.get_absolute_url()):
            sent[days, page == reverse("cups")] = len(queries(client, page))
    assert max(sent.values()) <= FEW and len({(is_list, count) for (_days, is_list), count in sent.items()}) == 2


@pytest.mark.parametrize("day", ["2026-13-01", "tomorrow", "2020-01-01"])
def test_a_day_without_a_cup_is_not_there(client, day):
    assert client.get(reverse("cup", args=[day])).status_code == 404


def test_a_racer_chooses_a_car_that_starts_by_itself_and_none(client):
    racer = a_racer()
    model = a_model(racer)
    client.force_login(racer)
    client.post(reverse("cup_starter"), {"model": model.public_id})
    assert CupStarter.objects.get().model == model
    assert "selected" in client.get(reverse("cups")).content.decode()
    client.post(reverse("cup_starter"), {"model": ""})
    assert not CupStarter.objects.exists()


def test_the_car_of_somebody_else_is_not_there(client):
    client.force_login(a_racer())
    assert client.post(reverse("cup_starter"), {"model": a_model(a_racer()).public_id}).status_code == 404
    assert not CupStarter.objects.exists()
