"""Addresses below /api/. Version 1 only grows: nothing in it is renamed or taken away."""

from __future__ import annotations

from django.urls import include, path, re_path
from drf_spectacular.views import SpectacularJSONAPIView

from . import views

version_1 = [
    path("auth/token/", views.TokenView.as_view(), name="api-token"),
    path("me/", views.MeView.as_view(), name="api-me"),
]

urlpatterns = [
    path("v1/", include(version_1)),
    path("schema/", SpectacularJSONAPIView.as_view(), name="api-schema"),
    re_path(r"^(?P<rest>.*)$", views.UnknownAddressView.as_view()),
]
