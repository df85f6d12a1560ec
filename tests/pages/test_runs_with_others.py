"""The page of a run with boxes, bots or other racers' cars: the map, the crashes, the cars, the replay."""

from __future__ import annotations

import re

import pytest
from django.utils import timezone

from evaluation.models import Evaluation, RivalResult, TrainedModel
from evaluation.running.queue.jobs import finish_evaluation
from evaluation.running.queue.services import queue_evaluation
from paddock.rules.race import BoxPlace, RaceRules
from paddock.simulator.layout import lay_out
from races.models import Duel
from races.replays.run_maps import map_point
from tests.evaluation.stubs import car_outcome, outcome_of
from tests.factories import a_model, a_race, a_racer, a_track, start
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
    finish_evaluation(pk=queued.pk, lease=queued.lease, outcome=outcome_of(**outcome), now=now)
    return Evaluation.objects.get(pk=queued.pk)


@pytest.fixture
def boss(world: World):
    """Who may see every run."""
    return world.client("admin")


def test_a_run_shows_its_boxes_on_the_map_and_its_crashes(world: World, boss) -> None:
    layout = lay_out(a_track().geometry.in_direction("ccw"), BOXES)
    shown = run(world.alice, BOXES, layout=layout.to_dict())
    html = boss.get(shown.get_absolute_url()).content.decode()
    for drawn, placed in zip(box_middles(html), layout.boxes, strict=True):
        assert drawn == pytest.approx(map_point(a_track(), placed.solid.x, placed.solid.y), abs=0.02)
    assert "2 boxes" in html and 'title="Crashes"' in html
    assert "Box 2: 60 % of the lap, outer lane" in html


def test_a_run_on_an_empty_track_has_no_crash_column(world: World, boss) -> None:
    html = boss.get(run(world.alice, RaceRules()).get_absolute_url()).content.decode()
    assert 'title="Crashes"' not in html and "track-box" not in html


def test_a_waiting_run_shows_boxes_and_a_live_one_every_position(world: World, boss) -> None:
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
    Evaluation.objects.filter(pk=queued.pk).update(progress=progress)
    html = boss.get(queued.get_absolute_url()).content.decode()
    assert html.count('class="track-other"') == 2 and html.count('class="track-car"') == 1
    assert "<dt>Crashes</dt><dd>4</dd>" in html


def driving_duel(world: World, **progress) -> Evaluation:
    """Alice in red against bob in green and charlie in the same red, on track."""
    now = timezone.now()
    cars = [a_model(owner) for owner in (world.alice, world.bob, a_racer("charlie"))]
    for car, colour in zip(cars, ("#ef4444", "#84cc16", "#ef4444"), strict=True):
        TrainedModel.objects.filter(pk=car.pk).update(shell="kart", colour=colour)
    first, *others = TrainedModel.objects.filter(pk__in=[car.pk for car in cars]).order_by("pk")
    rules = RaceRules(race_type="head_to_head")
    queued = queue_evaluation(
        owner=world.alice, model=first, rivals=others, track=a_track(), rules=rules, priority=99, now=now
    )
    start(queued, now)
    mine = {"lap": 1, "laps": 3, "percent": 60.0, "x": 1.0, "y": 1.0, "total_ms": 9000, "off_tracks": 1, "crashes": 2}
    Evaluation.objects.filter(pk=queued.pk).update(progress=mine | progress)
    return Evaluation.objects.get(pk=queued.pk)


BEHIND = {"lap": 1, "percent": 20.0, "total_ms": 9000, "x": 0.5, "y": 0.5, "off_tracks": 0, "crashes": 0}
AHEAD = {"lap": 2, "percent": 5.0, "total_ms": 9000, "x": -0.5, "y": 0.5, "off_tracks": 0, "crashes": 0}


def test_a_live_duel_shows_each_car_in_its_colour_and_the_leader(world: World, boss) -> None:
    shown = driving_duel(world, rivals=[BEHIND | {"retired": False}, AHEAD | {"retired": False}])
    html = boss.get(shown.get_absolute_url()).content.decode()
    card = html[html.index('id="live"') :]
    assert card.index(">charlie</a>") < card.index(">alice</a>") < card.index(">bob</a>")
    assert "Lap 2 / 3" in card and "0:09.000" in card and "2 crashes" in card and "1 off track" in card
    dots = dict(re.findall(r'<circle id="live-dot-?(\d?)" class="track-car" fill="(#\w+)"', html))
    assert (dots[""], dots["1"]) == ("#ef4444", "#84cc16"), "each its own"
    assert dots["2"] not in ("#ef4444", "#84cc16"), "told apart from the same red"
    renewed = boss.get(f"{shown.get_absolute_url()}live/?seen=x").content.decode()
    assert renewed.count('id="live-dot') == 3 and "charlie" in renewed


def test_a_retired_car_is_last_and_off_the_map(world: World, boss) -> None:
    shown = driving_duel(world, rivals=[BEHIND | {"retired": False}, AHEAD | {"retired": True}])
    html = boss.get(shown.get_absolute_url()).content.decode()
    card = html[html.index('id="live"') :]
    assert card.index(">alice</a>") < card.index(">bob</a>") < card.index(">charlie</a>")
    assert html.count('id="live-dot') == 2 and "retired" in card


