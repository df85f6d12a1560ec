"""model_metadata.json as real files write it, with the field's defaults."""

from __future__ import annotations

import json
import time

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from paddock.errors import UserFault
from paddock.packages.metadata import ModelMetadata, parse_metadata
from tests.shared import SHARED, needs_shared
from tests.soak import examples

ACTIONS = [{"steering_angle": -30, "speed": 1.0}, {"steering_angle": "30", "speed": "0.8"}]
CONTINUOUS = {"steering_angle": {"low": -30.0, "high": 30.0}, "speed": {"low": "0.5", "high": 4}}


def parse(**data: object) -> ModelMetadata:
    return parse_metadata(json.dumps({"action_space": ACTIONS, **data}).encode())


def test_the_oldest_files_have_only_an_action_space() -> None:
    metadata = parse()
    assert metadata.version == "1"
    assert metadata.sensors == ("observation",)
    assert metadata.network == "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW"
    assert metadata.algorithm == "clipped_ppo"
    assert metadata.action_space_type == "discrete"


def test_sensors_without_a_version_mean_version_2() -> None:
    assert parse(sensor=["FRONT_FACING_CAMERA"]).version == "2"


def test_version_1_ignores_a_sensor_list() -> None:
    assert parse(version=1, sensor=["LEFT_CAMERA"]).sensors == ("observation",)


@pytest.mark.parametrize("version", ["3", 3, 3.0, "3.0"])
def test_numbers_may_be_written_as_strings(version: object) -> None:
    metadata = parse(version=version, sensor=["FRONT_FACING_CAMERA"])
    assert metadata.version == "3"
    assert metadata.actions[1] == {"steering_angle": 30.0, "speed": 0.8}


def test_case_and_blanks_do_not_matter() -> None:
    metadata = parse(action_space=CONTINUOUS, action_space_type=" Continuous", training_algorithm="SAC ")
    assert metadata.algorithm == "sac"
    assert metadata.actions["speed"] == {"low": 0.5, "high": 4.0}
    assert metadata.output_size == 2


def test_more_actions_than_a_console_offered_are_read() -> None:
    many = [{"steering_angle": angle % 60 - 30, "speed": 1 + angle % 4} for angle in range(108)]
    assert parse(action_space=many).output_size == 108
    assert parse(action_space=many * 4).output_size == 432


@needs_shared
def test_a_real_file_of_108_actions_is_read() -> None:
    assert parse_metadata((SHARED / "failing" / "14-108-actions.json").read_bytes()).output_size == 108


@pytest.mark.parametrize("name", [None, "", "TRANSFORMER", "my own network", " deep_convolutional_network_shallow "])
def test_a_networks_name_is_for_the_record_only(name: str | None) -> None:
    assert parse(neural_network=name).network == "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW"
    assert parse(neural_network="deep_convolutional_network_deep").network == "DEEP_CONVOLUTIONAL_NETWORK_DEEP"


@pytest.mark.parametrize("name", ["PPO", "ppo", None, "", "Clipped PPO", "clipped-ppo", "ClippedPPO", "CLIPPED_PPO"])
def test_an_algorithm_may_have_its_usual_name(name: str | None) -> None:
    assert parse(training_algorithm=name).algorithm == "clipped_ppo"


@pytest.mark.parametrize("missing", [{}, {"action_space_type": None}, {"action_space_type": ""}])
def test_the_form_of_the_action_space_tells_its_type(missing: dict) -> None:
    assert parse(action_space=CONTINUOUS, **missing).action_space_type == "continuous"
    assert parse(action_space=CONTINUOUS, training_algorithm="sac", **missing).algorithm == "sac"
    assert parse(**missing).action_space_type == "discrete"


def test_null_is_as_good_as_missing() -> None:
    keys = ("action_space_type", "sensor", "neural_network", "training_algorithm", "version", "lidar_config")
    assert parse(**dict.fromkeys(keys)) == parse()


def test_a_byte_order_mark_is_accepted() -> None:
    assert parse_metadata(b"\xef\xbb\xbf" + json.dumps({"action_space": ACTIONS}).encode()).output_size == 2


