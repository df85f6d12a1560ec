"""Types of races: what belongs to each, where boxes stand, what is refused and with which words."""

from __future__ import annotations

from datetime import timedelta

import pytest
from django.db import IntegrityError, transaction
from django.test import override_settings

from paddock.simulator.layout import lay_out
from races.errors import RaceRefused
from races.models import Race
from races.pages.forms import RaceForm
from races.pages.services import clone_race, create_community_race, edit_race
from races.rules.descriptions import fault_rules, layout_facts, layout_rules
from races.rules.layout import box_marks, box_rows, race_rules
from tests.factories import a_race, a_track, drive, lap
from tests.rows import track_row

pytestmark = pytest.mark.django_db

TWO_BOXES = [{"fraction": 0.6, "lane": "outer"}, {"fraction": 0.25, "lane": "inner"}]
BOXES = {"race_type": "object_avoidance", "boxes": TWO_BOXES}
DRAWN = {"race_type": "object_avoidance", "random_boxes": 4}
BOTS = {"race_type": "head_to_head", "opponents": "bots", "bots": 3}
MODELS = {"race_type": "head_to_head", "opponents": "models", "duel_format": "round_robin"}


def make(alice, now, **fields) -> Race:
    options = {
        "name": "Obstacles",
        "track": a_track(),
        "opens_at": now + timedelta(hours=1),
        "closes_at": now + timedelta(days=2),
    }
    return create_community_race(organiser=alice, now=now, **(options | fields))


def refusal(call, *args, **kwargs) -> dict[str, str]:
    with pytest.raises(RaceRefused) as caught:
        call(*args, **kwargs)
    assert "%(" not in str(caught.value) and "?" not in str(caught.value)
    return {field: errors[0].code for field, errors in caught.value.errors.error_dict.items()}


@pytest.mark.parametrize("options", [{}, BOXES, DRAWN, BOTS, MODELS])
def test_every_race_type_passes_its_rules_to_the_simulator(alice, now, options):
    race = make(alice, now, **options)
    race.refresh_from_db()
    rules = race_rules(race)
    assert rules.race_type == options.get("race_type", "time_trial")
    assert [{"fraction": box.fraction, "lane": box.lane} for box in rules.boxes] == options.get("boxes", [])
    assert (rules.random_boxes, rules.bots) == (options.get("random_boxes", 0), options.get("bots", 0))
    lay_out(race.track.geometry.in_direction(race.direction), rules)


@pytest.mark.parametrize("options", [BOTS, MODELS])
def test_an_open_track_carries_no_race_of_several_cars(alice, now, options):
    straight = track_row("straight-track")
    assert refusal(make, alice, now, track=straight, **options) == {"track": "track_needs_loop"}
    race = make(alice, now, track=straight, **DRAWN | {"random_boxes": 2})
    change = {"random_boxes": 0, "box_distance_m": 2.0, **options}
    assert refusal(edit_race, race=race, now=now, **change) == {"track": "track_needs_loop"}


def test_times_of_lane_changes_and_standing_laps_reach_the_simulator(alice, now):
    changes = {"bot_lane_changes": True, "bot_lane_change_least_ms": 1500, "bot_lane_change_most_ms": 2500}
    race = make(alice, now, **BOTS, **changes, standing_laps=True)
    race.refresh_from_db()
    rules = race_rules(race)
    assert (rules.bot_lane_change_least_ms, rules.bot_lane_change_most_ms, rules.standing_laps) == (1500, 2500, True)
    assert "Bots change lanes every 1.5 to 2.5 s" in " ".join(layout_rules(race))
    assert "Laps are not driven in a row" in fault_rules(race)[0]
    assert "in a row" not in " ".join(fault_rules(make(alice, now, name="Rolling")))


def test_the_form_asks_for_times_in_seconds(alice, now):
    race = make(alice, now, **BOTS, bot_lane_change_most_ms=7500, standing_laps=True)
    form = RaceForm(race=race, now=now)
    assert form["bot_lane_change_least_ms"].value() == "3" and form["bot_lane_change_most_ms"].value() == "7.5"
    assert form["standing_laps"].value() is True
    assert "standing_laps" in [field.name for row in form.rows() for field in row]


