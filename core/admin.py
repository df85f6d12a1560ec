"""Base classes of admin pages."""

from copy import copy
from datetime import datetime
from typing import Any

from django.contrib.admin import ModelAdmin, RelatedFieldListFilter
from django.contrib.admin.helpers import ACTION_CHECKBOX_NAME
from django.core.exceptions import FieldDoesNotExist
from django.db.models import Field, Model
from django.forms import ModelForm
from django.http import HttpRequest
from django.utils.html import format_html
from django.utils.safestring import SafeString
from django.utils.translation import gettext as _

from .forms import same_value, unknown_fields, warn_of_ignored
from .streams.shared_pieces import shared_value

_BUTTONS = frozenset({"_save", "_continue", "_addanother", "_saveasnew", "_popup", "_to_field"})


class SharedChoices(RelatedFieldListFilter):
    """A filter by a related row, whose choices are read once for all admins."""

    def field_choices(self, field: Any, request: HttpRequest, model_admin: ModelAdmin) -> Any:
        choices = super().field_choices
        return shared_value(("filter", str(field)), lambda: choices(field, request, model_admin))


class ShortLists(ModelAdmin):
    """Pages of a list are short, because Django's templates take a millisecond a row."""

    list_per_page = 25
    show_full_result_count = False  # the same count once more, unless the list is filtered

    def action_checkbox(self, obj: Model) -> SafeString:
        """As Django's, which renders a template for each row."""
        label = format_html(_("Select this object for an action - {}"), obj)
        box = '<input type="checkbox" name="{}" value="{}" class="action-select" aria-label="{}">'
        return format_html(box, ACTION_CHECKBOX_NAME, obj.pk, label)


class ComparedChanges(ShortLists):
    """The log names the fields whose values have changed, and the page those that were sent and not taken."""

    def get_object(self, request: HttpRequest, object_id: str, from_field: Any = None) -> Any:
        """As Django's; remembers what is stored before the form writes into the row."""
        found = super().get_object(request, object_id, from_field)
        request.stored_row = copy(found)  # type: ignore[attr-defined]
        return found

    def save_form(self, request: HttpRequest, form: ModelForm, change: bool) -> Any:
        """As Django's; a moment that nobody moved keeps its fraction of a second, which the form does not show."""
        row = super().save_form(request, form, change)
        stored = getattr(request, "stored_row", None)
        for name in form.fields if change else ():
            before = None if stored is None else _value(stored, name)
            if isinstance(before, datetime) and same_value(before, getattr(row, name)):
                setattr(row, name, before)
        return row

    def construct_change_message(self, request: HttpRequest, form: Any, formsets: Any, add: bool = False) -> Any:
        """As Django's, of a form that knows what has changed."""
        stored = getattr(request, "stored_row", None)
        if not add and stored is not None:
            form.__dict__["changed_data"] = request.changed_names = _changed(form, stored)  # type: ignore[attr-defined]
            if not getattr(request, "is_refused", False):
                self._warn(request, form, formsets, stored)
        return super().construct_change_message(request, form, formsets, add)

    def _warn(self, request: HttpRequest, form: ModelForm, formsets: Any, stored: Model) -> None:
        beside = tuple(f"{each.prefix}-" for each in formsets or ())
        sent = {
            name: value
            for name, value in request.POST.items()
            if name not in _BUTTONS and not name.startswith(("initial-", *beside))
        }
        shown = {name for name in sent if str(_value(stored, name)) == sent[name]}
        warn_of_ignored(request, unknown_fields(sent, {*form.fields, *shown}))


def _changed(form: ModelForm, stored: Model) -> list[str]:
    """The fields whose values differ from the stored row; for fields without a column the form decides."""
    now = type(stored)._base_manager.filter(pk=stored.pk).first() or form.instance
    names = []
    for name in form.fields:
        column = _column(stored, name)
        if column is not None:
            changed = not same_value(getattr(stored, column.attname), getattr(now, column.attname))
        elif name not in {field.name for field in stored._meta.many_to_many} and hasattr(
            stored, name
        ):  # a rule that has no column
            changed = not same_value(getattr(stored, name), getattr(now, name))
        else:
            changed = name in form.changed_data and not form.fields[name].widget.is_hidden
        if changed:
            names.append(name)
    return names


def _column(row: Model, name: str) -> Field | None:
    try:
        field = row._meta.get_field(name)
    except FieldDoesNotExist:
        return None
    return field if isinstance(field, Field) and field.concrete and not field.many_to_many else None


def _value(row: Model, name: str) -> object:
    column = _column(row, name)
    return None if column is None else getattr(row, column.attname)


class ReadOnly:
    """Rows that come from racing and are looked at here. Actions ask for the change permission themselves."""

    model: type[Model]  # of the admin page that this is mixed into
    show_full_result_count = False

    def has_add_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        return False

    def has_change_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        return False

    def has_delete_permission(self, request: HttpRequest, obj: Any = None) -> bool:
        return False

    def has_steward_permission(self, request: HttpRequest) -> bool:
        """Whether the admin may act on these rows."""
        return request.user.has_perm(f"{self.model._meta.app_label}.change_{self.model._meta.model_name}")
