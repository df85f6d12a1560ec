"""All personal data of a racer as one zip: JSON by section, the racer's files, and a README with the contents.

Nothing of it is stored. A section is written to a temporary file, then sent; files are sent in pieces."""

import json
import zipfile
from collections.abc import Iterator
from datetime import datetime
from tempfile import SpooledTemporaryFile
from typing import Any

from django.core.files.storage import default_storage
from django.core.serializers.json import DjangoJSONEncoder
from django.db.models import Field, FileField, ForeignKey, Model
from django.utils.translation import gettext as _

from .columns import personal_columns
from .rules import PersonalData, all_rules

PIECE = 1 << 20
IN_MEMORY = 4 << 20
FILES = "files"
# By which another row is named, the first that its table has.
_PUBLIC_NAMES = ("public_id", "slug", "alias", "name")
_OF_WORKERS = frozenset({"lease", "leased_until", "worker", "not_before", "kills", "failed_at"})


class _Pipe:
    """What the zip writes, until it is sent."""

    def __init__(self) -> None:
        self._pieces: list[bytes] = []

    def write(self, data: bytes) -> int:
        self._pieces.append(bytes(data))
        return len(data)

    def flush(self) -> None:
        """Nothing waits."""

    def take(self) -> bytes:
        pieces, self._pieces = self._pieces, []
        return b"".join(pieces)


def archive(racer: Any, *, now: datetime) -> Iterator[bytes]:
    """The zip in pieces. A file that cannot be read is named in the README."""
    pipe, files = _Pipe(), set[str]()
    missing: list[str] = []
    contents: list[tuple[PersonalData, int]] = []
    with zipfile.ZipFile(pipe, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as packed:  # type: ignore[call-overload]
        for rule in all_rules().values():
            if not rule.section:
                continue
            with SpooledTemporaryFile(IN_MEMORY) as section:
                count = _write_section(rule, racer, section, files)
                section.seek(0)
                if count:
                    yield from _packed(packed, pipe, f"{rule.section}.json", section, zipfile.ZIP_DEFLATED)
            contents.append((rule, count))
        for name in sorted(files):
            try:
                stored = default_storage.open(name, "rb")
            except Exception:  # each storage raises other classes
                missing.append(name)
                continue
            with stored:
                yield from _packed(packed, pipe, f"{FILES}/{name}", stored, zipfile.ZIP_STORED)
        packed.writestr("README.txt", _readme(racer, now, contents, missing))
    yield pipe.take()


def _packed(packed: zipfile.ZipFile, pipe: _Pipe, name: str, content: Any, method: int) -> Iterator[bytes]:
    entry = zipfile.ZipInfo(name)
    entry.compress_type = method
    with packed.open(entry, "w", force_zip64=True) as member:
        while piece := content.read(PIECE):
            member.write(piece)
            yield pipe.take()
    yield pipe.take()


def _write_section(rule: PersonalData, racer: Any, section: Any, files: set[str]) -> int:
    """Write the rows as a JSON list of objects, and note their files. Returns how many rows there are."""
    named = columns_of(rule)
    of_files = [name for name, way in named.items() if isinstance(rule.model._meta.get_field(name), FileField)]
    rows = rule.model._default_manager.filter(rule.is_owned_by(racer)).order_by("pk")
    count = 0
    section.write(b"[")
    for row in rows.values_list(*named.values()).iterator(chunk_size=200):
        shown = dict(zip(named, row, strict=True))
        for name in filter(shown.get, of_files):
            files.add(shown[name])
            shown[name] = f"{FILES}/{shown[name]}"
        section.write(b",\n" if count else b"\n")
        section.write(json.dumps(shown, cls=DjangoJSONEncoder, ensure_ascii=False, indent=1).encode())
        count += 1
    section.write(b"\n]\n")
    if rule.files is not None:
        files |= {name for name in rule.files(racer) if name}
    return count


def columns_of(rule: PersonalData) -> dict[str, str]:
    """The columns of a section and the way to the value of each: those that are exported, and those without a rule."""
    ruled = {*personal_columns(rule.model), *rule.export_rules, *rule.owner.split(), *_OF_WORKERS}
    exported = set(rule.exported.split())
    columns = [one for one in rule.model._meta.concrete_fields if one.name in exported or one.name not in ruled]
    return {column.name: _way(column) for column in columns if column.name != "operator_detail"}


def _way(column: Field) -> str:
    if not isinstance(column, ForeignKey):
        return column.name
    other: type[Model] = column.related_model
    names = {one.name for one in other._meta.concrete_fields}
    known = next((name for name in _PUBLIC_NAMES if name in names), None)
    return f"{column.name}__{known}" if known else column.name


def _readme(racer: Any, now: datetime, contents: list[tuple[PersonalData, int]], missing: list[str]) -> str:
    of = {"alias": racer.alias, "time": f"{now:%Y-%m-%d %H:%M}"}
    lines = [
        _("Personal data of %(alias)s, made on %(time)s UTC.") % of,
        "",
        _("Each section is a JSON list. Files lie in the folder “files” under the names that the sections give."),
        _("Times are UTC. Columns that end with “_ms” are milliseconds."),
        "",
    ]
    for rule, count in contents:
        lines.append(f"{rule.section}.json: {rule.model._meta.verbose_name_plural}, {count}")
    lines += ["", _("Not in the archive:"), ""]
    for rule in all_rules().values():
        for reason, columns in rule.withheld.items():
            lines.append(f"- {rule.model._meta.verbose_name_plural} ({columns}): {reason}")
    if missing:
        lines += ["", _("These files could not be read. Try again later:"), "", *missing]
    return "\n".join(lines) + "\n"
