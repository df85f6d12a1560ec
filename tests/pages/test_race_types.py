"""Types of races on the pages: the form and its map, cards, rules, boards."""

from __future__ import annotations

import re
from math import hypot

import numpy as np
import pytest
from django.utils import timezone

from paddock.simulator.layout import lay_out
from races.models import Race
from races.rules.layout import race_rules
from tests.factories import a_race, a_racer, a_track, drive, lap
from tests.pages.conftest import World
from tests.pages.test_races import form

BOXES = [{"fraction": 0.25, "lane": "inner"}, {"fraction": 0.6, "lane": "outer"}]


def layout_form(**changes: str) -> dict[str, object]:
    """What the form of an object avoidance race sends: the rows of its boxes among all the rest."""
    rows = {"boxes-1-percent": "25", "boxes-1-lane": "inner", "boxes-2-percent": "60", "boxes-2-lane": "outer"}
    return form(timezone.now(), **({"race_type": "object_avoidance", "box_choice": "fixed"} | rows | changes))


def box_middles(html: str) -> list[tuple[float, float]]:
    """The middle of each box drawn on a map, in the map's own coordinates."""
    shapes = re.findall(r'<g class="track-box">.*?<path [^>]*d="M([^"]*)Z"', html)
    corners = [np.array([[float(value) for value in pair.split(",")] for pair in shape.split()]) for shape in shapes]
    return [tuple(each.mean(axis=0)) for each in corners]


def nearer_border(track, x: float, y: float) -> str:
    """``inner`` or ``outer``: which border line the point is nearer to."""
    inner, outer = (min(hypot(x - a, y - b) for a, b in line) for line in (track.inner, track.outer))
    return "inner" if inner < outer else "outer"


def dense(track):
    """The same track with border points every few centimetres, so that the nearest point is as near as the line."""

    class Borders:
        inner = [
            p for k in range(2000) for p in [track.point_at(k * track.length / 2000, _left(track, k, "inner"))[:2]]
        ]
        outer = [
            p for k in range(2000) for p in [track.point_at(k * track.length / 2000, _left(track, k, "outer"))[:2]]
        ]

    return Borders


def _left(track, k: int, lane: str) -> float:
    left, right = track.half_widths_at(k * track.length / 2000)
    return left if (lane == "inner") == (track.direction == "ccw") else -right


@pytest.mark.parametrize("direction", ["ccw", "cw"])
@pytest.mark.parametrize("lane", ["inner", "outer"])
def test_a_lane_name_means_the_same_everywhere(world: World, direction: str, lane: str) -> None:
    client = world.client("alice")
    data = layout_form(direction=direction, **{"boxes-1-lane": lane, "boxes-2-percent": ""})
    assert client.post("/races/new/", data).status_code == 302
    by_form = Race.objects.get(name="Friday night")
    answer = client.post(
        "/api/v1/races/",
        {
            "name": "By the API",
            "track": "oval",
            "direction": direction,
            "opens_at": by_form.opens_at.isoformat(),
            "closes_at": by_form.closes_at.isoformat(),
            "race_type": "object_avoidance",
            "boxes": [{"fraction": 0.25, "lane": lane}],
        },
        content_type="application/json",
    )
    assert answer.status_code == 201, answer.content
    by_api = Race.objects.get(name="By the API")
    track = a_track().geometry.in_direction(direction)
    borders = dense(track)
    assert by_form.boxes == by_api.boxes == [{"fraction": 0.25, "lane": lane}]

    placed = lay_out(track, race_rules(by_form)).boxes[0].solid
    assert nearer_border(borders, placed.x, placed.y) == lane
    told = answer.json()["placed_boxes"][0]
    assert told["lane"] == lane and nearer_border(borders, told["x"], told["y"]) == lane

    x_min, _, _, y_max = track.bounds
    maps = (
        client.get(by_form.get_absolute_url()).content.decode(),
        client.get(by_api.get_absolute_url()).content.decode(),
        client.post("/races/layout/", data).content.decode(),
    )
    for html in maps:
        ((x, y),) = box_middles(html)
        assert nearer_border(borders, x + x_min - 0.3, y_max + 0.3 - y) == lane
        assert f"25 % of the lap, {lane} lane" in html


