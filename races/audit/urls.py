"""Addresses of the audit log."""

from django.urls import path

from . import views

urlpatterns = [
    path("audit/", views.audit, name="audit"),
    path("audit/export/<slug:form>/", views.audit_export, name="audit_export"),
    path("races/<slug:slug>/audit/", views.race_audit, name="race_audit"),
]
