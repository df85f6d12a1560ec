"""Deep linking: a teacher chooses an assignment on the platform's page for it, and its column is made there."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from django.db.models import Sum
from django.http import HttpRequest, HttpResponse
from django.shortcuts import render
from django.urls import reverse

from accounts.class_accounts.services import can_teach
from league.webhooks.outgoing_requests import checked
from paddock.errors import UserFault

from ..models import Assignment
from . import services
from .frames import framed
from .launches import DEEP_LINKING, Launch

if TYPE_CHECKING:
    from .library import Message

MOST = 100
_DATA = "https://purl.imsglobal.org/spec/lti-dl/claim/data"
_ITEMS = "https://purl.imsglobal.org/spec/lti-dl/claim/content_items"


def choice(request: HttpRequest, launch: Launch, message: "Message") -> HttpResponse:
    """The assignments of the class, each with a button that sends its signed link to the platform. The page needs no
    session, and is shown in a frame of that platform alone. Raises UserFault("lti_role" | "lti_no_class" |
    "lti_message")."""
    if not launch.is_teacher:
        raise UserFault("lti_role")
    asked: Mapping[str, object] = message.get_launch_data()[DEEP_LINKING]
    back, origin = _return_address(asked)
    context = services.context_of(launch)
    racer = services.account_of(launch, context)
    classroom = getattr(context.group, "classroom", None) if context else None
    if racer is None or classroom is None or not can_teach(racer, classroom) or not services.may_enter(racer):
        raise UserFault("lti_no_class")
    rows = Assignment.objects.filter(group=classroom.group).annotate(points=Sum("parts__points")).order_by("-due_at")
    links = [(one, _signed(request, one, message, asked)) for one in rows[:MOST]]
    answer = render(request, "courses/lti/choice.html", {"links": links, "back": back, "launch": launch})
    return framed(answer, origin)


def _return_address(asked: Mapping[str, object]) -> tuple[str, str]:
    """Where the choice is sent, and the origin of it. Raises UserFault("lti_message")."""
    back = asked.get("deep_link_return_url")
    try:
        parts = checked(back if isinstance(back, str) else "")
    except UserFault as fault:
        raise UserFault("lti_message") from fault
    return str(back), f"{parts.scheme}://{parts.netloc}"


def _signed(request: HttpRequest, assignment: Assignment, message: "Message", asked: Mapping[str, object]) -> str:
    """The answer that links to this assignment: a token of ten minutes."""
    from pylti1p3.deep_link_resource import DeepLinkResource
    from pylti1p3.lineitem import LineItem

    item = DeepLinkResource().set_title(assignment.title)
    item.set_url(request.build_absolute_uri(reverse("lti_launch")))
    item.set_custom_params({"assignment": assignment.public_id})
    points = getattr(assignment, "points", None)
    if points and asked.get("accept_lineitem") is not False:
        line = LineItem().set_label(assignment.title).set_resource_id(assignment.public_id)
        item.set_lineitem(line.set_tag("paddock").set_score_maximum(float(points)))
    link = message.get_deep_link()
    answer = link.get_message_jwt([item])
    answer[_ITEMS] = [{**item.to_dict(), "window": {"targetName": "paddock"}}]
    if answer[_DATA] is None:
        del answer[_DATA]
    return link.encode_jwt(answer)
