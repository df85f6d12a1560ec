"""A sensor is defined once: vehicles, races and pages have its name and label from there."""

from __future__ import annotations

import pytest

from evaluation.templatetags.garage import sensor_name
from paddock.packages.inputs import CAMERAS, LIDARS, SENSOR_NAMES, SENSORS, input_spec
from paddock.simulator.sensors import lidar_layout, sensor_spec
from races.models.sensors import OFFERABLE, SAME_AS
from races.rules.fields import rule_fields
from training.vehicles.api import SENSORS as IN_THE_API
from training.vehicles.forms import VehicleForm


def labels(field):
    return {name: str(label) for name, label in field.choices if name}


def test_the_form_of_vehicles_offers_every_lidar():
    assert labels(VehicleForm.base_fields["lidar"]) == {name: SENSORS[name].label for name in LIDARS}
    assert set(IN_THE_API) == {*labels(VehicleForm.base_fields["camera"]), *LIDARS}


def test_races_offer_every_sensor_but_an_old_name_of_another():
    assert labels(rule_fields(["sensors"])["sensors"]) == {name: SENSORS[name].label for name in OFFERABLE}
    assert {*OFFERABLE, *SAME_AS} == set(SENSOR_NAMES)


@pytest.mark.parametrize("name", SENSOR_NAMES)
def test_a_sensor_has_a_label_and_the_shape_of_its_definition(name):
    assert sensor_name(name) == SENSORS[name].label != name
    assert SENSORS[name].is_camera == input_spec(name).is_picture == (name in CAMERAS)
    assert sensor_spec(name).shape == input_spec(name).shape != ()


@pytest.mark.parametrize("name", [*CAMERAS, "RADAR"])
def test_only_a_lidar_has_sectors(name):
    with pytest.raises(ValueError, match=name):
        lidar_layout(name, {})
