"""Addresses of the pages of groups."""

from django.urls import path

from . import views

urlpatterns = [
    path("groups/", views.groups, name="groups"),
    path("groups/new/", views.group_new, name="group_new"),
    path("groups/join/<str:code>/", views.group_join, name="group_join"),
    path("groups/<slug:slug>/", views.group, name="group"),
    path("groups/<slug:slug>/leave/", views.group_leave, name="group_leave"),
]
