"""Addresses of the API of courses."""

from django.urls import path

from .assignments import api as assignments
from .attempts import api as attempts
from .classes import api as classes
from .marks import api as marks

ASSIGNMENT = "assignments/<slug:public_id>/"

urlpatterns = [
    path("classes/", classes.ClassesView.as_view(), name="api-classes"),
    path("classes/<slug:slug>/", classes.ClassView.as_view(), name="api-class"),
    path("classes/<slug:slug>/learners/", classes.LearnersView.as_view(), name="api-learners"),
    path("classes/<slug:slug>/learners/<slug:alias>/", classes.LearnerView.as_view(), name="api-learner"),
    path("classes/<slug:slug>/codes/", classes.CodesView.as_view(), name="api-class-codes"),
    path("classes/<slug:slug>/teachers/", classes.TeachersView.as_view(), name="api-teachers"),
    path("classes/<slug:slug>/teachers/<slug:alias>/", classes.TeacherView.as_view(), name="api-teacher"),
    path("assignments/", assignments.AssignmentsView.as_view(), name="api-assignments"),
    path(ASSIGNMENT, assignments.AssignmentView.as_view(), name="api-assignment"),
    path(
        "assignments/<slug:public_id>/publication/",
        assignments.PublicationView.as_view(),
        name="api-assignment-publication",
    ),
    path(f"{ASSIGNMENT}extensions/", assignments.ExtensionsView.as_view(), name="api-extensions"),
    path(
        "assignments/<slug:public_id>/extensions/<slug:alias>/",
        assignments.ExtensionView.as_view(),
        name="api-extension",
    ),
    path(
        "assignments/<slug:public_id>/groups/", assignments.SubmissionGroupsView.as_view(), name="api-submission-groups"
    ),
    path(
        "assignments/<slug:public_id>/groups/<int:number>/",
        assignments.SubmissionGroupView.as_view(),
        name="api-submission-group",
    ),
    path(f"{ASSIGNMENT}attempts/", attempts.AttemptsView.as_view(), name="api-attempts"),
    path(f"{ASSIGNMENT}references/", attempts.ReferencesView.as_view(), name="api-references"),
    path(
        "assignments/<slug:public_id>/references/<int:number>/",
        attempts.ReferenceView.as_view(),
        name="api-reference-row",
    ),
    path(f"{ASSIGNMENT}marks/", marks.MarksView.as_view(), name="api-marks"),
    path(f"{ASSIGNMENT}regrades/", marks.RegradesView.as_view(), name="api-regrades"),
    path(
        "assignments/<slug:public_id>/regrades/<int:number>/application/",
        marks.RegradeApplicationView.as_view(),
        name="api-regrade-application",
    ),
    path("attempts/<slug:public_id>/", attempts.AttemptView.as_view(), name="api-attempt"),
    path("attempts/<slug:public_id>/refund/", attempts.RefundView.as_view(), name="api-attempt-refund"),
]
