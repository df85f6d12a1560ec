"""A bounded reader of the protobuf wire format."""

# It yields views into the bytes and stops when its budget of fields is spent; a protobuf library would build objects of
# gigabytes. Format: protobuf.dev, "Encoding".

import unicodedata
from collections.abc import Iterator

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5


class WireError(ValueError):
    """The bytes are not a protobuf message of the expected kind."""


class TooManyFields(WireError):
    """The budget of fields is spent."""


class Budget:
    """Counts fields over a whole file."""

    def __init__(self, fields: int) -> None:
        self.left = fields

    def spend(self, fields: int = 1) -> None:
        """Raises :class:`TooManyFields` when nothing is left."""
        self.left -= fields
        if self.left < 0:
            raise TooManyFields


def read_varint(data: memoryview, at: int) -> tuple[int, int]:
    """The unsigned 64-bit varint at ``at`` and the offset behind it."""
    result = shift = 0
    end = len(data)
    while at < end:
        byte = data[at]
        at += 1
        result |= (byte & 0x7F) << shift
        if byte < 0x80:
            if result >= 1 << 64:
                raise WireError("varint longer than 64 bits")
            return result, at
        shift += 7
        if shift >= 70:
            raise WireError("varint longer than ten bytes")
    raise WireError("cut off inside a varint")


def fields(data: memoryview, budget: Budget) -> Iterator[tuple[int, int, int | memoryview]]:
    """Yield ``(field number, wire type, value)``; varints as int, everything else as a view into ``data``."""
    at, end = 0, len(data)
    while at < end:
        budget.spend()
        key, at = read_varint(data, at)
        number, kind = key >> 3, key & 7
        if not 0 < number < 1 << 29:
            raise WireError("field number out of range")
        if kind == VARINT:
            value, at = read_varint(data, at)
            yield number, kind, value
            continue
        if kind == BYTES:
            size, at = read_varint(data, at)
        elif kind == FIXED64:
            size = 8
        elif kind == FIXED32:
            size = 4
        else:
            raise WireError("groups are not used in these formats")
        if size > end - at:
            raise WireError("cut off inside a field")
        yield number, kind, data[at : at + size]
        at += size


def signed(value: int) -> int:
    return value - (1 << 64) if value >= 1 << 63 else value


def packed_varints(data: memoryview, budget: Budget) -> list[int]:
    """A packed repeated int32, int64 or bool field as signed values. Each costs one field of the budget."""
    result, at = [], 0
    while at < len(data):
        budget.spend()
        value, at = read_varint(data, at)
        result.append(signed(value))
    return result


def text(value: int | memoryview) -> str:
    """A string field. Raises :class:`WireError` if it is no UTF-8."""
    if isinstance(value, int):
        raise WireError("a string was expected")
    try:
        return str(value, "utf-8")
    except UnicodeDecodeError as error:
        raise WireError("a string is not UTF-8") from error


def message(value: int | memoryview) -> memoryview:
    if isinstance(value, int):
        raise WireError("a message was expected")
    return value


def number(value: int | memoryview) -> int:
    """A varint field's unsigned value."""
    if not isinstance(value, int):
        raise WireError("a number was expected")
    return value


def is_space(letter: str) -> bool:
    return unicodedata.category(letter) == "Zs"


def printable(name: str, limit: int = 80) -> str:
    """A stranger's name without control characters, cut to ``limit`` characters."""
    kept = "".join(c if c.isprintable() else " " if is_space(c) else "?" for c in name[:limit])
    return kept + ("..." if len(name) > limit else "")
