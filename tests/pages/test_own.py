"""The pages of one's own runs: the form, the list, the result."""

from __future__ import annotations

import re
from functools import partial

import pytest

from accounts.models import RacerQuota
from evaluation.garage.services import share_model
from paddock.errors import PlatformFault
from races.models import OwnEvaluation, Submission
from races.test_runs.services import drive_own
from tests.factories import a_model, a_race, a_racer, drive, fail, lap, laps
from tests.pages.conftest import World
from tests.pages.test_queries import LIMIT, queries
from tests.races.test_own import finish

FORM = {
    "track": "oval",
    "direction": "ccw",
    "race_type": "time_trial",
    "box_choice": "fixed",
    "laps": "2",
    "ranking_method": "average",
    "minimum_laps": "",
    "off_track_penalty_ms": "2",
    "max_resets": "",
    "max_simulated_ms": "180",
    "seed": "0",
    "start_m": "0",
}
AVOID = {"race_type": "object_avoidance", "collision_penalty_ms": "5"}
HEAD = {"race_type": "head_to_head", "collision_penalty_ms": "5"}


def send(world: World, viewer: str = "alice", at: str = "/runs/new/", **said: str):
    return world.client(viewer).post(at, {**FORM, "model": world.model.public_id, **said})


def test_the_form_drives_what_it_says(world: World) -> None:
    answer = send(world, **AVOID, **{"boxes-1-percent": "30", "boxes-1-lane": "outer"}, start_m="1.5", laps="4")
    own = OwnEvaluation.objects.get()
    assert answer.status_code == 302 and answer["Location"] == own.evaluation.get_absolute_url()
    rules = own.evaluation.spec["rules"]
    assert rules["boxes"] == [{"fraction": 0.3, "lane": "outer"}] and (rules["laps"], rules["start_m"]) == (4, 1.5)
    assert own.minimum_laps == 3, "as many as usual, for the field was left empty"


def test_rivals_drive_along_and_only_among_cars(world: World) -> None:
    rival = a_model(world.bob)
    share_model(model=rival, now=world.now)
    said = {"opponents": "models", "rival_2": rival.public_id}
    send(world, **HEAD, **said)
    assert OwnEvaluation.objects.get().evaluation.rivals.get().model == rival
    send(world, **said)
    assert OwnEvaluation.objects.first().evaluation.rivals.count() == 0, "a time trial has none"


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"model": "nobody"}, "not in your garage or shared"),
        ({**HEAD, "opponents": "models", "rival_1": "nobody"}, "Rival 1 is not in your garage"),
        ({**HEAD, "opponents": "models"}, "Choose one to three cars"),
        ({**AVOID, "boxes-1-percent": "1", "boxes-1-lane": "inner"}, "Box 1 is in the start or finish area"),
        ({**AVOID, "box_choice": "drawn", "random_boxes": "10", "box_distance_m": "20"}, "boxes"),
        ({"start_m": "999"}, "The start must be from 0 m"),
        ({"laps": "21"}, "less than or equal to 20"),
        ({"minimum_laps": "3"}, "at most 2 consecutive laps"),
    ],
)
def test_a_refusal_stands_beside_its_field_and_nothing_is_driven(world: World, said, words: str) -> None:
    answer = send(world, **said)
    assert answer.status_code == 422 and words in answer.content.decode()
    assert not OwnEvaluation.objects.exists()


def test_the_quota_shows_before_it_bites(world: World) -> None:
    RacerQuota.objects.create(racer=world.alice, name="own_runs_at_once", limit=1)
    page = world.client("alice").get("/runs/new/").content.decode()
    assert "Test runs in progress</dt><dd>0 / 1" in page
    send(world)
    page = world.client("alice").get("/runs/new/").content.decode()
    assert 'Test runs in progress</dt><dd class="bad">1 / 1' in page
    answer = send(world)
    assert "own_runs_at_once" in answer.content.decode() and OwnEvaluation.objects.count() == 1


def test_every_door_leads_to_the_form(world: World) -> None:
    client = world.client("alice")
    doors = {
        f"/models/{world.model.public_id}/": f"/runs/new/?model={world.model.public_id}",
        "/models/": f"/runs/new/?model={world.model.public_id}",
        "/tracks/oval/": "/runs/new/?track=oval",
        "/races/open-race/": "/runs/new/?race=open-race",
    }
    for at, door in doors.items():
        assert f'href="{door}"' in client.get(at).content.decode(), at
        assert client.get(door).status_code == 200
    assert world.client("anonymous").get("/runs/new/?track=oval").status_code == 302