def test_an_organiser_makes_a_race_with_boxes_and_edits_them(world: World) -> None:
    client = world.client("newcomer")
    assert client.post("/races/new/", layout_form()).status_code == 302
    race = Race.objects.get(name="Friday night")
    assert (race.race_type, race.boxes, race.random_boxes) == ("object_avoidance", BOXES, 0)
    page = client.get(f"{race.get_absolute_url()}edit/").content.decode()
    assert 'name="boxes-1-percent" value="25"' in page and 'name="boxes-2-percent" value="60"' in page
    assert (
        client.post(
            f"{race.get_absolute_url()}edit/", layout_form(box_choice="drawn", random_boxes="3", box_distance_m="2")
        ).status_code
        == 302
    )
    race.refresh_from_db()
    assert (race.boxes, race.random_boxes) == ([], 3)
    bots = {"opponents": "bots", "bots": "2", "bot_speed_mps": "0.7", "bot_lane_changes": "on"}
    assert (
        client.post(f"{race.get_absolute_url()}edit/", layout_form(race_type="head_to_head", **bots)).status_code == 302
    )
    race.refresh_from_db()
    assert (race.boxes, race.random_boxes, race.bots, race.bot_speed_mps, race.bot_lane_changes) == (
        [],
        0,
        2,
        0.7,
        True,
    )


def test_fields_of_another_race_type_are_dropped_even_if_invalid(world: World) -> None:
    """Without a script every section of the form is sent, whatever stands in it."""
    wrong = {"boxes-1-percent": "lots", "random_boxes": "99", "bots": "99", "bot_speed_mps": "fast", "duel_cars": "9"}
    assert world.client("newcomer").post("/races/new/", form(timezone.now(), **wrong)).status_code == 302
    race = Race.objects.get(name="Friday night")
    assert (race.race_type, race.boxes, race.random_boxes, race.bots, race.duel_cars) == ("time_trial", [], 0, 0, 2)


@pytest.mark.parametrize(
    ("changes", "code"),
    [
        ({"boxes-1-percent": "many"}, "race_box_percent"),
        ({"boxes-1-percent": "nan"}, "race_box_percent"),
        ({"boxes-1-lane": "middle"}, "race_box_percent"),
        ({"boxes-1-percent": "2"}, "race_box_place"),
        ({"boxes-2-percent": "25"}, "boxes_overlap"),
        ({"boxes-1-percent": "", "boxes-2-percent": ""}, "race_needs_boxes"),
        ({"box_choice": "drawn", "random_boxes": "10", "box_distance_m": "9"}, "boxes_do_not_fit"),
        ({"box_choice": "drawn", "random_boxes": ""}, "race_needs_boxes"),
        ({"race_type": "head_to_head", "opponents": "bots", "bots": "7"}, "race_bot_count"),
        ({"race_type": "head_to_head", "opponents": "bots", "bots": "2", "bot_speed_mps": "5"}, "race_bot_speed"),
        ({"race_type": "head_to_head"}, "race_needs_opponents"),
    ],
)
def test_form_and_preview_report_the_same_layout_errors(world: World, changes: dict[str, str], code: str) -> None:
    client = world.client("newcomer")
    response = client.post("/races/new/", layout_form(**changes))
    assert response.status_code == 422 and not Race.objects.filter(name="Friday night").exists()
    fields = response.context["form"].errors.as_data()
    codes = {error.code: str(error.messages[0]) for errors in fields.values() for error in errors}
    assert set(codes) == {code} and "__all__" not in fields
    assert codes[code] in response.context["layout"].problems
    preview = client.post("/races/layout/", layout_form(**changes))
    assert preview.status_code == 200
    if code != "race_needs_boxes":  # what is still to be filled in is no problem before the form is sent
        assert codes[code] in preview.context["layout"].problems
    assert "track-road" in preview.content.decode()


NO_BOXES = {"boxes-1-percent": "", "boxes-2-percent": ""}


@pytest.mark.parametrize("changes", [NO_BOXES, {"box_choice": "drawn", "random_boxes": ""}, {"box_choice": ""}])
def test_missing_boxes_are_a_hint_until_the_form_is_sent(world: World, changes: dict[str, str]) -> None:
    client = world.client("newcomer")
    layout = client.post("/races/layout/", layout_form(**(NO_BOXES | changes)))
    assert layout.context["layout"].problems == [] and 'class="bad"' not in layout.content.decode()
    assert "No boxes yet." in layout.content.decode() and "track-road" in layout.content.decode()
    sent = client.post("/races/new/", layout_form(**(NO_BOXES | changes)))
    assert sent.status_code == 422
    assert '<p class="bad">Object avoidance needs boxes' in sent.content.decode()
    assert "No boxes yet." not in sent.content.decode()


def test_asking_for_zero_drawn_boxes_is_an_error_immediately(world: World) -> None:
    layout = world.client("newcomer").post("/races/layout/", layout_form(box_choice="drawn", random_boxes="0"))
    assert layout.context["layout"].problems and layout.context["layout"].hint == ""


def test_an_invalid_box_among_empty_rows_is_an_error_immediately(world: World) -> None:
    data = layout_form(**{"boxes-1-percent": "2", "boxes-2-percent": ""})
    layout = world.client("newcomer").post("/races/layout/", data).context["layout"]
    assert layout.problems and layout.hint == ""


