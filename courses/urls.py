"""Addresses of the pages of courses."""

from django.conf import settings
from django.urls import include, path

from .classes import views as classes

urlpatterns = [
    path("classes/", classes.classrooms, name="classrooms"),
    path("classes/<slug:slug>/", classes.classroom, name="classroom"),
    path("class/", classes.class_log_in, name="class_log_in"),
    path("class/<str:code>/", classes.class_log_in, name="class_code"),
    *([path("", include("courses.lti.urls"))] if settings.LTI else []),
]
