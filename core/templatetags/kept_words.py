"""Django's library ``i18n``, in which a text without values is translated once for each language."""

from django.template import Context, Library, Node
from django.template.base import Parser, Token, TokenType
from django.templatetags import i18n
from django.utils.translation import get_language

register = Library()
register.tags.update(i18n.register.tags)
register.filters.update(i18n.register.filters)


class _FixedText(Node):
    def __init__(self, node: Node) -> None:
        self.node = node
        self._kept: dict[str | None, str] = {}

    def render(self, context: Context) -> str:
        language = get_language()
        kept = self._kept.get(language)
        if kept is None:
            kept = self._kept[language] = self.node.render(context)
        return kept


def translate(parser: Parser, token: Token) -> Node:
    node = i18n.do_translate(parser, token)
    value, about = node.filter_expression, node.message_context
    is_fixed = value.var.lookups is None and not value.filters and (about is None or isinstance(about.var, str))
    return _FixedText(node) if is_fixed and node.asvar is None else node


def blocktranslate(parser: Parser, token: Token) -> Node:
    node = i18n.do_block_translate(parser, token)
    has_values = node.extra_context or node.countervar or node.message_context or node.asvar
    is_fixed = not has_values and all(each.token_type == TokenType.TEXT for each in node.singular)
    return _FixedText(node) if is_fixed else node


for _name in ("translate", "trans"):
    register.tag(_name, translate)
for _name in ("blocktranslate", "blocktrans"):
    register.tag(_name, blocktranslate)