@pytest.mark.parametrize("step", ["table", "validate"])
def test_the_training_wizard_treats_missing_boxes_the_same_way(world: World, step: str) -> None:
    sent = {"do": step, "track": "oval", "race_type": "object_avoidance", "box_choice": "fixed"}
    page = world.client("alice").post("/train/new/", sent)
    assert page.status_code == 200 and page.context["layout"].hint
    del sent["do"]
    page = world.client("alice").post("/train/new/", sent)
    assert page.status_code == 422 and page.context["layout"].problems and not page.context["layout"].hint


@pytest.mark.parametrize(
    ("changes", "good", "wrong"),
    [
        ({"boxes-1-percent": "many"}, [2], []),
        ({"boxes-1-lane": "middle"}, [2], []),
        ({"boxes-1-percent": "2"}, [2], [1]),
        ({"boxes-2-percent": "25"}, [1], [2]),
        ({"boxes-2-percent": "25", "boxes-3-percent": "75", "boxes-3-lane": "inner"}, [1, 3], [2]),
        ({"boxes-1-percent": "x", "boxes-3-percent": "99", "boxes-3-lane": "inner"}, [2], [3]),
        ({"boxes-1-percent": "120"}, [2], []),
        ({"box_choice": "drawn", "random_boxes": "10", "box_distance_m": "9"}, [], []),
    ],
)
def test_the_preview_shows_valid_boxes_and_marks_invalid_ones(world: World, changes, good, wrong) -> None:
    preview = world.client("newcomer").post("/races/layout/", layout_form(**changes))
    html = preview.content.decode()
    shown = {
        mark: re.findall(rf'<g class="{mark}">.*?>(\d+)</text>', html) for mark in ("track-box", "track-box wrong")
    }
    assert shown == {"track-box": [str(n) for n in good], "track-box wrong": [str(n) for n in wrong]}
    assert html.count('<li class="bad">') == len(wrong)
    assert preview.context["layout"].problems


def test_two_misplaced_boxes_are_both_reported(world: World) -> None:
    changes = {"boxes-1-percent": "4", "boxes-2-percent": "95"}
    told = world.client("newcomer").post("/races/layout/", layout_form(**changes)).context["layout"].problems
    assert len(told) == 2 and "1" in told[0] and "2" in told[1]


def test_the_preview_needs_a_track_and_a_log_in(world: World) -> None:
    assert "Choose a track" in world.client("newcomer").post("/races/layout/", {}).content.decode()
    assert world.client("anonymous").post("/races/layout/", layout_form()).status_code == 302
    assert world.client("newcomer").get("/races/layout/").status_code == 405


def test_the_layout_of_a_race_with_cars_is_shown_but_fixed(world: World) -> None:
    race = a_race(world.now, slug="boxed", organiser=world.alice, race_type="object_avoidance", boxes=BOXES)
    drive(race, world.bob, [lap(1, 12_000)], world.now)
    client = world.client("alice")
    page = client.get("/races/boxed/edit/")
    assert len(box_middles(page.content.decode())) == 2
    assert page.context["form"].fields["boxes"].disabled and page.context["form"].fields["race_type"].disabled
    sent = layout_form(race_type="time_trial", name="Boxed") | {"boxes-1-percent": "80"}
    assert client.post("/races/boxed/edit/", sent).status_code == 302
    race.refresh_from_db()
    assert (race.name, race.race_type, race.boxes) == ("Boxed", "object_avoidance", BOXES)


def test_every_view_of_a_race_names_its_type_and_layout(world: World) -> None:
    bots = {"race_type": "head_to_head", "opponents": "bots", "bots": 4}
    a_race(world.now, slug="traffic", name="Traffic", sensors=["STEREO_CAMERAS", "LIDAR"], **bots)
    race = a_race(world.now, slug="boxed", name="Boxed", race_type="object_avoidance", boxes=BOXES)
    drive(race, a_racer("crasher"), [lap(n, 12_000) | {"crashes": 3} for n in (1, 2, 3)], world.now)
    client = world.client("anonymous")
    html = client.get("/races/").content.decode()
    assert "4 bots at 1 m/s" in html and "2 boxes" in html and "stereo cameras" in html
    only = client.get("/races/?type=head_to_head").content.decode()
    assert "Traffic" in only and "Boxed" not in only and "Open race" not in only
    assert "Open race" in client.get("/races/?type=nonsense").content.decode()
    page = client.get("/races/boxed/").content.decode()
    assert len(box_middles(page)) == 2 and 'title="Crashes"' in page and ">9</td>" in page
    assert 'title="Crashes"' not in client.get("/races/open-race/").content.decode()
    rules = client.get("/races/boxed/rules/").content.decode()
    assert (
        "Box 1: 25 % of the lap, inner lane" in rules and "A car that hits a box waits 5 s and restarts before" in rules
    )
