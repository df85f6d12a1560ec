"""Names of a deleted account in what others wrote: replaced where they are names, and nowhere else."""

from __future__ import annotations

import json

import pytest
from django.utils import timezone

from core.personal_data.erasing import PEOPLE, _without
from core.personal_data.rules import Leaving


def without(value: object, *names: str, is_json: bool = True) -> object:
    return _without(value, Leaving(None, timezone.now(), frozenset(names), "deleted-racer-7"), is_json)


@pytest.mark.parametrize("key", sorted(PEOPLE))
def test_an_alias_under_a_key_for_people_is_replaced_in_any_case(key):
    assert without({key: "LAP", "kind": "lap"}, "Lap") == {key: "deleted-racer-7", "kind": "lap"}


def test_values_that_only_look_like_the_alias_stay():
    data = {"kind": "lap", "track": "reinvent_base", "then": ["open", {"state": "not"}], "number": 7}
    for alias in ("lap", "reinvent_base", "open", "not"):
        assert without(data, alias) == data


def test_lists_of_racers_lose_the_name():
    assert without({"racers": ["alice", "bob"]}, "bob") == {"racers": ["alice", "deleted-racer-7"]}


def test_addresses_and_e_mail_addresses_are_replaced_anywhere():
    value = {"path": "/racers/bob/", "to": "bob@example.org", "text": "Write to bob@example.org, not to bobby."}
    assert without(value, "bob", "bob@example.org") == {
        "path": "/racers/deleted-racer-7/",
        "to": "deleted-racer-7",
        "text": "Write to deleted-racer-7, not to bobby.",
    }


def test_a_name_in_running_text_is_replaced_as_a_word():
    assert without("bob, not bobby, cut the bend of bob.", "bob", is_json=False) == (
        "deleted-racer-7, not bobby, cut the bend of deleted-racer-7."
    )


@pytest.mark.parametrize("alias", ["not", "Not", "the", "lap"])
def test_nobody_rewrites_a_steward_by_the_choice_of_an_alias(alias):
    text = f"The car did {alias} leave the lap."
    assert without(text, alias, is_json=False) == text
    assert without({"reason": text}, alias) == {"reason": text}


def test_the_text_of_a_sent_message_is_json_whose_keys_stay():
    body = json.dumps({"racer": "racer", "text": "bob leads", "bob": 1})
    assert json.loads(without(body, "bob", is_json=False)) == {
        "racer": "racer",
        "text": "deleted-racer-7 leads",
        "bob": 1,
    }
    assert json.loads(without(body, "racer", is_json=False))["racer"] == "deleted-racer-7"
