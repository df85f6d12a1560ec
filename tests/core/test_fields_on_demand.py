"""Forms that copy the fields of their class when they are asked for them."""

from __future__ import annotations

from django import forms

from core.forms import FieldsOnDemand


class Asked(forms.Form):
    name = forms.CharField(max_length=4)
    number = forms.IntegerField(required=False)


Asked.base_fields = FieldsOnDemand(Asked.base_fields)


def test_a_form_changes_its_own_fields_only() -> None:
    one, other = Asked(), Asked()
    one.fields["name"].label = "mine"
    one.fields["name"].widget.attrs["size"] = 3
    one.fields["third"] = forms.CharField()
    for fields in (other.fields, Asked.base_fields):
        assert fields["name"].label is None and "size" not in fields["name"].widget.attrs and "third" not in fields
    assert one.fields["name"] is one.fields["name"] and one["name"].field.label == "mine"


def test_fields_are_there_and_in_order_before_they_are_asked_for() -> None:
    assert list(Asked().fields) == ["name", "number"]
    assert [name for name, _field in Asked().fields.items()] == ["name", "number"]
    form = Asked({"name": "longer", "number": "x", "third": ""})
    assert set(form.errors) == {"name", "number"}
    assert Asked({"name": "four"}).is_valid()
