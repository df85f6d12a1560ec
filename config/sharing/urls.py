"""Addresses for crawlers and other sites."""

from django.urls import path

from . import views

urlpatterns = [
    path("cards/<slug:language>/<slug:kind>/<str:shared>.png", views.card, name="card"),
    path("embed/<slug:kind>/<str:shared>/", views.embed, name="embed"),
    path("oembed/", views.oembed, name="oembed"),
    path("robots.txt", views.robots, name="robots"),
    path("sitemap.xml", views.sitemaps, name="sitemaps"),
    path("sitemap-<slug:section>.xml", views.sitemap, name="sitemap"),
]
