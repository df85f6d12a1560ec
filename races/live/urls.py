"""Addresses of live events."""

from django.urls import path

from .views import event, screens

urlpatterns = [
    path("races/<slug:slug>/live/screen/", screens.live_screen, name="live_screen"),
    path("races/<slug:slug>/live/overlay/<str:piece>/", screens.live_overlay, name="live_overlay"),
    path("races/<slug:slug>/live/commentary/", screens.live_commentary, name="live_commentary"),
    path("races/<slug:slug>/live/phone/", screens.live_phone, name="live_phone"),
    path("races/<slug:slug>/live/beat/", screens.live_beat, name="live_beat"),
    path("races/<slug:slug>/live/panel/", screens.live_panel, name="live_panel"),
    path("races/<slug:slug>/live/react/", screens.live_react, name="live_react"),
    path("watch/<slug:token>/", screens.live_watch, name="live_watch"),
    path("watch/<slug:token>/event/", screens.live_watch, {"page": "event"}, name="live_watch_event"),
    path("watch/<slug:token>/screen/", screens.live_watch, {"page": "screen"}, name="live_watch_screen"),
    path("watch/<slug:token>/overlay/<str:piece>/", screens.live_watch, {"page": "overlay"}, name="live_watch_overlay"),
    path("races/<slug:slug>/event/", event.live_event, name="live_event"),
    path("races/<slug:slug>/event/state.json", event.live_state, name="live_state"),
    path("races/<slug:slug>/event/poses.json", event.live_poses, name="live_poses"),
    path("races/<slug:slug>/event/frames.png", event.live_frames, name="live_frames"),
    path("races/<slug:slug>/event/ghost.json", event.live_ghost, name="live_ghost"),
    path("races/<slug:slug>/event/mine/", event.live_mine, name="live_mine"),
    path("races/<slug:slug>/event/plan/", event.live_plan, name="live_plan"),
    path("races/<slug:slug>/event/speed/", event.live_speed, name="live_speed"),
    path("races/<slug:slug>/event/console/", event.live_console, name="live_console"),
    path("races/<slug:slug>/event/act/", event.live_act, name="live_act"),
]