def test_unknown_keys_are_ignored() -> None:
    assert parse(comment="my best car", action_space=[{**ACTIONS[0], "index": 7}]).actions == (
        {"steering_angle": -30.0, "speed": 1.0},
    )


def test_actions_beyond_the_car_are_kept_for_clipping() -> None:
    assert parse(action_space=[{"steering_angle": 45, "speed": 12}]).actions[0]["speed"] == 12.0


def test_written_metadata_reads_back_the_same() -> None:
    for metadata in (
        parse(sensor=["STEREO_CAMERAS", "DISCRETIZED_SECTOR_LIDAR"], lidar_config={"num_sectors": "16"}),
        parse(action_space=CONTINUOUS, action_space_type="continuous", training_algorithm="sac"),
    ):
        again = parse_metadata(json.dumps(metadata.to_dict()).encode())
        assert again == metadata


def test_a_lidars_configuration_sets_its_width() -> None:
    metadata = parse(
        sensor=["LEFT_CAMERA", "DISCRETIZED_SECTOR_LIDAR"], lidar_config={"num_sectors": 4, "num_values_per_sector": 3}
    )
    assert [(spec.sensor, spec.shape) for spec in metadata.inputs] == [
        ("DISCRETIZED_SECTOR_LIDAR", (12,)),
        ("LEFT_CAMERA", (120, 160, 1)),
    ]


def test_identity_depends_on_actions_and_sensors_alone() -> None:
    base = parse(sensor=["LEFT_CAMERA", "LIDAR"], version=3)
    same = parse(sensor=["LIDAR", "LEFT_CAMERA"], version="5", neural_network="DEEP_CONVOLUTIONAL_NETWORK_DEEP")
    assert base.canonical_json() == same.canonical_json()
    other = parse(sensor=["LEFT_CAMERA", "LIDAR"], action_space=[*ACTIONS[:1], {"steering_angle": 30, "speed": 0.9}])
    assert base.canonical_json() != other.canonical_json()


def test_identity_depends_on_the_order_of_the_actions() -> None:
    assert parse().canonical_json() != parse(action_space=ACTIONS[::-1]).canonical_json()


@needs_shared
def test_a_real_file_is_read() -> None:
    metadata = parse_metadata((SHARED / "traces" / "a-to-z-2023-model_metadata.json").read_bytes())
    assert metadata.sensors == ("FRONT_FACING_CAMERA",)


def test_reading_time_grows_linearly_with_the_keys() -> None:
    """The site itself reads this file: what is twice must not be looked for again and again."""

    def seconds(count: int) -> float:
        text = "{" + ",".join(f'"{number:04x}": 1' for number in range(count)) + ', "zz": 1, "zz": 2}'
        started = time.process_time()
        with pytest.raises(UserFault) as fault:
            parse_metadata(text.encode())
        assert fault.value.code == "metadata_duplicate_key"
        return time.process_time() - started

    small, large = (min(seconds(count) for _ in range(5)) for count in (900, 9000))
    assert large < 40 * small


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=20), inner, max_size=4),
    max_leaves=12,
)
KEYS = [
    "action_space", "action_space_type", "sensor", "neural_network", "training_algorithm", "version", "lidar_config",
]  # fmt: skip


@settings(max_examples=examples(300), deadline=None)
@given(st.dictionaries(st.sampled_from(KEYS), json_values))
def test_nonsense_is_refused_with_a_reason(changes: dict) -> None:
    data = {"action_space": ACTIONS, "sensor": ["FRONT_FACING_CAMERA"], **changes}
    try:
        parse_metadata(json.dumps(data).encode())
    except UserFault as fault:
        assert fault.code.startswith("metadata_")
        assert str(fault)


@settings(max_examples=examples(300), deadline=None)
@given(st.binary(max_size=200))
def test_arbitrary_bytes_are_refused_with_a_reason(data: bytes) -> None:
    with pytest.raises(UserFault) as fault:
        parse_metadata(data)
    assert fault.value.code.startswith("metadata_")
