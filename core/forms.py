"""How forms show the faults of services and the fields that were ignored."""

import re
from collections import ChainMap
from collections.abc import Iterable, Mapping
from copy import deepcopy
from datetime import datetime

from django import forms
from django.contrib import messages
from django.http import HttpRequest, QueryDict
from django.utils.datastructures import MultiValueDict
from django.utils.translation import gettext, gettext_noop

from paddock.errors import PaddockError

from .times import for_the_reader

# Details of faults that are words of ours (paddock.geometry.checks); any other text in a detail is somebody's own.
WORDS = frozenset({gettext_noop("centre line"), gettext_noop("inner border"), gettext_noop("outer border")})
# What our pages send beside the fields of a form.
BESIDE_FIELDS = frozenset({"csrfmiddlewaretoken", "once", "next", "do"})
MOST_NAMED, LONGEST_NAME = 20, 64
# A field of several inputs: opens_at_0, boxes-1-percent, randomised-on.
_PART = re.compile(r"(_\d+|-\d+-[a-z]+|-on|-clear)\Z")
LABEL = "label"


def explain(fault: PaddockError) -> str:
    """The fault's sentence in the reader's language, details filled in. The detail ``label`` is a field's label."""
    params: dict[str, object] = {
        key: gettext(str(value)) if key == LABEL or value in WORDS else for_the_reader(value)
        for key, value in fault.params.items()
    }
    return fault.reason.render(params, gettext(fault.reason.sentence))


def number_sent(request: HttpRequest, name: str) -> int:
    """A row's number as a page sends it; 0, which no row has, for any other text."""
    text = request.POST.get(name, "")
    return int(text) if text.isdecimal() and len(text) < 18 else 0


def add_fault(form: forms.BaseForm, fault: PaddockError, field: str | None = None) -> None:
    """Show what a service refused: its sentence and its stable code, beside the form or one of its fields."""
    named = getattr(getattr(fault, "errors", None), "error_dict", {})
    field = field or next((name for name in named if name in form.fields), None)
    form.add_error(field, forms.ValidationError(explain(fault), code=fault.code))


def unknown_fields(data: Mapping[str, object], known: Iterable[str]) -> list[str]:
    """The names in ``data`` that belong to none of the ``known`` fields, each once and without the endings of parts."""
    fields = {*known, *BESIDE_FIELDS}
    sent = {name: _PART.sub("", name) for name in data}
    return list(dict.fromkeys(base for name, base in sent.items() if not fields & {name, base}))


class FieldsOnDemand(dict[str, forms.Field]):
    """The fields of a form's class. A form copies those that it is asked for: a page may show few of many."""

    def __deepcopy__(self, memo: object) -> "_Copies":
        return _Copies({}, self)


class _Copies(ChainMap[str, forms.Field]):
    def __getitem__(self, name: str) -> forms.Field:
        own, of_class = self.maps
        if name not in own:
            own[name] = deepcopy(of_class[name])
        return own[name]


def ignored_fields(form: forms.BaseForm) -> list[str]:
    """The names of what was sent and not taken: fields that the form lacks, and other values of disabled ones."""
    disabled = [name for name, field in form.fields.items() if field.disabled and _asks_for_change(form, name)]
    return [*unknown_fields(form.data, form.fields), *disabled]


def say_saved(request: HttpRequest, form: forms.BaseForm, *, ignored: Iterable[str] | None = None) -> None:
    """Tell that a form was saved, and which sent fields were not taken (of the form itself, unless ``ignored``)."""
    messages.success(request, gettext("Saved."))
    warn_of_ignored(request, ignored_fields(form) if ignored is None else ignored)


def warn_of_ignored(request: HttpRequest, names: Iterable[str]) -> None:
    """Name the fields that were sent and not taken; nothing for none."""
    shown = [name[:LONGEST_NAME] for name in names]
    if shown:
        listed = ", ".join(shown[:MOST_NAMED]) + (" …" if len(shown) > MOST_NAMED else "")
        messages.warning(
            request, gettext("Not changed, because this form cannot set it: %(fields)s.") % {"fields": listed}
        )


def same_value(before: object, after: object) -> bool:
    """Whether two values look the same in a form: line ends and fractions of a second do not count."""
    if isinstance(before, str) and isinstance(after, str):
        return before.replace("\r\n", "\n") == after.replace("\r\n", "\n")
    if isinstance(before, datetime) and isinstance(after, datetime):
        return before.replace(microsecond=0) == after.replace(microsecond=0)
    return before == after


def _asks_for_change(form: forms.BaseForm, name: str) -> bool:
    field, data = form.fields[name], form.data
    assert isinstance(data, QueryDict | dict)
    prefixed = form.add_prefix(name)
    if field.widget.value_omitted_from_data(data, form.files, prefixed) or not any(
        key == prefixed or _PART.sub("", key) == prefixed for key in data
    ):
        return False
    return differs(field, form.get_initial_for_field(field, name), data, prefixed)


def differs(field: forms.Field, shown: object, data: Mapping[str, object], name: str) -> bool:
    """Whether another value of a field was sent than its page shows, whether the field is disabled or not."""
    sent = field.widget.value_from_datadict(data, MultiValueDict(), name)
    try:
        if same_value(field.to_python(sent), shown):
            return False
    except forms.ValidationError:
        return True
    disabled, field.disabled = field.disabled, False
    try:
        return field.has_changed(shown, sent)
    finally:
        field.disabled = disabled
