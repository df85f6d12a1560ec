"""Shells and colours: what a car looks like in pages."""

from __future__ import annotations

import itertools
import re

import pytest
from django.db import IntegrityError, transaction

from evaluation.appearance.looks import Shell, VehicleLook, _distance, distinguish_looks
from evaluation.appearance.shells import FROM_ABOVE, FROM_THE_SIDE
from evaluation.garage.services import describe_model
from evaluation.templatetags.looks import shell_from_above
from paddock.errors import UserFault
from tests.factories import a_model, a_racer


@pytest.mark.parametrize("shell", Shell.values)
def test_every_shell_fits_its_bounds_in_both_drawings(shell):
    side, above = FROM_THE_SIDE[shell], FROM_ABOVE[shell]
    for path in (side.body, side.glass, side.dark, above.body, above.glass, above.dark, above.under):
        assert re.fullmatch(r"[MLHVQTZ0-9 .-]*", path), path
    numbers = [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?", above.body + above.under)]
    assert min(numbers) >= -62 and max(numbers) <= 62


def test_no_two_shells_look_the_same():
    assert len({drawing.body for drawing in FROM_THE_SIDE.values()}) == len(Shell)
    assert len({(one.body, one.glass, one.dark, one.under) for one in FROM_ABOVE.values()}) == len(Shell)


def test_similar_cars_of_one_run_get_different_colours():
    looks = [
        VehicleLook("van", "#3b82f6"),
        VehicleLook("kart", "#3b82f6"),
        VehicleLook("van", "#4080ff"),
        VehicleLook("hatch", "#111111"),
    ]
    worn = distinguish_looks(looks)
    assert [look.shell for look in worn] == ["van", "kart", "van", "hatch"]
    assert worn[0] == looks[0] and worn[3] == looks[3]
    assert all(_distance(one.colour, two.colour) >= 120 for one, two in itertools.combinations(worn, 2))


def test_different_cars_wear_what_their_racers_chose():
    looks = [VehicleLook("van", "#ff0000"), VehicleLook("van", "#00ff00"), VehicleLook("van", "#0000ff")]
    assert distinguish_looks(looks) == looks


def test_a_colour_cannot_inject_markup_into_a_page():
    assert "<script>" not in shell_from_above("van", '"/><script>')


@pytest.mark.django_db
def test_a_new_look_changes_nothing_else():
    model = a_model(a_racer("alice"))
    described = describe_model(model=model, name=model.name, description="", look=VehicleLook("kart", "#00ff00"))
    described.refresh_from_db()
    assert described.look == ("kart", "#00ff00")
    describe_model(model=model, name="Other", description="")
    model.refresh_from_db()
    assert model.look == ("kart", "#00ff00")


@pytest.mark.django_db
@pytest.mark.parametrize(
    "look", [VehicleLook("tank", "#00ff00"), VehicleLook("kart", "red"), VehicleLook("kart", "#00FF00\n")]
)
def test_service_and_database_refuse_an_unknown_look(look):
    model = a_model(a_racer("alice"))
    with pytest.raises(UserFault) as refusal:
        describe_model(model=model, name=model.name, description="", look=look)
    assert refusal.value.code == "model_look"
    model.shell, model.colour = look.shell, look.colour[:7]
    if look.colour[:7] != look.colour:
        return
    with pytest.raises(IntegrityError), transaction.atomic():
        model.save()