def test_boxes_are_listed_and_marked_where_the_simulator_has_them(alice, now):
    race = make(alice, now, **BOXES, direction="cw")
    layout = lay_out(race.track.geometry.in_direction("cw"), race_rules(race))
    assert [row["fraction"] for row in box_rows(race)] == [0.25, 0.6]
    for row, mark, placed in zip(box_rows(race), box_marks(race, numbered=True), layout.boxes, strict=True):
        assert (row["x"], row["y"]) == (round(placed.solid.x, 3), round(placed.solid.y, 3))
        assert (mark.x, mark.y, mark.yaw) == (placed.solid.x, placed.solid.y, placed.solid.yaw)
    assert [mark.number for mark in box_marks(race, numbered=True)] == [1, 2]
    assert box_marks(race)[0].title == "Box 1: 25 % of the lap, inner lane"


def test_drawn_boxes_depend_on_the_seed(alice, now):
    one, same, other = (make(alice, now, **DRAWN, seed=seed) for seed in (7, 7, 8))
    assert len(box_rows(one)) == 4
    assert box_rows(one) == box_rows(same) != box_rows(other)


@pytest.mark.parametrize(
    ("options", "refused"),
    [
        ({"race_type": "object_avoidance"}, {"boxes": "race_needs_boxes"}),
        (BOXES | {"random_boxes": 2}, {"random_boxes": "race_boxes_fixed_or_random"}),
        ({"boxes": TWO_BOXES}, {"boxes": "race_has_no_boxes"}),
        ({"random_boxes": 1}, {"random_boxes": "race_has_no_boxes"}),
        (BOTS | {"random_boxes": 1}, {"random_boxes": "race_has_no_boxes"}),
        (DRAWN | {"random_boxes": 11}, {"boxes": "race_too_many_boxes"}),
        (
            BOXES | {"boxes": [{"fraction": 0.07 + n / 20, "lane": "inner"} for n in range(11)]},
            {"boxes": "race_too_many_boxes"},
        ),
        (BOXES | {"boxes": [{"fraction": 0.02, "lane": "inner"}]}, {"boxes": "race_box_place"}),
        (BOXES | {"boxes": [{"fraction": 0.95, "lane": "inner"}]}, {"boxes": "race_box_place"}),
        (BOXES | {"boxes": [{"fraction": float("nan"), "lane": "inner"}]}, {"boxes": "race_box_place"}),
        (BOXES | {"boxes": [{"fraction": 0.5, "lane": "middle"}]}, {"boxes": "race_boxes_shape"}),
        (BOXES | {"boxes": [{"fraction": "half", "lane": "inner"}]}, {"boxes": "race_boxes_shape"}),
        (BOXES | {"boxes": [{"fraction": True, "lane": "inner"}]}, {"boxes": "race_boxes_shape"}),
        (BOXES | {"boxes": [0.5]}, {"boxes": "race_boxes_shape"}),
        (BOXES | {"boxes": {"fraction": 0.5, "lane": "inner"}}, {"boxes": "race_boxes_shape"}),
        (BOXES | {"boxes": [TWO_BOXES[0]] * 2}, {"boxes": "boxes_overlap"}),
        (BOXES | {"boxes": [*TWO_BOXES, {"fraction": 0.26, "lane": "outer"}]}, {"boxes": "boxes_overlap"}),
        (DRAWN | {"random_boxes": 10, "box_distance_m": 5.0}, {"random_boxes": "boxes_do_not_fit"}),
        (DRAWN | {"box_distance_m": 0.1}, {"box_distance_m": "race_box_distance"}),
        ({"race_type": "head_to_head"}, {"opponents": "race_needs_opponents"}),
        ({"opponents": "bots"}, {"opponents": "race_has_no_opponents"}),
        ({"bots": 2}, {"bots": "race_has_no_opponents"}),
        (BOXES | {"duel_format": "bracket"}, {"duel_format": "race_has_no_opponents"}),
        (BOTS | {"bots": 0}, {"bots": "race_bot_count"}),
        (BOTS | {"bots": 7}, {"bots": "race_bot_count"}),
        (BOTS | {"bot_speed_mps": 4.5}, {"bot_speed_mps": "race_bot_speed"}),
        (BOTS | {"bot_speed_mps": 0.1}, {"bot_speed_mps": "race_bot_speed"}),
        (BOTS | {"bot_speed_mps": float("nan")}, {"bot_speed_mps": "race_bot_speed"}),
        (BOTS | {"bot_lane_change_least_ms": 400}, {"bot_lane_change_least_ms": "race_bot_change_time"}),
        (BOTS | {"bot_lane_change_most_ms": 60_001}, {"bot_lane_change_most_ms": "race_bot_change_time"}),
        (BOTS | {"bot_lane_change_least_ms": 6000}, {"bot_lane_change_most_ms": "race_bot_change_times"}),
        (BOTS | {"duel_format": "bracket"}, {"duel_format": "race_bots_have_no_duels"}),
        (MODELS | {"bots": 2}, {"bots": "race_duels_have_no_bots"}),
        (MODELS | {"duel_format": ""}, {"duel_format": "race_needs_duel_format"}),
        (MODELS | {"duel_cars": 5}, {"duel_cars": "race_duel_cars"}),
        (MODELS | {"duel_cars": 1}, {"duel_cars": "race_duel_cars"}),
    ],
)
def test_conflicting_rules_are_refused_on_the_field_to_change(alice, now, options, refused):
    said = refusal(make, alice, now, **options)
    assert refused.items() <= said.items()
    assert not Race.objects.exists()


