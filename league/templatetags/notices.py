"""The bell in the page head, and the sentence of a notice."""

from django import template

from accounts.models import Racer
from league.models import Notice
from league.notices.selectors import MOST_COUNTED, count_unread
from league.notices.sentences import sentence

register = template.Library()
MOST = MOST_COUNTED - 1


@register.simple_tag
def unread_notices(racer: Racer) -> str:
    """How many notices a racer has not read, as it stands beside the bell: empty for none, at most ``99+``."""
    count = count_unread(racer)
    return f"{MOST}+" if count > MOST else str(count or "")


@register.filter
def notice_text(notice: Notice) -> str:
    return sentence(notice)
