"""Addresses of the track pages."""

from django.urls import path

from . import views

urlpatterns = [
    path("tracks/", views.tracks, name="tracks"),
    path("tracks/import/", views.import_track_page, name="track_import"),
    path("tracks/<slug:slug>/", views.track, name="track"),
]
