"""The admin pages of training: read and stop, never edit."""

from django.contrib import admin
from django.db.models import QuerySet
from django.http import HttpRequest

from evaluation.admin import ReadOnlyAdmin

from .models import Checkpoint, Sweep, TrainingIteration, TrainingJob, Vehicle


@admin.register(Vehicle)
class VehicleAdmin(ReadOnlyAdmin):
    list_display = ["public_id", "name", "owner", "neural_network", "shell", "created_at"]
    search_fields = ["public_id", "name", "owner__alias"]
    list_select_related = ["owner"]


@admin.register(TrainingJob)
class TrainingJobAdmin(ReadOnlyAdmin):
    list_display = ["public_id", "name", "owner", "track", "algorithm", "state", "attempt", "steps_done", "created_at"]
    list_filter = ["state", "algorithm", "race_type"]
    search_fields = ["public_id", "name", "owner__alias"]
    list_select_related = ["owner", "track"]
    date_hierarchy = "created_at"
    exclude = ["driving"]

    def get_queryset(self, request: HttpRequest) -> QuerySet[TrainingJob]:
        return super().get_queryset(request).defer("driving", "log")


@admin.register(TrainingIteration)
class TrainingIterationAdmin(ReadOnlyAdmin):
    list_display = ["job", "number", "steps", "seconds", "mean_reward", "eval_progress", "eval_lap_ms", "is_best"]
    list_select_related = ["job"]
    search_fields = ["job__public_id", "job__name"]


@admin.register(Checkpoint)
class CheckpointAdmin(ReadOnlyAdmin):
    list_display = ["job", "iteration", "steps", "seconds", "created_at"]
    list_select_related = ["job"]
    search_fields = ["job__public_id", "job__name"]


@admin.register(Sweep)
class SweepAdmin(ReadOnlyAdmin):
    list_display = ["public_id", "name", "owner", "state", "settings_count", "budget_s", "created_at"]
    list_filter = ["state"]
    list_select_related = ["owner"]
    search_fields = ["public_id", "name", "owner__alias"]
