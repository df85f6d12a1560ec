"""The filter of the audit log."""

from collections.abc import Iterable
from operator import itemgetter
from typing import Any

from django import forms
from django.utils.translation import gettext_lazy as _

from core.audit.acts import ACTS

from .selectors import AuditFilter

_LARGEST = 2**63 - 1


class AuditForm(forms.Form):
    actor = forms.CharField(label=_("Actor"), max_length=64, required=False, help_text=_("An alias, or # and an id."))
    action = forms.ChoiceField(label=_("Action"), required=False)
    target = forms.CharField(
        label=_("Target"), max_length=130, required=False, help_text=_("An address, such as that of a race.")
    )
    since = forms.DateField(label=_("From"), required=False, widget=forms.DateInput({"type": "date"}, "%Y-%m-%d"))
    until = forms.DateField(label=_("To"), required=False, widget=forms.DateInput({"type": "date"}, "%Y-%m-%d"))
    before = forms.IntegerField(required=False, min_value=1, max_value=_LARGEST, widget=forms.HiddenInput)

    def __init__(self, *args: Any, acts: Iterable[str] = ACTS, **kwargs: Any) -> None:
        """``acts``: the names of those to choose from."""
        super().__init__(*args, **kwargs)
        field = self.fields["action"]
        assert isinstance(field, forms.ChoiceField)
        known = ((name, str(ACTS[name].label)) for name in acts if name in ACTS)
        field.choices = [("", _("any")), *sorted(known, key=itemgetter(1))]

    def filter(self) -> AuditFilter:
        """What was asked for; everything where the form is not valid."""
        if not self.is_valid():
            return AuditFilter()
        sent = self.cleaned_data
        return AuditFilter(sent["actor"].strip(), sent["action"], sent["target"].strip(), sent["since"], sent["until"])