def test_a_duel_without_reports_yet_names_its_cars(world: World, boss) -> None:
    shown = driving_duel(world)
    Evaluation.objects.filter(pk=shown.pk).update(progress={})
    html = boss.get(shown.get_absolute_url()).content.decode()
    assert all(f">{name}</a>" in html for name in ("alice", "bob", "charlie")) and "Starting" in html


def test_the_heading_of_a_duel_names_its_racers(world: World, boss) -> None:
    html = boss.get(driving_duel(world).get_absolute_url()).content.decode()
    head = html[html.index("<h1") : html.index("</h1>")]
    assert [head.index(f">{name}</a>") for name in ("alice", "bob", "charlie")] == sorted(
        head.index(f">{name}</a>") for name in ("alice", "bob", "charlie")
    )


def test_bots_appear_in_the_replay(world: World, boss) -> None:
    rules = RaceRules(race_type="head_to_head", bots=2)
    bots = [[[1.0, 2.0, 0.5]] * 10, [[-1.0, 0.0, -0.25]] * 10]
    shown = run(world.alice, rules, layout={"boxes": [], "bots": bots})
    assert "2 bots" in boss.get(shown.get_absolute_url()).content.decode()
    replay = boss.get(f"{shown.get_absolute_url()}replay.json").json()
    first, second = replay["bots"]
    assert len(first["x"]) == len(replay["columns"]["t"]) == 10
    assert (first["x"][0], first["y"][0]) == (1.0, 2.0)
    assert (first["yaw"][0], second["yaw"][0]) == (28.6, -14.3), "degrees, anticlockwise"


def test_a_duel_lists_cars_in_finishing_order_and_replays_all(world: World, boss) -> None:
    against = [a_model(world.bob), a_model(a_racer("charlie"))]
    others = [car_outcome(salt=1, laps=(7_000,), retired="policy_died"), car_outcome(salt=2, laps=(9_000, 9_000))]
    shown = run(world.alice, RaceRules(race_type="head_to_head"), *against, rivals=others, order=[2, 0, 1])
    html = boss.get(shown.get_absolute_url()).content.decode()
    rows = html[html.index("<h2>Cars</h2>") : html.index("<h2>Laps</h2>")]
    assert rows.index(">charlie</a>") < rows.index(">alice</a>") < rows.index(">bob</a>")
    assert "removed from the track" in rows
    replay = boss.get(f"{shown.get_absolute_url()}replay.json").json()
    assert [rival["number"] for rival in replay["rivals"]] == [1, 2]
    assert all(len(rival["columns"]["x"]) == len(rival["columns"]["t"]) > 0 for rival in replay["rivals"])


@pytest.fixture
def decided(world: World) -> Evaluation:
    """Alice, whose run it is, against bob, who drove laps of 9.0 and 9.73 s."""
    others = [car_outcome(salt=2, laps=(9_000, 9_730))]
    return run(world.alice, RaceRules(race_type="head_to_head"), a_model(world.bob), rivals=others, order=[1, 0])


def test_the_page_of_a_duel_shows_the_laps_of_each_car(world: World, boss, decided: Evaluation) -> None:
    def laps(query: str, viewer=boss) -> str:
        html = viewer.get(f"{decided.get_absolute_url()}{query}").content.decode()
        return html[html.index("<h2>Laps</h2>") : html.index('id="driven"')]

    assert "0:09.730" in laps("?car=1") and "0:09.730" not in laps("?car=0")
    assert laps("") == laps("?car=0") == laps("?car=7") == laps("?car=x") == laps("?car=-1")
    html = boss.get(f"{decided.get_absolute_url()}?car=1&colour=lap").content.decode()
    assert "?colour=lap&amp;lap=2&amp;car=1#driven" in html, "other views keep the car"
    replayed = boss.get(f"{decided.get_absolute_url()}replay.json").json()
    assert (replayed["name"], replayed["number"]) == ("alice", 0), "its clock and speed are those of the run's own car"
    assert RivalResult.objects.get().trace_sha256 in html and decided.result.trace_sha256 not in html


def test_a_racer_finds_their_own_duel_laps_first(world: World, decided: Evaluation) -> None:
    page = decided.get_absolute_url()
    a_race_of_duels = a_race(
        world.now, slug="duels", race_type="head_to_head", opponents="models", duel_format="bracket"
    )
    Duel.objects.create(race=a_race_of_duels, round=1, number=1, evaluation=decided, state="driving", tries=1)
    html = world.client("bob").get(page).content.decode()
    assert "0:09.730" in html[html.index("<h2>Laps</h2>") : html.index('id="driven"')]
    rows = html[html.index("<h2>Cars</h2>") : html.index("<h2>Laps</h2>")]
    assert rows.count("linked me") == 1 and rows.index("linked me") < rows.index(">bob</a>") < rows.index(">alice</a>")


def test_the_files_of_each_car_of_a_duel_can_be_downloaded(world: World, boss, decided: Evaluation) -> None:
    page = decided.get_absolute_url()
    assert f"{page}trace.csv?car=1" in boss.get(f"{page}?car=1").content.decode()
    first, other = (boss.get(f"{page}trace.csv?car={number}") for number in (0, 1))
    assert first.content == boss.get(f"{page}trace.csv").content != other.content
    assert "-car1-sim-trace.csv" in other["Content-Disposition"]
    assert boss.get(f"{page}metrics.json?car=1").json() == RivalResult.objects.get().metrics
    assert boss.get(f"{page}trace.csv?car=2").status_code == boss.get(f"{page}metrics.json?car=x").status_code == 404
