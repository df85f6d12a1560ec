"""Addresses of replays."""

from django.urls import path

from . import reference, views

urlpatterns = [
    path("evaluations/<str:public_id>/replay/", views.replay, name="replay"),
    path("evaluations/<str:public_id>/compare/", views.compare_before, name="evaluation_compare"),
    path("evaluations/<str:public_id>/compare/<str:other_id>/", views.compare_before, name="evaluation_compared"),
    path("evaluations/<str:public_id>/replay.json", views.evaluation_replay, name="evaluation_replay"),
    path("tracks/<slug:slug>/reference/", reference.track_reference, name="track_reference"),
    path("tracks/<slug:slug>/reference/replay.json", reference.track_reference_replay, name="track_reference_replay"),
    path("tracks/<slug:slug>/scene.json", views.track_scene, name="track_scene"),
]
