"""Addresses of the pages of teams."""

from django.urls import path

from . import views

urlpatterns = [
    path("teams/", views.teams, name="teams"),
    path("teams/new/", views.team_new, name="team_new"),
    path("teams/leave/", views.team_leave, name="team_leave"),
    path("teams/join/<str:code>/", views.team_join, name="team_join"),
    path("teams/<slug:slug>/", views.team, name="team"),
]
