"""Serializers of typed documents, so that a document's fields are listed once."""

from dataclasses import is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints, is_typeddict
from uuid import UUID

from rest_framework import serializers

_FIELDS: dict[type, type[serializers.Field]] = {
    bool: serializers.BooleanField,
    int: serializers.IntegerField,
    float: serializers.FloatField,
    str: serializers.CharField,
    UUID: serializers.UUIDField,
}


@cache
def serializer_of(document: type, name: str = "") -> type[serializers.Serializer]:
    """The serializer of a TypedDict ``SomethingDocument`` or a dataclass, named ``SomethingSerializer``.

    A field's type is one of :data:`_FIELDS`, a document, any other TypedDict (an object of undescribed fields), or a
    list, a tuple or a dict by strings of these, and may be None. ``Annotated`` adds its help text, or its choices.
    """
    hints = get_type_hints(document, include_extras=True)
    about = {"__doc__": document.__doc__, "__module__": document.__module__}
    title = f"{name or document.__name__.removesuffix('Document')}Serializer"
    return type(title, (serializers.Serializer,), about | {name: _field(hint) for name, hint in hints.items()})


def _field(hint: Any, **options: Any) -> serializers.Field:
    if get_origin(hint) is Annotated:
        hint, about = get_args(hint)
        if not isinstance(about, str):
            return serializers.ChoiceField(about)
        options["help_text"] = about
    if get_origin(hint) in (Union, UnionType):
        (hint,) = (each for each in get_args(hint) if each is not NoneType)
        options["allow_null"] = True
    origin, inners = get_origin(hint), get_args(hint) or (hint,)
    inner = inners[0] if origin is tuple else inners[-1]
    if _is_document(inner) and origin in (list, tuple, None):
        return serializer_of(inner)(many=hint is not inner, **options)
    if origin in (list, tuple):
        return serializers.ListField(child=_field(inner), **options)
    if origin is dict:
        return serializers.DictField(child=_field(inner), **options)
    return (serializers.DictField if is_typeddict(hint) else _FIELDS[hint])(**options)


def _is_document(hint: Any) -> bool:
    return is_dataclass(hint) or (is_typeddict(hint) and hint.__name__.endswith("Document"))
