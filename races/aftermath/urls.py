"""Addresses of results and replays of live events."""

from django.urls import path

from . import views

urlpatterns = [
    path("races/<slug:slug>/event/again/", views.live_again, name="live_again"),
    path("races/<slug:slug>/event/again.json", views.live_again_data, name="live_again_data"),
    path("races/<slug:slug>/event/highlights/", views.live_highlights, name="live_highlights"),
    path("races/<slug:slug>/event/results.csv", views.live_results_csv, name="live_results_csv"),
    path("races/<slug:slug>/event/laps.csv", views.live_laps_csv, name="live_laps_csv"),
    path("races/<slug:slug>/results.pdf", views.race_results_pdf, name="race_results_pdf"),
    path("races/<slug:slug>/certificates/<str:alias>.pdf", views.race_certificate, name="race_certificate"),
]
