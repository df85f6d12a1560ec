"""Addresses of runs and their videos."""

from django.urls import path

from .views import camera, evaluations, videos

urlpatterns = [
    path("evaluations/<str:public_id>/", evaluations.evaluation, name="evaluation"),
    path("evaluations/<str:public_id>/live/", evaluations.evaluation_live, name="evaluation_live"),
    path("evaluations/<str:public_id>/stop/", evaluations.evaluation_stop, name="evaluation_stop"),
    path("evaluations/<str:public_id>/seen/", camera.evaluation_seen, name="evaluation_seen"),
    path("evaluations/<str:public_id>/attention/", camera.evaluation_attention, name="evaluation_attention"),
    path("evaluations/<str:public_id>/saw/", camera.evaluation_saw, name="evaluation_saw"),
    path("evaluations/<str:public_id>/trace.csv", evaluations.evaluation_trace, name="evaluation_trace"),
    path("evaluations/<str:public_id>/metrics.json", evaluations.evaluation_metrics, name="evaluation_metrics"),
    path("evaluations/<str:public_id>/logs.zip", evaluations.evaluation_logs, name="evaluation_logs"),
    path("evaluations/<str:public_id>/video/", videos.evaluation_video, name="evaluation_video"),
    path("videos/<str:public_id>/live/", videos.video_live, name="video_live"),
    path("videos/<str:public_id>/stop/", videos.video_stop, name="video_stop"),
    path("videos/<str:public_id>/video.mp4", videos.video_file, name="video_file"),
    path("videos/<str:public_id>/still.jpg", videos.video_poster, name="video_poster"),
]
