"""Addresses of LTI: for platforms, for people who come from them, and for admins and teachers."""

from django.urls import path

from . import views

urlpatterns = [
    path("lti/log-in/", views.begin, name="lti_log_in"),
    path("lti/launch/", views.launch, name="lti_launch"),
    path("lti/choose/", views.launch, name="lti_choose"),
    path("lti/arrival/", views.arrival, name="lti_arrival"),
    path("lti/keys.json", views.key_set, name="lti_keys"),
    path("lti/tool.json", views.tool, name="lti_tool"),
    path("lti/", views.setup, name="lti"),
    path("classes/<slug:slug>/lti/", views.courses_of_class, name="class_lti"),
]
