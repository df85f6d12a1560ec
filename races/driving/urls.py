"""The address of driving a track oneself."""

from django.urls import path

from . import views

urlpatterns = [path("tracks/<slug:slug>/drive/", views.drive, name="track_drive")]