@pytest.mark.parametrize(
    ("options", "change"),
    [
        ({}, {"boxes": TWO_BOXES}),
        ({}, {"random_boxes": 2}),
        ({}, {"bots": 1}),
        ({}, {"race_type": "object_avoidance"}),
        ({}, {"race_type": "head_to_head"}),
        (BOXES, {"random_boxes": 2}),
        (BOXES, {"boxes": []}),
        (BOXES, {"boxes": [*TWO_BOXES] * 6}),
        (BOXES, {"opponents": "bots", "bots": 2}),
        (DRAWN, {"random_boxes": 11}),
        (DRAWN, {"box_distance_m": 0.0}),
        (BOTS, {"bots": 0}),
        (BOTS, {"bots": 7}),
        (BOTS, {"bot_speed_mps": 4.1}),
        (BOTS, {"opponents": "models"}),
        (BOTS, {"opponents": ""}),
        (MODELS, {"bots": 1}),
        (MODELS, {"duel_format": ""}),
        (MODELS, {"duel_cars": 5}),
    ],
)
def test_the_database_refuses_a_contradictory_race(alice, now, options, change):
    race = make(alice, now, **options)
    with pytest.raises(IntegrityError), transaction.atomic():
        Race.objects.filter(pk=race.pk).update(**change)


def test_the_layout_is_fixed_from_the_first_submission_on(alice, bob, now):
    race = a_race(now, organiser=alice, **BOXES)
    drive(race, bob, [lap(1, 12_000)], now)
    changes = ({"boxes": TWO_BOXES[:1]}, {"race_type": "time_trial", "boxes": []}, {"seed": 3})
    for change in changes:
        assert set(refusal(edit_race, race=race, now=now, **change).values()) == {"race_has_submissions"}


def test_a_track_without_room_for_the_boxes_is_refused(alice, now):
    race = make(alice, now, **DRAWN | {"random_boxes": 8, "box_distance_m": 1.8})
    assert refusal(edit_race, race=race, now=now, box_distance_m=3.0) == {"random_boxes": "boxes_do_not_fit"}
    edit_race(race=race, now=now, name="Obstacles again")


def test_a_clone_has_the_same_layout(alice, now):
    race = make(alice, now, **BOXES)
    assert box_rows(clone_race(race=race, now=now)) == box_rows(race)


def test_the_board_shows_the_crashes_of_the_counting_run(alice, bob, now):
    race = a_race(now, organiser=alice, minimum_laps=1, **BOXES)
    slow = [lap(1, 20_000) | {"crashes": 4}, lap(2, 21_000) | {"crashes": 1}]
    quick = [lap(1, 12_000) | {"crashes": 2}, lap(2, 12_500)]
    assert drive(race, bob, slow, now).entry.crashes == 5
    assert drive(race, bob, quick, now).entry.crashes == 2


@pytest.mark.parametrize(
    ("options", "facts", "rule"),
    [
        ({}, [], None),
        (BOXES, ["2 boxes"], "2 boxes on the track, as shown on the map"),
        (DRAWN, ["4 boxes", "drawn from the seed"], "placed by the seed at least 2 m apart"),
        (
            BOTS | {"bot_lane_changes": True},
            ["3 bots at 1 m/s", "changing lanes"],
            "Bots change lanes every 3 to 5 s",
        ),
        (MODELS, ["car against car", "round robin"], "each car qualifies alone"),
        (MODELS | {"duel_cars": 4}, ["4 cars at once", "round robin"], "4 cars at a time"),
    ],
)
@override_settings(LANGUAGE_CODE="en")
def test_a_race_describes_its_layout_in_words(alice, now, options, facts, rule):
    race = make(alice, now, **options)
    assert layout_facts(race) == facts
    told = " ".join(layout_rules(race))
    assert rule in told if rule else not told
    assert "%" not in told


def test_without_resets_a_crash_ends_the_run(alice, now):
    rules = layout_rules(make(alice, now, **BOXES, max_resets=0))
    assert rules[-1] == "A crash is a fault like leaving the track, and ends the run."
