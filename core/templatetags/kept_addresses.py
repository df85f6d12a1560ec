"""Django's tag ``url``, which looks up each address once."""

from functools import lru_cache

from django.template import Context, Library, Node
from django.template.base import Parser, Token
from django.template.defaulttags import URLNode
from django.template.defaulttags import url as djangos_url
from django.urls import get_resolver, get_script_prefix, get_urlconf, reverse
from django.urls.resolvers import URLResolver
from django.utils.html import conditional_escape

register = Library()


class _Address(URLNode):
    def render(self, context: Context) -> str:
        name = self.view_name.resolve(context)
        if self.kwargs or self.asvar or ":" in name:  # a namespace depends on the request
            return super().render(context)
        args = tuple(str(each.resolve(context)) for each in self.args)
        address = _address(get_resolver(get_urlconf()), get_script_prefix(), name, args)
        return conditional_escape(address) if context.autoescape else address


@register.tag
def url(parser: Parser, token: Token) -> Node:
    node = djangos_url(parser, token)
    return _Address(node.view_name, node.args, node.kwargs, node.asvar)


@lru_cache(maxsize=5000)
def _address(resolver: URLResolver, prefix: str, name: str, args: tuple[str, ...]) -> str:
    return reverse(name, args=args)
