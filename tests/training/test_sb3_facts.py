"""What ``data`` of a stable-baselines3 zip says is read in plain words, and nothing in it is opened."""

from __future__ import annotations

import json

import pytest

from paddock.errors import UserFault
from tests.hostile.policies import BOX, SAID
from training.sb3.facts import Box, read_facts

OF_TWO = (
    "{'LIDAR': Box(0.15, 1.0, (64,), float32), 'STEREO_CAMERAS': Box(0, 255, (2, 120, 160), uint8)}",
    "OrderedDict([('LIDAR', Box(0.15, 1.0, (64,), float32)), ('STEREO_CAMERAS', Box(0, 255, (2, 120, 160), uint8))])",
    "Dict(LIDAR:Box(0.15, 1.0, (64,), float32), STEREO_CAMERAS:Box(0, 255, (2, 120, 160), uint8))",
)


def said(**changes: object) -> bytes:
    return json.dumps({**SAID, **changes}).encode()


def test_a_box_is_one_observation_without_a_name():
    facts = read_facts(said())
    assert facts.observations == {"": Box((1, 120, 160), "uint8")}
    assert (facts.activation, facts.extractor, facts.normalize_images) == (None, None, True)


@pytest.mark.parametrize("spaces", OF_TWO, ids=["now", "in older versions", "in the oldest"])
def test_a_dict_keeps_the_order_of_its_parts(spaces):
    found = read_facts(said(observation_space={"spaces": spaces})).observations
    assert list(found.items()) == [("LIDAR", Box((64,), "float32")), ("STEREO_CAMERAS", Box((2, 120, 160), "uint8"))]


def test_policy_arguments_tell_layers_and_scale():
    facts = read_facts(
        said(
            policy_kwargs={
                "activation_fn": "<class 'torch.nn.modules.activation.ReLU'>",
                "features_extractor_class": "<class 'stable_baselines3.common.torch_layers.NatureCNN'>",
                "normalize_images": False,
            }
        )
    )
    assert (facts.activation, facts.extractor, facts.normalize_images) == ("ReLU", "NatureCNN", False)


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"", "sb3_unreadable"),
        (b"[]", "sb3_unreadable"),
        (b"[" * 100_000, "sb3_unreadable"),
        (b"\x80\x04cposix\nsystem\n(S'touch PWNED'\ntR.", "sb3_unreadable"),
        (said(observation_space={":serialized:": "gASVAAAA"}), "sb3_unreadable"),
        (said(observation_space={"spaces": "{'a': Box([0 1], [2 3], (2,), float32), 'a': Box()}"}), "sb3_unreadable"),
        (said(observation_space={"spaces": "'LIDAR': Box(0, 1, (64,), float32), " * 100_000}), "sb3_unreadable"),
        (said(policy_class={"__module__": "<script>"}), "sb3_custom"),
        (said(policy_class=None), "sb3_custom"),
        (said(use_sde=True), "sb3_custom"),
        (said(policy_kwargs={"activation_fn": "<class '__main__.Mine'>"}), "sb3_custom"),
        (said(policy_kwargs={"features_extractor_class": "<class '__main__.Eyes'>"}), "sb3_custom"),
        (said(action_space={":type:": "<class 'Box'>", "low": "[-30. 0.5]", "high": "[30. 4.]"}), "sb3_action_space"),
        (said(action_space={":type:": "<class 'Box'>", "low": "[nan]", "high": None}), "sb3_action_space"),
    ],
)
def test_unreadable_or_unsupported_policies_are_refused(data, code):
    with pytest.raises(UserFault) as fault:
        read_facts(data)
    assert fault.value.code == code
    assert str(fault.value).isprintable()


def test_markup_in_a_type_is_made_printable():
    facts = read_facts(said(observation_space={**BOX, "dtype": "<b>\u202e"}))
    assert facts.observations[""].dtype == "<b>?"
