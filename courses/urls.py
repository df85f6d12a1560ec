"""Addresses of the pages of courses."""

from django.conf import settings
from django.urls import include, path

from .assignments import views as assignments
from .attempts import views as attempts
from .classes import views as classes
from .marks import views as marks

urlpatterns = [
    path("classes/", classes.classrooms, name="classrooms"),
    path("classes/<slug:slug>/", classes.classroom, name="classroom"),
    path("class/", classes.class_log_in, name="class_log_in"),
    path("class/<str:code>/", classes.class_log_in, name="class_code"),
    path("assignments/", attempts.assignments, name="assignments"),
    path("assignments/new/", assignments.assignment_new, name="assignment_new"),
    path("assignments/copy/<slug:slug>/", assignments.assignments_copy, name="assignments_copy"),
    path("assignments/of/<slug:slug>/marks.csv", marks.group_marks, name="group_marks"),
    path("assignments/of/<slug:slug>/delete/", classes.group_assignments_delete, name="group_assignments_delete"),
    path("assignments/<str:public_id>/", attempts.assignment, name="assignment"),
    path("assignments/<str:public_id>/edit/", assignments.assignment_edit, name="assignment_edit"),
    path("assignments/<str:public_id>/publish/", assignments.assignment_publish, name="assignment_publish"),
    path("assignments/<str:public_id>/delete/", assignments.assignment_delete, name="assignment_delete"),
    path("assignments/<str:public_id>/parts/new/", assignments.assignment_part, name="assignment_part_new"),
    path("assignments/<str:public_id>/parts/<int:number>/", assignments.assignment_part, name="assignment_part"),
    path("assignments/<str:public_id>/exceptions/", attempts.assignment_students, name="assignment_students"),
    path("assignments/<str:public_id>/marks/", marks.assignment_marks, name="assignment_marks"),
    path("assignments/<str:public_id>/marks.csv", marks.assignment_marks_csv, name="assignment_marks_csv"),
    path("assignments/<str:public_id>/regrade/", marks.assignment_regrade, name="assignment_regrade"),
    path("assignments/<str:public_id>/log/", assignments.assignment_log, name="assignment_log"),
    path("attempts/<str:public_id>/", attempts.attempt, name="attempt"),
    path("attempts/<str:public_id>/refund/", attempts.attempt_refund, name="attempt_refund"),
    *([path("", include("courses.lti.urls"))] if settings.LTI else []),
]
