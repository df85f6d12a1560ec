"""Addresses of the API of courses."""

from django.urls import path

from .classes import api as classes

urlpatterns = [
    path("classes/", classes.ClassesView.as_view(), name="api-classes"),
    path("classes/<slug:slug>/", classes.ClassView.as_view(), name="api-class"),
    path("classes/<slug:slug>/learners/", classes.LearnersView.as_view(), name="api-learners"),
    path("classes/<slug:slug>/learners/<slug:alias>/", classes.LearnerView.as_view(), name="api-learner"),
    path("classes/<slug:slug>/codes/", classes.CodesView.as_view(), name="api-class-codes"),
    path("classes/<slug:slug>/teachers/", classes.TeachersView.as_view(), name="api-teachers"),
    path("classes/<slug:slug>/teachers/<slug:alias>/", classes.TeacherView.as_view(), name="api-teacher"),
]
