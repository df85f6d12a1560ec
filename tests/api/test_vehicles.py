"""Vehicles through the API: what they are made of, and whose they are."""

from __future__ import annotations

import pytest

from training.models import Vehicle
from training.vehicles.services import VEHICLES_PER_RACER, save_vehicle

pytestmark = pytest.mark.django_db
ADDRESS = "/api/v1/vehicles/"
IN_STEPS = "DISCRETIZED_SECTOR_LIDAR"


@pytest.fixture
def vehicle(alice) -> Vehicle:
    looks = {"sensors": ["FRONT_FACING_CAMERA"], "lidar_config": {}, "shell": "paddock", "colour": "#3b82f6"}
    return save_vehicle(owner=alice, name="Bolt", neural_network="DEEP_CONVOLUTIONAL_NETWORK_SHALLOW", **looks)


def test_a_vehicle_can_be_added_read_changed_and_deleted(alice, as_racer):
    client = as_racer(alice)
    added = client.post(ADDRESS, {"name": "Bolt", "sensors": [IN_STEPS, "STEREO_CAMERAS"], "colour": "#AABBCC"})
    assert added.status_code == 201, added.data
    assert (added.data["sensors"], added.data["colour"]) == (["STEREO_CAMERAS", IN_STEPS], "#aabbcc")
    assert added.data["lidar_config"] == {"num_sectors": 8, "num_values_per_sector": 8, "clipping_dist": 2.0}
    one = f"{ADDRESS}{added.data['public_id']}/"
    changed = client.patch(one, {"lidar_config": {"num_sectors": 16}})
    assert changed.data["lidar_config"] == {"num_sectors": 16, "num_values_per_sector": 8, "clipping_dist": 2.0}
    assert changed.data["name"] == "Bolt"
    assert client.patch(one, {"sensors": ["FRONT_FACING_CAMERA"]}).data["lidar_config"] == {}
    assert client.get(one).data == client.get(ADDRESS).data["results"][0]
    assert client.delete(one).status_code == 204 and not Vehicle.objects.exists()


def test_omitted_fields_default_as_on_the_page(alice, as_racer):
    made = as_racer(alice).post(ADDRESS, {"name": "Plain"}).data
    assert made["sensors"] == ["FRONT_FACING_CAMERA"] and made["lidar_config"] == {}
    assert made["neural_network"] == Vehicle().neural_network and made["shell"] == Vehicle().shell


@pytest.mark.parametrize(
    ("sent", "status", "code"),
    [
        ({}, 400, "invalid"),
        ({"name": "x" * 65}, 400, "invalid"),
        ({"name": "a\x00b"}, 400, "invalid"),
        ({"name": "x", "sensors": []}, 400, "vehicle_sensors"),
        ({"name": "x", "sensors": ["LIDAR"]}, 400, "vehicle_sensors"),
        ({"name": "x", "sensors": ["FRONT_FACING_CAMERA", "STEREO_CAMERAS"]}, 400, "vehicle_sensors"),
        ({"name": "x", "sensors": ["SONAR"]}, 400, "invalid"),
        ({"name": "x", "lidar_config": {"num_sectors": 8}}, 400, "vehicle_lidar"),
        ({"name": "x", "sensors": ["STEREO_CAMERAS", IN_STEPS], "lidar_config": {"num_sectors": 7}}, 400, "invalid"),
        ({"name": "x", "sensors": ["STEREO_CAMERAS", IN_STEPS], "lidar_config": {"clipping_dist": 99}}, 400, "invalid"),
        ({"name": "x", "colour": "blue"}, 400, "invalid"),
        ({"name": "x", "wheels": 6}, 400, "invalid"),
        ({"name": "Bolt"}, 409, "vehicle_name_taken"),
    ],
)
def test_an_invalid_vehicle_is_refused_with_its_code(alice, as_racer, vehicle, sent, status, code):
    answer = as_racer(alice).post(ADDRESS, sent)
    assert (answer.status_code, answer.data["code"]) == (status, code)
    assert Vehicle.objects.count() == 1


def test_a_full_garage_refuses_another_vehicle(alice, as_racer, vehicle):
    Vehicle.objects.bulk_create(Vehicle(owner=alice, name=f"v{number}") for number in range(VEHICLES_PER_RACER - 1))
    answer = as_racer(alice).post(ADDRESS, {"name": "one more"})
    assert (answer.status_code, answer.data["code"]) == (409, "vehicle_limit")


def test_only_its_owner_may_use_a_vehicle(cast, vehicle):
    one = f"{ADDRESS}{vehicle.public_id}/"
    for role, client in cast.items():
        expected = {"owner": 200, "anonymous": 401}.get(role, 404)
        assert client.get(one).status_code == expected, role
        assert client.patch(one, {"shell": "paddock"}).status_code == expected, role
        assert role == "owner" or client.delete(one).status_code == expected, role
        assert role == "anonymous" or len(client.get(ADDRESS).data["results"]) == (role == "owner"), role
    assert cast["anonymous"].get(ADDRESS).status_code == cast["anonymous"].post(ADDRESS, {}).status_code == 401
    assert Vehicle.objects.filter(pk=vehicle.pk).exists()
