"""The frame of every page: its theme, the navigation, and slots that rooms above fill."""

from functools import lru_cache

from django import template
from django.conf import settings
from django.db import Error
from django.http import HttpRequest
from django.template import Context
from django.template.base import FilterExpression, NodeList, Parser, Token, token_kwargs
from django.template.loader import render_to_string
from django.urls import get_script_prefix, reverse
from django.utils.safestring import SafeString
from django.utils.translation import get_language
from django.utils.translation import gettext as _

from core import mail
from core.pages import registry as pages
from core.streams.reading import last_numbered
from core.streams.shared_pieces import lasting_piece, marked, shown_position

register = template.Library()
register.simple_tag(mail.mail_is_sent)
THEMES = ("dark", "light")


@register.filter
def theme(request: HttpRequest | str) -> str:
    """The theme that the reader chose: ``dark``, ``light``, or ``""`` to follow the system."""
    chosen = getattr(request, "COOKIES", {}).get("theme", "")
    return chosen if chosen in THEMES else ""


@register.simple_tag
def frame(template: str) -> SafeString:
    """``{% frame "parts/frame/footer.html" %}``: a template that depends on nothing but settings and the language."""
    return _drawn(template, get_language(), get_script_prefix())


@register.simple_tag(takes_context=True)
def navigation(context: Context) -> SafeString:
    """The sections of the site, with the section of the page marked."""
    here = pages.section_of(getattr(context.get("request"), "path", ""))
    return _drawn("parts/frame/navigation.html", get_language(), get_script_prefix(), here)


@register.simple_tag(takes_context=True)
def admin_navigation(context: Context) -> SafeString:
    """Django's side bar of the admin site, drawn once for all admins with the same permissions."""
    request: HttpRequest = context["request"]
    may = request.user.is_superuser or frozenset(request.user.get_all_permissions())
    here = request.path.removeprefix(get_script_prefix()).split("/")[:3]  # of the model whose line is marked
    values = {"available_apps": context["available_apps"], "request": {"path": request.path}}
    return lasting_piece("admin/nav_sidebar.html", values, key=(may, *here))


@lru_cache(maxsize=200)
def _drawn(template: str, language: str | None, script_prefix: str, here: str = "") -> SafeString:
    """A part of the frame, rendered once a process."""
    sections = [{"address": reverse(s.page), "label": s.label, "is_here": s.name == here} for s in pages.sections()]
    return render_to_string(template, {"sections": sections})


@register.simple_tag
def operators_links() -> list[tuple[str, str]]:
    """(label, address) of each page of the operator's own that the settings name."""
    labels = {"chat": _("Chat"), "tips": _("Tips"), "forum": _("Forum")}
    labels |= {"terms": _("Terms of use"), "privacy": _("Privacy")}
    return [(labels[name], address) for name, address in settings.FOOT_LINKS.items() if address]


@register.simple_tag
def stream_position() -> str:
    """Up to which event a page that is made now shows everything; ``""`` where that cannot be read."""
    try:
        shown = shown_position()
        return str(last_numbered() if shown is None else shown)
    except Error:  # the page is still rendered
        return ""


@register.simple_tag
def section_address(name: str) -> str:
    """Where a section of the site begins; ``""`` where the site has none of this name."""
    return next((reverse(section.page) for section in pages.sections() if section.name == name), "")


class _Slot(template.Node):
    def __init__(self, name: str, values: dict[str, FilterExpression]) -> None:
        self.name, self.values = name, values

    def render(self, context: Context) -> SafeString:
        assert context.template is not None  # it is set as long as a template is rendered
        engine = context.template.engine
        with context.push(**{name: value.resolve(context) for name, value in self.values.items()}):
            return SafeString("".join(engine.get_template(each).render(context) for each in pages.filling(self.name)))


@register.tag
def slot(parser: Parser, token: Token) -> _Slot:
    """``{% slot "garage.tabs" here="models" %}``: templates of higher rooms, with the context and these values."""
    words = token.split_contents()
    if len(words) < 2 or words[1][0] not in "\"'":
        raise template.TemplateSyntaxError(f"{words[0]} takes the name of a slot, quoted")
    rest = words[2:]
    values = token_kwargs(rest, parser)
    if rest:
        raise template.TemplateSyntaxError(f"{words[0]} takes values by name, and {rest[0]!r} has none")
    return _Slot(words[1][1:-1], values)


class _Mine(template.Node):
    def __init__(self, racer: FilterExpression, nodelist: NodeList) -> None:
        self.racer, self.nodelist = racer, nodelist

    def render(self, context: Context) -> SafeString:
        racer = self.racer.resolve(context)
        if not racer:
            return SafeString("")
        if "is_marked" in context:
            return SafeString(marked(racer, self.nodelist.render(context)))
        is_mine = racer == getattr(context.get("user"), "pk", None)
        return self.nodelist.render(context) if is_mine else SafeString("")


@register.tag
def mine(parser: Parser, token: Token) -> _Mine:
    """``{% mine racer.pk %} me{% endmine %}``: for this racer alone, also in a piece that all readers share
    (:func:`core.streams.shared_pieces.marked_piece`)."""
    words = token.split_contents()
    if len(words) != 2:
        raise template.TemplateSyntaxError(f"{words[0]} takes the id of a racer")
    nodelist = parser.parse(("endmine",))
    parser.delete_first_token()
    return _Mine(parser.compile_filter(words[1]), nodelist)
