"""Addresses of the list of races, a race and its organising."""

from django.urls import path

from .views import boards, entering, organising, races

urlpatterns = [
    path("races/", races.races, name="races"),
    path("races/new/", organising.race_new, name="race_new"),
    path("races/layout/", organising.race_layout, name="race_layout"),
    path("races/join/<str:token>/", entering.race_invitation, name="race_invitation"),
    path("races/<slug:slug>/", races.race, name="race"),
    path("races/<slug:slug>/rules/", races.race_rules, name="race_rules"),
    path("races/<slug:slug>/runs/", races.race_runs, name="race_runs"),
    path("races/<slug:slug>/live/", races.race_live, name="race_live"),
    path("races/<slug:slug>/board.csv", boards.board_csv, name="board_csv"),
    path("races/<slug:slug>/board.json", boards.board_json, name="board_json"),
    path("races/<slug:slug>/board.atom", boards.board_atom, name="board_atom"),
    path("races/<slug:slug>/badge.svg", boards.board_badge, name="board_badge"),
    path("races/<slug:slug>/enter/", entering.enter, name="enter"),
    path("races/<slug:slug>/submit/", entering.submit, name="submit"),
    path("races/<slug:slug>/withdraw/", entering.withdraw_page, name="withdraw"),
    path("races/<slug:slug>/edit/", organising.race_edit, name="race_edit"),
    path("races/<slug:slug>/cancel/", organising.race_cancel, name="race_cancel"),
    path("races/<slug:slug>/close/", organising.race_close, name="race_close"),
    path("races/<slug:slug>/invitation/reset/", organising.invitation_reset, name="race_invitation_reset"),
    path("races/<slug:slug>/spectators/renew/", organising.spectator_link_renew, name="race_spectators_renew"),
    path("races/<slug:slug>/racers/", organising.race_racers, name="race_racers"),
    path("races/<slug:slug>/racers/<str:alias>/remove/", organising.racer_remove, name="race_racer_remove"),
    path("races/<slug:slug>/racers/<str:alias>/restore/", organising.racer_restore, name="race_racer_restore"),
]
