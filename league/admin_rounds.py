"""Actions on rounds in the admin site, each with a page that shows its consequences before it runs."""

from collections.abc import Callable, Sequence
from functools import partial

from django.contrib import admin, messages
from django.contrib.admin import helpers
from django.core.exceptions import ValidationError
from django.db.models import QuerySet
from django.http import HttpRequest, HttpResponse
from django.shortcuts import redirect, render
from django.utils import timezone
from django.utils.translation import gettext as _
from django.utils.translation import gettext_lazy

from accounts.models import Racer
from accounts.request_racer import racer_of
from core.admin import ReadOnly
from core.forms import explain
from core.times import written
from paddock.errors import PaddockError

from .models import Round
from .notices.services import announce
from .seasons.services.race_changes import consequences_of, postpone_round
from .stewarding.official_results import close_round
from .stewarding.selectors import competitors_of
from .stewarding.services import disqualify, lock_round, put_back, reopen_round

LABELS = {
    "reason": gettext_lazy("Reason"),
    "racer": gettext_lazy("Racer"),
    "hours": gettext_lazy("Hours"),
    "text": gettext_lazy("Announcement"),
}
Call = Callable[[Round, dict[str, str]], object]


@admin.register(Round)
class RoundAdmin(ReadOnly, admin.ModelAdmin):
    list_display = ("season", "number", "stage", "race", "state", "closed_at", "settled")
    list_display_links = ("number", "race")
    list_filter = ("season", "stage", "closed_at")
    list_select_related = ("season", "race")
    search_fields = ("race__name", "race__slug", "name")
    ordering = ("-race__closes_at", "pk")
    actions = ("publish", "lock", "take_back", "disqualify", "put_back", "postpone", "announce")

    @admin.display(description=gettext_lazy("state"))
    def state(self, round_: Round) -> str:
        return str(round_.race.state_at(timezone.now()).label)

    @admin.display(description=gettext_lazy("final since"))
    def settled(self, round_: Round) -> str:
        if round_.closed_at is None:
            return _("held back") if round_.held_at else "-"
        if round_.settled_at is None or round_.is_under_review(timezone.now()):
            return _("under review")
        return written(round_.settled_at)

    @admin.action(description=gettext_lazy("Publish: make the results official"), permissions=["steward"])
    def publish(self, request: HttpRequest, queryset: QuerySet[Round]) -> HttpResponse | None:
        def call(round_: Round, given: dict[str, str]) -> object:
            return close_round(round=round_, now=timezone.now())

        follows = _("The results become official and decide promotions, finale fields, championship places and points.")
        return self._ask(request, queryset, "publish", _("Publish results"), follows, (), call)

    @admin.action(description=gettext_lazy("Lock: end the steward window"), permissions=["steward"])
    def lock(self, request: HttpRequest, queryset: QuerySet[Round]) -> HttpResponse | None:
        def call(round_: Round, given: dict[str, str]) -> object:
            return lock_round(round=round_, by=racer_of(request), reason=given["reason"], now=timezone.now())

        follows = _("These results can no longer be corrected. This cannot be undone.")
        return self._ask(request, queryset, "lock", _("Lock results"), follows, ("reason",), call)

    @admin.action(description=gettext_lazy("Revoke the official results"), permissions=["steward"])
    def take_back(self, request: HttpRequest, queryset: QuerySet[Round]) -> HttpResponse | None:
        def call(round_: Round, given: dict[str, str]) -> object:
            return reopen_round(round=round_, by=racer_of(request), reason=given["reason"], now=timezone.now())

        follows = _(
            "Promotions, finale fields, championship places and points of this round are withdrawn "
            "until the results are published again."
        )
        return self._ask(request, queryset, "take_back", _("Revoke results"), follows, ("reason",), call)

    @admin.action(description=gettext_lazy("Disqualify a racer"), permissions=["steward"])
    def disqualify(self, request: HttpRequest, queryset: QuerySet[Round]) -> HttpResponse | None:
        def call(round_: Round, given: dict[str, str]) -> object:
            racer, steward = _racer(given["racer"]), racer_of(request)
            return disqualify(round=round_, racer=racer, by=steward, reason=given["reason"], now=timezone.now())

        follows = _(
            "The racer is removed from the board, their queued cars are stopped, the reason is "
            "published, and the round is recalculated. You can undo this during the steward window."
        )
        return self._ask(request, queryset, "disqualify", _("Disqualify"), follows, ("racer", "reason"), call)

    @admin.action(description=gettext_lazy("Reinstate a disqualified racer"), permissions=["steward"])
    def put_back(self, request: HttpRequest, queryset: QuerySet[Round]) -> HttpResponse | None:
        def call(round_: Round, given: dict[str, str]) -> object:
            racer = _racer(given["racer"])
            return put_back(round=round_, racer=racer, by=racer_of(request), reason=given["reason"], now=timezone.now())

        follows = _("The racer returns to the board, and the round is recalculated.")
        return self._ask(request, queryset, "put_back", _("Reinstate"), follows, ("racer", "reason"), call)

    @admin.action(description=gettext_lazy("Postpone"), permissions=["steward"])
    def postpone(self, request: HttpRequest, queryset: QuerySet[Round]) -> HttpResponse | None:
        def call(round_: Round, given: dict[str, str]) -> object:
            hours = int(given["hours"]) if given["hours"].isdecimal() and len(given["hours"]) < 6 else 0
            return postpone_round(round=round_, hours=hours, reason=given["reason"], now=timezone.now())

        follows = _("The race closes later, and opens later if it has not opened yet. Its racers see the reason.")
        return self._ask(request, queryset, "postpone", _("Postpone"), follows, ("hours", "reason"), call)

    @admin.action(description=gettext_lazy("Send an announcement to the racers"), permissions=["steward"])
    def announce(self, request: HttpRequest, queryset: QuerySet[Round]) -> HttpResponse | None:
        def call(round_: Round, given: dict[str, str]) -> object:
            return announce(race=round_.race, text=given["text"], now=timezone.now())

        follows = _("Everyone in the race gets a notice on the site and by e-mail.")
        return self._ask(request, queryset, "announce", _("Announce"), follows, ("text",), call)

    def _ask(
        self,
        request: HttpRequest,
        rounds: QuerySet[Round],
        action: str,
        title: str,
        follows: str,
        fields: Sequence[str],
        call: Call,
    ) -> HttpResponse | None:
        """Ask for ``fields``, then show what would follow, then do it and log it, for each round."""
        given = {name: " ".join(request.POST.get(name, "").split()) for name in fields}
        find = " ".join(request.POST.get("find", "").split())[:64]
        asked = request.POST.get("step") in ("asked", "confirmed")
        complete = asked and all(given.values())
        rows = list(rounds.select_related("season", "race").order_by("race__closes_at", "pk"))
        lines: list[tuple[Round, list[str]]] = []
        if complete:
            lines, refused = self._tried(rows, given, call)
            if not refused and request.POST["step"] == "confirmed":
                self._do(request, rows, given, call, title)
                return redirect(rows[0].race) if _from_the_race(request, rows) else None
            complete = not refused
        context: dict[str, object] = self.admin_site.each_context(request) | {
            "title": title,
            "action": action,
            "consequence": follows,
            "rows": rows,
            "lines": lines,
            "back": rows[0].race.get_absolute_url() if _from_the_race(request, rows) else "",
            "fields": [(name, LABELS[name], given[name]) for name in fields],
            "choices": competitors_of(rows, given["racer"], find, gone=action == "put_back")
            if "racer" in fields
            else None,
            "find": find,
            "complete": complete,
            "missing": asked and fields and not all(given.values()),
            "opts": self.model._meta,
            "action_checkbox_name": helpers.ACTION_CHECKBOX_NAME,
        }
        if not fields and not asked:
            context["lines"], refused = self._tried(rows, given, call)
            context["complete"] = not refused
        return render(request, "admin/league/round_action.html", context, status=422 if context["missing"] else 200)

    def _tried(
        self, rows: Sequence[Round], given: dict[str, str], call: Call
    ) -> tuple[list[tuple[Round, list[str]]], bool]:
        lines, refused = [], False
        for one in rows:
            try:
                lines.append((one, consequences_of(partial(call, one, given), one.season)))
            except (PaddockError, ValidationError) as fault:
                refused = True
                lines.append((one, [_words(fault)]))
        return lines, refused

    def _do(self, request: HttpRequest, rows: Sequence[Round], given: dict[str, str], call: Call, title: str) -> None:
        for one in rows:
            try:
                call(one, given)
            except (PaddockError, ValidationError) as fault:
                self.message_user(request, f"{one.race}: {_words(fault)}", messages.ERROR)
            else:
                what = ", ".join(f"{name}: {value}" for name, value in given.items())
                self.log_change(request, one, f"{title}. {what}".strip())
                self.message_user(request, _("%(race)s: done.") % {"race": one.race})


def _from_the_race(request: HttpRequest, rows: Sequence[Round]) -> bool:
    """Whether the steward came from the page of the race, and goes back there."""
    return request.POST.get("back") == "race" and len(rows) == 1


def _racer(alias: str) -> Racer:
    racer = Racer.objects.filter(alias__iexact=alias).first()
    if racer is None:
        raise ValidationError(_("There is no racer %(alias)s.") % {"alias": alias})
    return racer


def _words(fault: PaddockError | ValidationError) -> str:
    return explain(fault) if isinstance(fault, PaddockError) else " ".join(fault.messages)
