"""Nobody without a car stands before a dead end: three ways wherever one is asked for, and steps that tick themselves
off."""

from __future__ import annotations

import html
import re
from datetime import timedelta

import pytest
from django.utils import timezone

from accounts.class_accounts.services import add_learners, make_class
from accounts.models import Racer
from races.entries.services.entries import withdraw
from races.models import Race
from tests.clients import logged_in
from tests.factories import a_model, a_race, a_racer, drive, laps
from tests.pages.conftest import World
from tests.pages.test_queries import LIMIT, queries
from training.models import JobState, TrainingJob
from training.starter_training.services import train_first_car
from training.trainer.network import NetworkLayout

pytestmark = [pytest.mark.django_db, pytest.mark.usefixtures("trainings_taken_on", "wakes")]


@pytest.fixture
def now():
    return timezone.now()


@pytest.fixture
def beginners(now) -> Race:
    """The house's race for first cars, among others that are less like it."""
    house = a_racer("Paddock", is_house=True)
    easy = {"ranking_method": "best", "minimum_laps": 1}
    a_race(now, name="Somebody's", closes_at=now + timedelta(days=1), **easy)
    a_race(now, name="The other way", organiser=house, direction="cw", **easy)
    a_race(now, name="Boxes", organiser=house, race_type="object_avoidance", random_boxes=2, **easy)
    a_race(now, name="Three laps", organiser=house)
    return a_race(now, name="First laps", organiser=house, **easy)


@pytest.fixture
def house_car(now):
    """A car of the house whose weights can be learned on here."""
    model = a_model(a_racer("house-steady", is_house=True), name="Steady")
    model.network.parameters = NetworkLayout.of(model.metadata).parameters
    model.network.save()
    return model


def read(racer: Racer, path: str) -> str:
    response = logged_in(racer).get(path)
    assert response.status_code == 200
    return html.unescape(response.content.decode())


def words(page: str) -> str:
    return " ".join(re.sub(r"<[^>]*>", " ", page).split())


def test_one_click_trains_a_first_car_for_the_beginners_race(beginners, now):
    alice = a_racer("alice")
    response = logged_in(alice).post("/train/first/", follow=True)
    job = TrainingJob.objects.get(owner=alice)
    assert response.redirect_chain == [(job.get_absolute_url(), 302)]
    assert "It is submitted to First laps when done." in response.content.decode()
    assert (job.submit_to_race, job.track.slug, job.sensors) == (beginners, "oval", ["FRONT_FACING_CAMERA"])
    assert (job.name, job.stop_clean_laps, job.state) == ("first-car", 3, JobState.QUEUED)


def test_a_second_click_leads_to_the_first_car(beginners):
    alice = a_racer("alice")
    for _ in range(2):
        logged_in(alice).post("/train/first/")
    job = TrainingJob.objects.get(owner=alice)
    assert f'href="{job.get_absolute_url()}">Watch the training of your first car' in read(alice, "/")


def test_a_later_first_car_takes_a_free_name(beginners, now):
    alice = a_racer("alice")
    a_model(alice, name="first-car")
    assert train_first_car(owner=alice, now=now).name == "first-car-2"


def test_a_first_car_is_trained_even_without_a_beginners_race(now):
    alice = a_racer("alice")
    a_race(now, direction="cw")
    logged_in(alice).post("/train/first/")
    assert TrainingJob.objects.get(owner=alice).submit_to_race is None


def test_a_race_the_racer_has_left_is_not_chosen(beginners, now):
    alice = a_racer("alice")
    withdraw(entry=drive(beginners, alice, laps(9_000, 9_000, 9_000), now).entry, now=now)
    assert train_first_car(owner=alice, now=now).submit_to_race.name == "Three laps"


def test_without_training_only_uploading_is_offered(beginners, settings, house_car):
    settings.TRAINING_PAUSED = True
    alice = a_racer("alice")
    response = logged_in(alice).post("/train/first/", follow=True)
    assert "training_paused" in response.content.decode() and not TrainingJob.objects.exists()
    page = read(alice, "/models/")
    assert "/train/first/" not in page and "?clone=" not in page and "/models/upload/" in page


def test_logging_in_leads_back_to_the_button(client):
    assert client.post("/train/first/").status_code == 302
    assert logged_in(a_racer("alice")).get("/train/first/").url == "/train/"


