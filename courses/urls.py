"""Addresses of the pages of courses."""

from django.urls import path

from .classes import views as classes

urlpatterns = [
    path("classes/", classes.classrooms, name="classrooms"),
    path("classes/<slug:slug>/", classes.classroom, name="classroom"),
    path("class/", classes.class_log_in, name="class_log_in"),
    path("class/<str:code>/", classes.class_log_in, name="class_code"),
]
