"""Addresses of the garage. Those of evaluations are in races.urls, because access depends on the race."""

from django.urls import path

from .garage import views
from .reports import views as reports

urlpatterns = [
    path("models/", views.models, name="models"),
    path("models/upload/", views.model_upload, name="model_upload"),
    path("models/<str:public_id>/", views.model, name="model"),
    path("models/<str:public_id>/sensors.png", views.model_sensors, name="model_sensors"),
    path("models/<str:public_id>/package.zip", views.model_package, name="model_package"),
    path("models/<str:public_id>/export/<str:form>/", views.model_export, name="model_export"),
    path("models/<str:public_id>/uploaded/", views.model_uploaded, name="model_uploaded"),
    path("models/<str:public_id>/share/", views.model_share, name="model_share"),
    path("models/<str:public_id>/edit/", views.model_edit, name="model_edit"),
    path("models/<str:public_id>/delete/", views.model_delete, name="model_delete"),
    path("reports/", reports.reports, name="reports"),
    path("reports/new/", reports.report_new, name="report_new"),
    path("reports/<str:public_id>/", reports.report, name="report"),
    path("reports/<str:public_id>/live/", reports.report_live, name="report_live"),
    path("reports/<str:public_id>/stop/", reports.report_stop, name="report_stop"),
    path("reports/<str:public_id>/again/", reports.report_again, name="report_again"),
    path("reports/<str:public_id>/delete/", reports.report_delete, name="report_delete"),
]
