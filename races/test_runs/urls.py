"""Addresses of test runs."""

from django.urls import path

from . import views

urlpatterns = [
    path("runs/", views.own_runs, name="own_runs"),
    path("runs/new/", views.own_new, name="own_new"),
    path("runs/layout/", views.own_layout, name="own_layout"),
    path("evaluations/<str:public_id>/again/", views.own_again, name="own_again"),
    path("evaluations/<str:public_id>/delete/", views.own_delete, name="own_delete"),
]
