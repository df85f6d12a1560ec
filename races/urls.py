"""Addresses of races and of runs, by feature."""

from django.urls import include, path

from .spoilers import views as spoilers

FEATURES = (
    "pages",
    "duels",
    "live",
    "aftermath",
    "timing",
    "test_runs",
    "replays",
    "telemetry",
    "driving",
    "runs",
    "audit",
)
urlpatterns = [
    path("spoilers/", spoilers.spoilers, name="spoilers"),
    *(path("", include(f"races.{feature}.urls")) for feature in FEATURES),
]
