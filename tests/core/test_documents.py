"""Serializers that come from typed documents."""

from typing import Annotated, TypedDict

import pytest
from rest_framework import serializers

from core.api.documents import serializer_of


class WheelDocument(TypedDict):
    """A wheel."""

    grip: float


class Raw(TypedDict):
    x: int


class VehicleDocument(TypedDict):
    """A vehicle."""

    name: Annotated[str, "Its name."]
    colour: Annotated[str, ("red", "blue")]
    best_ms: int | None
    wheels: Annotated[list[WheelDocument], "Front first."]
    spare: WheelDocument | None
    points: list[Raw]
    times: dict[str, list[int]]


@pytest.fixture
def fields():
    return serializer_of(VehicleDocument)().fields


def test_the_serializer_is_named_and_described_after_its_document():
    made = serializer_of(VehicleDocument)
    assert (made.__name__, made.__doc__) == ("VehicleSerializer", "A vehicle.")
    assert serializer_of(VehicleDocument) is made, "one component of the schema"


def test_each_type_has_its_field(fields):
    assert isinstance(fields["name"], serializers.CharField)
    assert fields["name"].help_text == "Its name."
    assert list(fields["colour"].choices) == ["red", "blue"]
    assert isinstance(fields["best_ms"], serializers.IntegerField)
    assert fields["best_ms"].allow_null
    assert not fields["name"].allow_null
    assert isinstance(fields["wheels"].child, serializer_of(WheelDocument))
    assert fields["wheels"].help_text == "Front first."
    assert isinstance(fields["spare"], serializer_of(WheelDocument))
    assert fields["spare"].allow_null
    assert isinstance(fields["points"].child, serializers.DictField), "no document: its fields are not described"
    assert isinstance(fields["times"].child, serializers.ListField)


def test_a_document_is_written_as_it_is():
    vehicle: VehicleDocument = {
        "name": "kay",
        "colour": "red",
        "best_ms": None,
        "wheels": [{"grip": 0.5}],
        "spare": None,
        "points": [{"x": 1}],
        "times": {"kay": [1, 2]},
    }
    assert serializer_of(VehicleDocument)(vehicle).data == vehicle
