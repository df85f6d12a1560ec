"""Addresses of timing real cars."""

from django.urls import path

from . import views

urlpatterns = [
    path("races/<slug:slug>/timing/", views.race_timing, name="race_timing"),
    path("races/<slug:slug>/timing/worker.js", views.race_timing_worker, name="race_timing_worker"),
    path("races/<slug:slug>/timing/set-up/", views.race_timing_setup, name="race_timing_setup"),
    path("races/<slug:slug>/timing/timekeepers/", views.timekeeper_name, name="timekeeper_name"),
    path("races/<slug:slug>/timing/timekeepers/<str:alias>/", views.timekeeper_dismiss, name="timekeeper_dismiss"),
    path("races/<slug:slug>/timing/sensors/<int:number>/revoke/", views.sensor_revoke, name="sensor_revoke"),
    path("races/<slug:slug>/timing/guests/<uuid:id>/", views.guest_link, name="guest_link"),
    path("races/<slug:slug>/car/", views.car_choose, name="car_choose"),
    path("races/<slug:slug>/laps/", views.race_laps, name="race_laps"),
    path("races/<slug:slug>/laps.csv", views.race_laps_csv, name="race_laps_csv"),
    path("races/<slug:slug>/laps/<uuid:id>/correct/", views.lap_correct, name="lap_correct"),
    path("laps/<str:claim>/", views.guest_claim, name="guest_claim"),
]
