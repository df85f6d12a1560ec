"""Addresses of the site. Each room has its own pages; the API is put together here."""

from django.contrib import admin
from django.urls import include, path

urlpatterns = [
    path("admin/", admin.site.urls),
    path("accounts/", include("allauth.urls")),
    path("api/", include("league.api.urls")),
    path("i18n/", include("django.conf.urls.i18n")),
]
