"""Addresses of races and of evaluations."""

from django.urls import path

from .views import boards, duels, evaluations, organising, races, racing, videos

urlpatterns = [
    path("races/", races.races, name="races"),
    path("races/new/", organising.race_new, name="race_new"),
    path("races/layout/", organising.race_layout, name="race_layout"),
    path("races/join/<str:token>/", racing.race_invitation, name="race_invitation"),
    path("races/<slug:slug>/", races.race, name="race"),
    path("races/<slug:slug>/rules/", races.race_rules, name="race_rules"),
    path("races/<slug:slug>/duels/", duels.race_duels, name="race_duels"),
    path("races/<slug:slug>/duels/draw/", duels.race_draw, name="race_draw"),
    path("races/<slug:slug>/runs/", races.race_runs, name="race_runs"),
    path("races/<slug:slug>/live/", races.race_live, name="race_live"),
    path("races/<slug:slug>/board.csv", boards.board_csv, name="board_csv"),
    path("races/<slug:slug>/board.json", boards.board_json, name="board_json"),
    path("races/<slug:slug>/board.atom", boards.board_atom, name="board_atom"),
    path("races/<slug:slug>/badge.svg", boards.board_badge, name="board_badge"),
    path("races/<slug:slug>/enter/", racing.enter, name="enter"),
    path("races/<slug:slug>/submit/", racing.submit, name="submit"),
    path("races/<slug:slug>/withdraw/", racing.withdraw_page, name="withdraw"),
    path("races/<slug:slug>/edit/", organising.race_edit, name="race_edit"),
    path("races/<slug:slug>/cancel/", organising.race_cancel, name="race_cancel"),
    path("races/<slug:slug>/close/", organising.race_close, name="race_close"),
    path("races/<slug:slug>/invitation/reset/", organising.invitation_reset, name="race_invitation_reset"),
    path("races/<slug:slug>/racers/", organising.race_racers, name="race_racers"),
    path("races/<slug:slug>/racers/<str:alias>/remove/", organising.racer_remove, name="race_racer_remove"),
    path("races/<slug:slug>/racers/<str:alias>/restore/", organising.racer_restore, name="race_racer_restore"),
    path("evaluations/<str:public_id>/", evaluations.evaluation, name="evaluation"),
    path("evaluations/<str:public_id>/live/", evaluations.evaluation_live, name="evaluation_live"),
    path("evaluations/<str:public_id>/stop/", evaluations.evaluation_stop, name="evaluation_stop"),
    path("evaluations/<str:public_id>/replay.json", evaluations.evaluation_replay, name="evaluation_replay"),
    path("evaluations/<str:public_id>/trace.csv", evaluations.evaluation_trace, name="evaluation_trace"),
    path("evaluations/<str:public_id>/metrics.json", evaluations.evaluation_metrics, name="evaluation_metrics"),
    path("evaluations/<str:public_id>/logs.zip", evaluations.evaluation_logs, name="evaluation_logs"),
    path("evaluations/<str:public_id>/video/", videos.evaluation_video, name="evaluation_video"),
    path("videos/<str:public_id>/live/", videos.video_live, name="video_live"),
    path("videos/<str:public_id>/stop/", videos.video_stop, name="video_stop"),
    path("videos/<str:public_id>/video.mp4", videos.video_file, name="video_file"),
    path("videos/<str:public_id>/still.jpg", videos.video_poster, name="video_poster"),
]
