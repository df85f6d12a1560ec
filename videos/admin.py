"""The admin of videos, which views, stops and deletes them."""

from django.contrib import admin, messages
from django.db.models import QuerySet
from django.http import HttpRequest
from django.template.defaultfilters import filesizeformat
from django.utils import timezone
from django.utils.translation import gettext_lazy, ngettext

from core.admin import ReadOnly

from .models import UNDER_WAY, Video
from .services import stop_video


@admin.register(Video)
class VideoAdmin(ReadOnly, admin.ModelAdmin):
    """All videos. Deleting one deletes its file."""

    list_display = (
        *("public_id", "evaluation", "car", "part", "language", "state", "attempt", "asked_by", "asked_at"),
        *("megabytes", "watched_at", "reason_code"),
    )
    list_filter = ("state", "reason_code", "language", "asked_at")
    list_select_related = ("evaluation", "asked_by")
    search_fields = ("public_id", "evaluation__public_id", "asked_by__alias", "evaluation__owner__alias")
    date_hierarchy = "asked_at"
    actions = ("stop",)
    exclude = ("file", "poster")

    def has_delete_permission(self, request: HttpRequest, obj: Video | None = None) -> bool:
        return request.user.has_perm("videos.delete_video")

    @admin.display(description=gettext_lazy("size"), ordering="size")
    def megabytes(self, video: Video) -> str:
        return filesizeformat(video.size) if video.size else ""

    @admin.action(description=gettext_lazy("Stop unfinished videos"), permissions=["delete"])
    def stop(self, request: HttpRequest, queryset: QuerySet[Video]) -> None:
        now = timezone.now()
        done = sum(stop_video(video=video, now=now) for video in queryset.filter(state__in=UNDER_WAY))
        text = ngettext("%d video was stopped.", "%d videos were stopped.", done) % done
        self.message_user(request, text, messages.SUCCESS)
