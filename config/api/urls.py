"""Addresses below /api/. Version 1 only grows: nothing in it is renamed or taken away."""

from django.urls import URLPattern, URLResolver, include, path, re_path

from accounts.groups import api as groups
from accounts.programs import api as programs
from accounts.teams import api as teams
from evaluation.garage import api as models
from evaluation.reports import api as reports
from league.cups import api as cups
from league.following import api as following
from league.notices import api as notices
from league.racers import api as racers
from league.seasons.api import organising, seasons
from league.webhooks import api as webhooks
from races.aftermath import api as afterwards
from races.audit import api as audit
from races.duels import api as duels
from races.live import api as live
from races.pages.api import boards, races
from races.pages.api import entering as entries
from races.runs.api import comparison, evaluations, specifications, test_runs, videos
from races.telemetry import api as telemetry
from races.timing.api import laps as timing
from races.timing.api import setup as timing_setup
from tracks import api as tracks

from . import reference, schema_view, views

version_1: list[URLPattern | URLResolver] = [
    path("auth/token/", views.TokenView.as_view(), name="api-token"),
    path("auth/tokens/", views.TokensView.as_view(), name="api-tokens"),
    path("auth/tokens/<slug:key>/", views.TokenRevocationView.as_view(), name="api-token-revoke"),
    path("me/", views.MeView.as_view(), name="api-me"),
    path("me/alias/", views.AliasView.as_view(), name="api-alias"),
    path("me/data/", views.OwnDataView.as_view(), name="api-data"),
    path("me/deletion/", views.DeletionView.as_view(), name="api-deletion"),
    path("me/usage/", views.UsageView.as_view(), name="api-usage"),
    path("audit/", audit.AuditView.as_view(), name="api-audit"),
    path("audit/export/<slug:form>/", audit.AuditExportView.as_view(), name="api-audit-export"),
    path("notices/", notices.NoticesView.as_view(), name="api-notices"),
    path("notices/read/", notices.NoticesReadView.as_view(), name="api-notices-read"),
    path("notices/settings/", notices.NoticeSettingsView.as_view(), name="api-notice-settings"),
    path("notices/<int:number>/read/", notices.NoticeReadView.as_view(), name="api-notice-read"),
    path("following/", following.FollowingView.as_view(), name="api-following"),
    path("following/<slug:alias>/", following.FollowView.as_view(), name="api-follow"),
    path("racers/<slug:alias>/", racers.RacerView.as_view(), name="api-racer"),
    path("programs/", programs.ProgramsView.as_view(), name="api-programs"),
    path("programs/<slug:alias>/", programs.ProgramView.as_view(), name="api-program"),
    path("programs/<slug:alias>/tokens/", programs.ProgramTokensView.as_view(), name="api-program-tokens"),
    path("programs/<slug:alias>/tokens/<slug:key>/", programs.ProgramTokenView.as_view(), name="api-program-token"),
    path("groups/", groups.GroupsView.as_view(), name="api-groups"),
    path("groups/join/", groups.GroupJoinView.as_view(), name="api-group-join"),
    path("groups/<slug:slug>/", groups.GroupView.as_view(), name="api-group"),
    path("groups/<slug:slug>/link/", groups.GroupLinkView.as_view(), name="api-group-link"),
    path("groups/<slug:slug>/members/", groups.GroupMembersView.as_view(), name="api-group-members"),
    path("groups/<slug:slug>/members/<slug:alias>/", groups.GroupMemberView.as_view(), name="api-group-member"),
    path("groups/<slug:slug>/membership/", groups.GroupMembershipView.as_view(), name="api-group-membership"),
    path("teams/", teams.TeamsView.as_view(), name="api-teams"),
    path("teams/join/", teams.TeamJoinView.as_view(), name="api-team-join"),
    path("teams/<slug:slug>/", teams.TeamView.as_view(), name="api-team"),
    path("teams/<slug:slug>/link/", teams.TeamLinkView.as_view(), name="api-team-link"),
    path("teams/<slug:slug>/members/", teams.TeamMembersView.as_view(), name="api-team-members"),
    path("teams/<slug:slug>/members/<slug:alias>/", teams.TeamMemberView.as_view(), name="api-team-member"),
    path("teams/<slug:slug>/membership/", teams.TeamMembershipView.as_view(), name="api-team-membership"),
    path("teams/<slug:slug>/invitations/", teams.TeamInvitationsView.as_view(), name="api-team-invitations"),
    path("teams/<slug:slug>/invitations/<slug:alias>/", teams.TeamInvitationView.as_view(), name="api-team-invitation"),
    path("webhooks/", webhooks.WebhooksView.as_view(), name="api-webhooks"),
    path("webhooks/<int:number>/", webhooks.WebhookView.as_view(), name="api-webhook"),
    path("webhooks/<int:number>/secret/", webhooks.WebhookSecretView.as_view(), name="api-webhook-secret"),
    path("webhooks/<int:number>/test/", webhooks.WebhookTestView.as_view(), name="api-webhook-test"),
    path("webhooks/<int:number>/deliveries/", webhooks.DeliveriesView.as_view(), name="api-deliveries"),
    path("models/", models.ModelsView.as_view(), name="api-models"),
    path("models/shared/", models.SharedModelsView.as_view(), name="api-shared-models"),
    path("models/<slug:public_id>/package/", models.ModelPackageView.as_view(), name="api-model-package"),
    path("models/<slug:public_id>/export/<slug:form>/", models.ModelExportView.as_view(), name="api-model-export"),
    path("models/<slug:public_id>/upload/", models.ModelUploadView.as_view(), name="api-model-upload"),
    path("models/<slug:public_id>/", models.ModelView.as_view(), name="api-model"),
    path("tracks/", tracks.TracksView.as_view(), name="api-tracks"),
    path("tracks/<slug:slug>/", tracks.TrackView.as_view(), name="api-track"),
    path("races/", races.RacesView.as_view(), name="api-races"),
    path("races/<slug:slug>/", races.RaceView.as_view(), name="api-race"),
    path("races/<slug:slug>/audit/", audit.RaceAuditView.as_view(), name="api-race-audit"),
    path("races/<slug:slug>/close/", races.CloseView.as_view(), name="api-race-close"),
    path("races/<slug:slug>/cancel/", races.CancelView.as_view(), name="api-race-cancel"),
    path("races/<slug:slug>/spectators/", races.SpectatorLinkRenewView.as_view(), name="api-race-spectators"),
    path("races/<slug:slug>/invitation/", races.InvitationResetView.as_view(), name="api-race-invitation"),
    path(
        "races/<slug:slug>/specification/",
        specifications.RaceSpecificationView.as_view(),
        name="api-race-specification",
    ),
    path("races/<slug:slug>/board/", boards.BoardView.as_view(), name="api-board"),
    path("races/<slug:slug>/timing/", timing.TimingView.as_view(), name="api-timing"),
    path("races/<slug:slug>/sessions/", timing.SessionsView.as_view(), name="api-timed-sessions"),
    path("races/<slug:slug>/sessions/<slug:id>/", timing.SessionView.as_view(), name="api-timed-session"),
    path("races/<slug:slug>/laps/", timing.LapFileView.as_view(), name="api-lap-file"),
    path("races/<slug:slug>/laps/<slug:id>/", timing.LapView.as_view(), name="api-lap"),
    path("races/<slug:slug>/sensors/", timing_setup.SensorsView.as_view(), name="api-sensors"),
    path("races/<slug:slug>/sensors/<int:number>/", timing_setup.SensorView.as_view(), name="api-sensor"),
    path("races/<slug:slug>/timekeepers/", timing_setup.TimekeepersView.as_view(), name="api-timekeepers"),
    path("races/<slug:slug>/timekeepers/<slug:alias>/", timing_setup.TimekeeperView.as_view(), name="api-timekeeper"),
    path("races/<slug:slug>/guests/", timing_setup.GuestsView.as_view(), name="api-guests"),
    path("races/<slug:slug>/guests/<slug:id>/", timing_setup.GuestView.as_view(), name="api-guest"),
    path("timing/claims/", timing_setup.ClaimView.as_view(), name="api-claims"),
    path("timing/crossings/", timing.CrossingsView.as_view(), name="api-crossings"),
    path("races/<slug:slug>/duels/", duels.DuelsView.as_view(), name="api-duels"),
    path("races/<slug:slug>/live/", live.LiveView.as_view(), name="api-live"),
    path("races/<slug:slug>/live/figures/", afterwards.LiveFiguresView.as_view(), name="api-live-figures"),
    path("races/<slug:slug>/live/highlights/", afterwards.LiveHighlightsView.as_view(), name="api-live-highlights"),
    path("races/<slug:slug>/live/results/", afterwards.LiveResultsView.as_view(), name="api-live-results"),
    path("races/<slug:slug>/live/laps/", afterwards.LiveLapsView.as_view(), name="api-live-laps"),
    path("races/<slug:slug>/results/", afterwards.ResultsPdfView.as_view(), name="api-results-pdf"),
    path("races/<slug:slug>/certificates/<slug:alias>/", afterwards.CertificateView.as_view(), name="api-certificate"),
    path("races/<slug:slug>/live/console/", live.LiveActsView.as_view(), name="api-live-console"),
    path("races/<slug:slug>/live/mine/", live.LiveMineView.as_view(), name="api-live-mine"),
    path("races/<slug:slug>/live/poses/", live.LivePosesView.as_view(), name="api-live-poses"),
    path("races/<slug:slug>/live/speed/", live.LiveSpeedView.as_view(), name="api-live-speed"),
    path("races/<slug:slug>/entry/", entries.EntryView.as_view(), name="api-entry"),
    path("races/<slug:slug>/submissions/", entries.SubmissionsView.as_view(), name="api-submissions"),
    path("races/<slug:slug>/removals/<slug:alias>/", entries.RemovalView.as_view(), name="api-removal"),
    path("seasons/", seasons.SeasonsView.as_view(), name="api-seasons"),
    path("seasons/<slug:slug>/", seasons.SeasonView.as_view(), name="api-season"),
    path("seasons/<slug:slug>/copy/", organising.SeasonCopyView.as_view(), name="api-season-copy"),
    path("seasons/<slug:slug>/rounds/<slug:race>/", organising.RoundView.as_view(), name="api-round"),
    path("seasons/<slug:slug>/rounds/", seasons.RoundsView.as_view(), name="api-rounds"),
    path("seasons/<slug:slug>/stages/<slug:stage>/", organising.StageRulesView.as_view(), name="api-stage-rules"),
    path("seasons/<slug:slug>/standings/", seasons.StandingsView.as_view(), name="api-standings"),
    path("seasons/<slug:slug>/racers/<slug:alias>/", seasons.RacerSeasonView.as_view(), name="api-racer-season"),
    path("cups/", cups.CupsView.as_view(), name="api-cups"),
    path("cups/starter/", cups.CupStarterView.as_view(), name="api-cup-starter"),
    path("cups/<slug:day>/", cups.CupView.as_view(), name="api-cup"),
    path("invitations/<slug:token>/", entries.InvitationView.as_view(), name="api-invitation"),
    path("", include("training.api_urls")),
    path("", include("courses.api_urls")),
    path("evaluations/", test_runs.OwnRunsView.as_view(), name="api-evaluations"),
    path("evaluations/<slug:public_id>/again/", test_runs.AgainView.as_view(), name="api-evaluation-again"),
    path("evaluations/<slug:public_id>/", evaluations.EvaluationView.as_view(), name="api-evaluation"),
    path(
        "evaluations/<slug:public_id>/specification/",
        specifications.EvaluationSpecificationView.as_view(),
        name="api-evaluation-specification",
    ),
    path("evaluations/<slug:public_id>/stop/", evaluations.StopView.as_view(), name="api-evaluation-stop"),
    path("evaluations/<slug:public_id>/metrics/", evaluations.MetricsView.as_view(), name="api-metrics"),
    path(
        "evaluations/<slug:public_id>/compare/<slug:other_id>/",
        comparison.CompareView.as_view(),
        name="api-evaluation-compare",
    ),
    path(
        "evaluations/<slug:public_id>/telemetry/",
        telemetry.TelemetryView.as_view(),
        name="api-telemetry",
    ),
    path("evaluations/<slug:public_id>/layout/", evaluations.LayoutView.as_view(), name="api-layout"),
    path("evaluations/<slug:public_id>/logs/", evaluations.LogsView.as_view(), name="api-evaluation-logs"),
    path("evaluations/<slug:public_id>/trace/", evaluations.TraceView.as_view(), name="api-trace"),
    path("evaluations/<slug:public_id>/videos/", videos.VideosView.as_view(), name="api-videos"),
    path("reports/", reports.ReportsView.as_view(), name="api-reports"),
    path("reports/<slug:public_id>/", reports.ReportView.as_view(), name="api-report"),
    path("reports/<slug:public_id>/stop/", reports.ReportStopView.as_view(), name="api-report-stop"),
    path("reports/<slug:public_id>/again/", reports.ReportAgainView.as_view(), name="api-report-again"),
    path("videos/<slug:public_id>/", videos.VideoView.as_view(), name="api-video"),
    path("videos/<slug:public_id>/stop/", videos.VideoStopView.as_view(), name="api-video-stop"),
    path("videos/<slug:public_id>/file/", videos.VideoFileView.as_view(), name="api-video-file"),
]

urlpatterns = [
    path("v1/", include(version_1)),
    path("schema/", schema_view.SchemaView.as_view(), name="api-schema"),
    path("docs/", reference.page, name="api-docs"),
    re_path(r"^(?P<rest>[\s\S]*)$", views.UnknownAddressView.as_view()),
]
