"""Addresses of the track pages."""

from django.urls import path

from . import views

urlpatterns = [
    path("tracks/", views.tracks, name="tracks"),
    path("tracks/import/", views.import_track_page, name="track_import"),
    path("tracks/to-choose/", views.tracks_to_choose, name="tracks_to_choose"),
    path("tracks/<slug:slug>/", views.track, name="track"),
    path("tracks/<slug:slug>/print/", views.track_print, name="track_print"),
    path("tracks/<slug:slug>/print/<slug:form>/", views.track_file, name="track_file"),
]
