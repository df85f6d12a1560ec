"""The page of a run with boxes, bots or other racers' cars: the map, the crashes, the cars, the replay."""

from __future__ import annotations

import pytest
from django.utils import timezone

from evaluation.models import Evaluation, TrainedModel
from evaluation.services import finish_evaluation, queue_evaluation
from evaluation.simulator.course import lay_course
from evaluation.simulator.rules import BoxPlace, RaceRules
from races.replay import map_point
from tests.evaluation.stubs import car_outcome, outcome_of
from tests.factories import a_model, a_racer, a_track, start
from tests.pages.conftest import World
from tests.pages.test_race_types import box_middles

BOXES = RaceRules(race_type="object_avoidance", boxes=(BoxPlace(0.25, "inner"), BoxPlace(0.6, "outer")))


def run(racer, rules: RaceRules, *against: TrainedModel, **outcome) -> Evaluation:
    """A finished run of a new car of ``racer``, on the track with ``against``."""
    now = timezone.now()
    queued = queue_evaluation(
        owner=racer, model=a_model(racer), rivals=against, track=a_track(), rules=rules, priority=99, now=now
    )
    start(queued, now)
    finish_evaluation(evaluation_id=queued.pk, lease=queued.lease, outcome=outcome_of(**outcome), now=now)
    return Evaluation.objects.get(pk=queued.pk)


@pytest.fixture
def boss(world: World):
    """Who may see every run."""
    return world.client("admin")


def test_the_boxes_of_a_run_are_on_its_map_where_they_stood_and_crashes_in_its_laps(world: World, boss) -> None:
    course = lay_course(a_track().geometry.in_direction("ccw"), BOXES)
    shown = run(world.alice, BOXES, course=course.to_dict())
    html = boss.get(shown.get_absolute_url()).content.decode()
    for drawn, placed in zip(box_middles(html), course.boxes, strict=True):
        assert drawn == pytest.approx(map_point(a_track(), placed.solid.x, placed.solid.y), abs=0.02)
    assert "2 boxes" in html and 'title="Crashes"' in html
    assert "Box 2: 60 % of the lap, outer lane" in html


def test_a_run_on_an_empty_track_has_no_column_for_crashes(world: World, boss) -> None:
    html = boss.get(run(world.alice, RaceRules()).get_absolute_url()).content.decode()
    assert 'title="Crashes"' not in html and "track-box" not in html


def test_a_run_that_waits_shows_its_boxes_and_one_on_track_where_everybody_is(world: World, boss) -> None:
    queued = queue_evaluation(
        owner=world.alice, model=a_model(world.alice), track=a_track(), rules=BOXES, now=timezone.now()
    )
    assert len(box_middles(boss.get(queued.get_absolute_url()).content.decode())) == 2
    start(queued, timezone.now())
    progress = {
        "lap": 1,
        "laps": 3,
        "percent": 20.0,
        "x": 1.0,
        "y": 1.0,
        "crashes": 4,
        "bots": [[0.0, 1.0], [2.0, 1.0]],
    }
    progress |= {"rivals": [{"x": 0.5, "y": 0.5}]}
    Evaluation.objects.filter(pk=queued.pk).update(progress=progress)
    html = boss.get(queued.get_absolute_url()).content.decode()
    assert html.count('class="track-other "') == 2 and html.count('class="track-other r1"') == 1
    assert "<dt>Crashes</dt><dd>4</dd>" in html


def test_bots_drive_along_in_the_replay(world: World, boss) -> None:
    rules = RaceRules(race_type="head_to_head", bots=2)
    bots = [[[1.0, 2.0, 0.5]] * 10, [[-1.0, 0.0, -0.25]] * 10]
    shown = run(world.alice, rules, course={"boxes": [], "bots": bots})
    assert "2 bots" in boss.get(shown.get_absolute_url()).content.decode()
    replay = boss.get(f"{shown.get_absolute_url()}replay.json").json()
    first, second = replay["bots"]
    assert len(first["x"]) == len(replay["t"]) == 10
    assert (first["x"][0], first["y"][0]) == map_point(a_track(), 1.0, 2.0)
    assert (first["yaw"][0], second["yaw"][0]) == (-28.6, 14.3), "degrees, clockwise on the map"


def test_a_duel_shows_its_cars_in_the_order_of_the_end_and_drives_them_all(world: World, boss) -> None:
    against = [a_model(world.bob), a_model(a_racer("charlie"))]
    others = [car_outcome(salt=1, laps=(7_000,), retired="policy_died"), car_outcome(salt=2, laps=(9_000, 9_000))]
    shown = run(world.alice, RaceRules(race_type="head_to_head"), *against, rivals=others, order=[2, 0, 1])
    html = boss.get(shown.get_absolute_url()).content.decode()
    rows = html[html.index("<h2>Cars</h2>") : html.index("<h2>Laps</h2>")]
    assert rows.index(">charlie</a>") < rows.index(">alice</a>") < rows.index(">bob</a>")
    assert "taken off the track" in rows
    replay = boss.get(f"{shown.get_absolute_url()}replay.json").json()
    assert [rival["number"] for rival in replay["rivals"]] == [1, 2]
    assert all(len(rival["x"]) == len(rival["t"]) for rival in replay["rivals"])