def test_as_in_a_race_needs_a_car_alone(world: World) -> None:
    client, at = world.client("alice"), "/runs/new/?race=open-race"
    page = client.get(at).content.decode()
    assert 'name="submit_if_better"' in page and 'name="laps"' not in page
    client.post(at, {"model": world.model.public_id, "submit_if_better": "on"})
    own = OwnEvaluation.objects.get()
    assert own.race == world.race and own.submit_if_better and own.rules.laps == world.race.laps


def test_a_race_that_one_does_not_see_is_not_tried(world: World) -> None:
    answer = world.client("bob").get(f"/runs/new/?race={world.secret.slug}", follow=True)
    assert "own_race_gone" in answer.content.decode()


def test_rules_of_a_race_and_of_a_run_are_taken_over_to_be_changed(world: World) -> None:
    race = a_race(world.now, laps=9, minimum_laps=4, random_boxes=3, race_type="object_avoidance")
    page = world.client("alice").get(f"/runs/new/?like={race.slug}").content.decode()
    assert re.search(r'name="laps" value="9"', page) and re.search(r'name="random_boxes" value="3"', page)
    own = drive_own(owner=world.alice, model=world.model, track=world.track, now=world.now, laps=7, start_m=2.0)
    page = world.client("alice").get(f"/runs/new/?run={own.evaluation.public_id}").content.decode()
    assert re.search(r'name="laps" value="7"', page) and re.search(r'name="start_m" value="2"', page)
    stranger = world.client("bob").get(f"/runs/new/?run={own.evaluation.public_id}").content.decode()
    assert not re.search(r'name="laps" value="7"', stranger)


def test_the_map_of_the_form_shows_what_it_says(world: World) -> None:
    client = world.client("alice")
    said = {**FORM, **AVOID, "boxes-1-percent": "30", "boxes-1-lane": "outer"}
    page = client.post("/runs/layout/", said).content.decode()
    assert "Box 1: 30 % of the lap" in page and 'hx-post="/runs/layout/"' in page
    among = client.post("/runs/layout/", {**FORM, **HEAD, "opponents": "models"}).content.decode()
    assert "round robin" not in among and "Duels" not in among


def test_the_result_says_what_it_would_be(world: World) -> None:
    race = a_race(world.now)
    for time in (9_000, 12_000):
        drive(race, a_racer(), laps(*[time] * 3), world.now)
    own = drive_own(owner=world.alice, model=world.model, race=race, now=world.now)
    own = finish(own, laps(*[10_000] * 3), world.now)
    page = world.client("alice").get(own.evaluation.get_absolute_url()).content.decode()
    assert "place 2 of 3 in the race" in page and "0:10.000" in page
    assert world.client("admin").get(own.evaluation.get_absolute_url()).status_code == 200
    for stranger in ("bob", "anonymous"):
        for part in ("", "replay.json", "trace.csv", "metrics.json", "logs.zip", "live/"):
            assert world.client(stranger).get(own.evaluation.get_absolute_url() + part).status_code == 404, part


def test_the_result_says_what_became_of_the_submission(world: World) -> None:
    race = a_race(world.now)
    better = drive_own(owner=world.alice, model=world.model, race=race, submit_if_better=True, now=world.now)
    finish(better, laps(*[10_000] * 3), world.now)
    client = world.client("alice")
    sent = Submission.objects.get(entry__race=race).evaluation
    assert f'href="{sent.get_absolute_url()}"' in client.get(better.evaluation.get_absolute_url()).content.decode()
    worse = drive_own(owner=world.alice, model=a_model(world.alice), race=race, submit_if_better=True, now=world.now)
    finish(worse, [lap(1, complete=False)], world.now)
    assert "own_not_classified" in client.get(worse.evaluation.get_absolute_url()).content.decode()


def test_cars_of_one_racer_are_told_apart_by_their_names(world: World) -> None:
    head = {"race_type": "head_to_head", "rivals": [a_model(world.alice, name="Thunder"), world.model]}
    own = drive_own(owner=world.alice, model=world.model, track=world.track, now=world.now, **head)
    page = world.client("alice").get(own.evaluation.get_absolute_url()).content.decode()
    name = world.model.name
    assert all(f">{label}</a>" in page for label in (name, "Thunder", f"{name} (2)"))


