"""Addresses of accounts' own pages; log-in and the like are allauth's."""

from django.urls import path

from . import views

urlpatterns = [
    path("join/<str:code>/", views.invitation, name="sign_up_invitation"),
    path("settings/usage/", views.usage, name="usage"),
    path("usage/", views.usage_of_all, name="usage_of_all"),
]