@pytest.mark.parametrize("path", ["/", "/models/", "/train/", "/races/{race}/"])
def test_a_racer_without_a_car_is_offered_three_ways_everywhere(beginners, house_car, path):
    page = read(a_racer("alice"), path.format(race=beginners.slug))
    assert "/models/upload/" in page
    assert re.search(r'<form method="post" action="/train/first/">.*?Train my first car', page, re.S)
    assert "then on the board of First laps within a minute" in page
    assert re.search(rf'href="/train/new/\?clone={house_car.public_id}[^"]*">Steady</a>', page)


def test_the_upload_page_offers_the_two_other_ways(beginners, house_car):
    page = read(a_racer("alice"), "/models/upload/")
    assert "Train my first car" in page and f"?clone={house_car.public_id}" in page


def test_a_race_passes_its_own_layout_to_the_training_wizard(now, house_car):
    boxes = a_race(now, direction="cw", race_type="object_avoidance", random_boxes=2)
    alice = a_racer("alice")
    page = read(alice, f"/races/{boxes.slug}/")
    query = f"track=oval&direction=cw&submit_to_race={boxes.slug}&race_type=object_avoidance&random_boxes=2"
    assert f'href="/train/new/?{query}">Train one for this race' in page
    wizard = read(alice, f"/train/new/?{query}")
    assert re.search(rf'<option value="{boxes.slug}"[^>]* selected', wizard)


def test_a_racer_who_sent_every_car_may_train_or_upload_another(now, house_car):
    race, alice = a_race(now), a_racer("alice")
    drive(race, alice, laps(9_000, 9_000, 9_000), now)
    page = read(alice, f"/races/{race.slug}/")
    assert '<a class="button" href="#send">Train or upload another</a>' in page
    assert "Train or upload another" in page and "Train one for this race" in page
    assert (
        "Upload another model" in page and "Train my first car" not in page and f"?clone={house_car.public_id}" in page
    )


def test_the_button_first_offers_a_car_not_yet_sent(now):
    race, alice = a_race(now), a_racer("alice")
    a_model(alice)
    page = read(alice, f"/races/{race.slug}/")
    assert '<a class="button" href="#send">Submit a car</a>' in page and "Train one for this race" in page


def test_the_first_steps_tick_themselves_off_and_disappear(now, beginners):
    alice = a_racer("alice")

    def steps() -> tuple[str, list[bool]]:
        page = read(alice, "/")
        found = re.search(r'id="steps".*?</section>', page, re.S)
        if not found:
            return "", []
        return re.search(r"\d of 4 done", found[0])[0], [
            kind == "done" for kind in re.findall(r'<li class="(\w*)">', found[0])
        ]

    assert steps() == ("0 of 4 done", [False, False, False, False])
    car = a_model(alice)
    assert steps() == ("1 of 4 done", [True, False, False, False])
    assert car.get_absolute_url() in read(alice, "/")
    race = a_race(now)
    drive(race, alice, laps(9_000), now)
    assert steps() == ("2 of 4 done", [True, True, False, False])
    drive(race, alice, laps(9_000, 9_000, 9_000), now)
    assert steps() == ("3 of 4 done", [True, True, True, False])
    league = a_race(now, kind="league", division="all", name="January")
    assert "January" in words(re.search(r'id="steps".*?</section>', read(alice, "/"), re.S)[0])
    drive(league, alice, laps(9_000, 9_000, 9_000), now)
    assert steps() == ("", [])


def test_an_experienced_racer_sees_no_first_steps_but_all_ways(now, beginners):
    old = a_racer("old", joined_at=now - timedelta(days=200))
    page = read(old, "/")
    assert 'id="steps"' not in page and "Train my first car" in page


def test_a_learner_is_not_sent_to_races_that_refuse_class_accounts(now, beginners):
    classroom = make_class(teacher=a_racer("teacher"), name="RL 101", plan=[], now=now)
    (card,) = add_learners(classroom=classroom, by=classroom.group.leader, names=["Ada"], now=now)
    page = read(card.learner.racer, "/")
    assert 'id="steps"' not in page and "No race is open to you." in page and "Train my first car" in page


@pytest.mark.parametrize("path", ["/", "/models/", "/train/", "/races/open-race/"])
def test_the_ways_to_get_a_car_need_few_queries(world: World, path):
    sent = queries(world.client("newcomer"), path)
    assert len(sent) <= LIMIT, "\n".join(sent)
