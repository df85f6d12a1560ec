"""Shows the refusals of services: beside a form, or on the next page."""

from collections.abc import Iterator
from contextlib import contextmanager

from django import forms
from django.contrib import messages
from django.http import HttpRequest
from django.utils.html import format_html
from django.utils.safestring import SafeString

from core.forms import add_fault, explain
from paddock.errors import PaddockError, UserFault

from .form_nonce import release


def fault_text(fault: PaddockError) -> SafeString:
    """The fault's sentence; programs find its code in ``data-code``."""
    return format_html('<span data-code="{}">{}</span>', fault.code, explain(fault))


def report_fault(request: HttpRequest, fault: PaddockError) -> None:
    """Show a refusal at the top of the next page: its sentence."""
    messages.error(request, fault_text(fault))


@contextmanager
def faults_reported(request: HttpRequest) -> Iterator[None]:
    """Show a refusal inside the block at the top of the next page. A PlatformFault passes, and becomes a 503."""
    try:
        yield
    except UserFault as fault:
        report_fault(request, fault)


@contextmanager
def faults_shown(form: forms.BaseForm, field: str | None = None, *, nonce: str = "") -> Iterator[None]:
    """Show a refusal inside the block beside the form, or its field, and allow the ``nonce`` of the form again."""
    try:
        yield
    except (UserFault, forms.ValidationError) as refused:
        if nonce:
            release(nonce)
        if isinstance(refused, UserFault):
            add_fault(form, refused, field)
        elif field is None and hasattr(refused, "error_dict"):
            for name, errors in refused.error_dict.items():
                form.add_error(name if name in form.fields else None, errors)
        else:
            form.add_error(field, refused.messages)
