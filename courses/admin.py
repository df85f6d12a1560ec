"""The admin pages of courses: read, never edit. What is hidden from students is not shown either."""

from django.conf import settings
from django.contrib import admin

from evaluation.admin import ReadOnlyAdmin

from .models import Assignment, Attempt, Mark, Regrade


@admin.register(Assignment)
class AssignmentAdmin(ReadOnlyAdmin):
    list_display = ["public_id", "title", "group", "opens_at", "due_at", "published_at", "drawn_at", "final_at"]
    list_select_related = ["group"]
    search_fields = ["public_id", "title", "group__name"]
    exclude = ["draw_seed"]


@admin.register(Attempt)
class AttemptAdmin(ReadOnlyAdmin):
    list_display = ["public_id", "assignment", "racer", "model_name", "number", "accepted_at", "refund_kind"]
    list_filter = ["refund_kind"]
    list_select_related = ["assignment", "racer"]
    search_fields = ["public_id", "assignment__public_id", "racer__alias"]


@admin.register(Mark)
class MarkAdmin(ReadOnlyAdmin):
    list_display = ["assignment", "racer", "points", "late_days", "is_complete", "rules_version", "computed_at"]
    list_select_related = ["assignment", "racer"]
    search_fields = ["assignment__public_id", "racer__alias"]


@admin.register(Regrade)
class RegradeAdmin(ReadOnlyAdmin):
    list_display = ["assignment", "rules_version", "asked_by", "asked_at", "applied_by", "applied_at"]
    list_select_related = ["assignment", "asked_by", "applied_by"]
    search_fields = ["assignment__public_id"]


if settings.LTI:
    from .lti import admin as lti_admin  # noqa: F401  # registers its pages
