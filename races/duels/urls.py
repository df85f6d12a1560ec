"""Addresses of duels."""

from django.urls import path

from . import views

urlpatterns = [
    path("races/<slug:slug>/duels/", views.race_duels, name="race_duels"),
    path("races/<slug:slug>/duels/draw/", views.race_draw, name="race_draw"),
]