def test_a_run_says_by_which_rules_it_is_driven(world: World) -> None:
    told = {"race_type": "head_to_head", "bots": 2, "laps": 5, "seed": 77, "start_m": 2.5, "direction": "cw"}
    own = drive_own(owner=world.alice, model=world.model, track=world.track, now=world.now, **told)
    client, at = world.client("alice"), own.evaluation.get_absolute_url()
    waiting = client.get(at).content.decode()
    finish(own, laps(*[9_000] * 5), world.now)
    for page in (waiting, client.get(at).content.decode()):
        assert "2 bots at 1 m/s" in page and "2.5 m</dd>" in page and "<dd>77</dd>" in page and "clockwise" in page


def test_the_list_is_filtered_and_shows_what_can_be_done(world: World) -> None:
    client, other = world.client("alice"), a_model(world.alice, name="Thunder")
    done = finish(
        drive_own(owner=world.alice, model=world.model, track=world.track, now=world.now), laps(9_000), world.now
    )
    waits = drive_own(owner=world.alice, model=other, race=world.race, now=world.now)
    page = client.get("/runs/").content.decode()
    assert f"/evaluations/{done.evaluation.public_id}/again/" in page
    assert f"/evaluations/{waits.evaluation.public_id}/stop/" in page
    for query, shown in ((f"model={other.public_id}", waits), ("state=finished", done)):
        page = client.get(f"/runs/?{query}").content.decode()
        hidden = done if shown is waits else waits
        assert shown.evaluation.public_id in page and hidden.evaluation.public_id not in page
    assert "No run" not in client.get("/runs/?state=nothing").content.decode(), "what is no filter filters nothing"
    assert done.evaluation.public_id not in world.client("bob").get("/runs/").content.decode()


def test_a_run_is_driven_again_and_deleted_by_who_asked_for_it_alone(world: World) -> None:
    own = drive_own(owner=world.alice, model=world.model, track=world.track, now=world.now)
    at = own.evaluation.get_absolute_url()
    client = world.client("alice")
    assert "own_under_way" in client.post(f"{at}delete/", follow=True).content.decode()
    finish(own, laps(9_000), world.now)
    for stranger in ("bob", "admin"):
        assert world.client(stranger).post(f"{at}again/").status_code == 404
        assert world.client(stranger).post(f"{at}delete/").status_code == 404
    again = client.post(f"{at}again/")
    assert again.status_code == 302 and OwnEvaluation.objects.count() == 2
    assert client.get(f"{at}delete/").status_code == 200
    assert "Run deleted." in client.post(f"{at}delete/", follow=True).content.decode()
    assert client.get(at).status_code == 404


def test_a_run_that_paddock_fails_says_that_it_counts_for_nothing(world: World) -> None:
    own = drive_own(owner=world.alice, model=world.model, track=world.track, now=world.now)
    fail(own, PlatformFault("runner_died", how="killed"), world.now)
    page = world.client("alice").get(own.evaluation.get_absolute_url()).content.decode()
    assert "Run it again" in page and "Submit the car" not in page


def test_more_runs_need_no_more_queries(world: World) -> None:
    client = world.client("alice")

    def asked() -> int:
        sent = queries(client, "/runs/")
        assert len(sent) <= LIMIT, "\n".join(sent)
        return len(sent)

    def drive_one() -> None:
        ask = partial(drive_own, owner=world.alice, now=world.now)
        finish(ask(model=a_model(world.alice), race=a_race(world.now)), laps(*[9_000] * 3), world.now)
        ask(model=world.model, track=world.track)

    drive_one()
    before = asked()
    for _ in range(3):
        drive_one()
    assert asked() <= before


@pytest.mark.parametrize("at", ["/runs/new/", "/runs/new/?race=open-race"])
def test_the_form_needs_few_queries(world: World, at: str) -> None:
    sent = queries(world.client("alice"), at)
    assert len(sent) <= LIMIT, "\n".join(sent)


def test_a_result_needs_few_queries(world: World) -> None:
    own = drive_own(owner=world.alice, model=world.model, race=world.race, now=world.now)
    finish(own, laps(*[9_000] * 3), world.now)
    sent = queries(world.client("alice"), own.evaluation.get_absolute_url())
    assert len(sent) <= LIMIT, "\n".join(sent)
