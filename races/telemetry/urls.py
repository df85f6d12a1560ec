"""Addresses of telemetry."""

from django.urls import path

from . import views

urlpatterns = [
    path("evaluations/<str:public_id>/telemetry.json", views.telemetry, name="telemetry"),
    path("evaluations/<str:public_id>/telemetry.csv", views.telemetry_csv, name="telemetry_csv"),
]
