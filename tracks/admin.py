"""The admin pages of tracks: import, describe, view; geometry never changes."""

import base64
from typing import Any

from django import forms
from django.contrib import admin
from django.db.models import QuerySet
from django.http import HttpRequest
from django.utils import timezone
from django.utils.html import format_html
from django.utils.translation import gettext
from django.utils.translation import gettext_lazy as _

from accounts.models import Racer
from accounts.request_racer import racer_of
from core.admin import ComparedChanges, ReadOnly
from core.forms import explain
from paddock.errors import UserFault
from paddock.geometry.files import MAX_BYTES

from .drawing.maps import draw_svg
from .models import ReferenceLap, Track, TrackLook
from .services import import_track


class ImportForm(forms.ModelForm):
    """A new track, from its file. What is wrong with the file stands beside it."""

    file = forms.FileField(label=_("track file (.npy)"), allow_empty_file=True)
    importer: Racer
    look = forms.ChoiceField(label=_("look"), choices=TrackLook.choices, initial=TrackLook.OFFICIAL, required=False)

    class Meta:
        model = Track
        fields = ("name", "slug", "description")

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.fields["slug"].required = False

    def _post_clean(self) -> None:
        if self.errors:
            return
        data = self.cleaned_data
        try:
            self.instance = import_track(
                data=data["file"].read(MAX_BYTES + 1),
                name=data["name"],
                owner=self.importer,
                now=timezone.now(),
                slug=data["slug"] or None,
                description=data["description"],
                look=data["look"] or TrackLook.OFFICIAL,
            )
        except UserFault as fault:
            field = {"track_name": "name", "track_slug": "slug"}.get(fault.code, "file")
            self.add_error(
                field,
                forms.ValidationError(explain(fault), fault.code),
            )


@admin.register(Track)
class TrackAdmin(ComparedChanges, admin.ModelAdmin):
    list_display = ("name", "slug", "length_m", "width_m", "direction", "is_catalogue", "owner", "created_at")
    list_filter = ("is_catalogue", "direction", "created_at")
    search_fields = ("name", "slug", "owner__alias")
    list_select_related = ("owner",)
    actions = None
    _facts = (
        "map",
        "slug",
        "length_m",
        "width_m",
        "direction",
        "look",
        "is_catalogue",
        "owner",
        "fingerprint",
        "created_at",
    )

    def get_queryset(self, request: HttpRequest) -> QuerySet[Track]:
        return super().get_queryset(request).defer("npy")

    def get_fields(self, request: HttpRequest, obj: Track | None = None) -> tuple[str, ...]:
        return ("name", "slug", "file", "description", "look") if obj is None else ("name", "description", *self._facts)

    def get_readonly_fields(self, request: HttpRequest, obj: Track | None = None) -> tuple[str, ...]:
        return () if obj is None else self._facts

    def get_form(
        self, request: HttpRequest, obj: Track | None = None, change: bool = False, **kwargs: Any
    ) -> type[forms.ModelForm]:
        if obj is not None:
            return super().get_form(request, obj, change, **kwargs)
        return type("ImportForm", (ImportForm,), {"importer": racer_of(request)})

    def save_model(self, request: HttpRequest, obj: Track, form: forms.ModelForm, change: bool) -> None:
        if change:  # a new one was saved by the service, in the transaction of this request
            super().save_model(request, obj, form, change)

    def has_delete_permission(self, request: HttpRequest, obj: Track | None = None) -> bool:
        allowed = super().has_delete_permission(request, obj)
        if obj is None:
            return allowed
        return allowed and not obj.is_catalogue and not obj.races.exists() and not obj.evaluations.exists()

    @admin.display(description=_("map"))
    def map(self, track: Track) -> str:
        if not track.has_shape:
            return gettext("not known here")
        picture = draw_svg(track.geometry, width=480, standalone=True)
        data = base64.b64encode(picture.encode()).decode()
        return format_html('<img alt="" width="480" src="data:image/svg+xml;base64,{}">', data)


@admin.register(ReferenceLap)
class ReferenceLapAdmin(ReadOnly, admin.ModelAdmin):
    list_display = ("track", "direction", "engine", "state", "time_ms", "worker", "reason_code", "ended_at")
    list_filter = ("state", "engine", "direction")
    search_fields = ("track__name", "track__slug")
    list_select_related = ("track",)

    def get_queryset(self, request: HttpRequest) -> QuerySet[ReferenceLap]:
        return super().get_queryset(request).defer("trace", "track__npy")
