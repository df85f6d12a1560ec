"""A racer's models: upload, describe, share, delete."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime, timedelta
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from django.conf import settings
from django.db import IntegrityError, transaction
from django.db.models import ProtectedError, QuerySet
from django.utils import timezone

from accounts.classes import is_learner
from accounts.quotas import limit_of, used_by
from core.columns import length_of
from core.locks import hold
from core.storage_faults import storage_at_work
from paddock.errors import UserFault
from paddock.packages.read import UploadPart

from ..admit import AdmittedPackage, admit
from ..bounds import package_limits
from ..looks import COLOUR, Shell, VehicleLook
from ..models import Network, TrainedModel
from ..quotas import MODELS, STORAGE
from ..signals import model_deleted
from .sources import delete_unnamed_sources, drop_source, store_source
from .stored import delete, heal_network, store

if TYPE_CHECKING:
    from accounts.models import Racer

KEEP_DELETED = timedelta(days=1)
NAME_LIMIT = length_of(TrainedModel, "name")
DESCRIPTION_LIMIT = length_of(TrainedModel, "description")
_ENDINGS = re.compile(r"(\.(tar|t?gz|tgz|zip|onnx|pb|json))+$", re.IGNORECASE)
_COMPANION = re.compile(r"(\.json|\.data|_data|\.bin)$", re.IGNORECASE)
_INVISIBLE = ("Cc", "Cf", "Cs", "Co", "Cn")  # control characters, text-direction overrides and the like


@dataclass(frozen=True)
class UploadedModel:
    """The racer's model, and whether this upload made it (False: the same network was in the garage already)."""

    model: TrainedModel
    created: bool
    package: AdmittedPackage | None = None  # what was taken of the upload, and what was not needed


def upload_model(
    *,
    owner: Racer,
    files: Sequence[UploadPart],
    name: str | None = None,
    description: str = "",
    look: VehicleLook = VehicleLook(),  # noqa: B008  a tuple
    has_place: bool = False,
    checkpoint: str = "",
    keep_upload: bool = False,
    now: datetime,
) -> UploadedModel:
    """Read, check and keep a model. Nothing is stored unless all of it is in order.

    ``name=None`` names it after its file. ``look``: of a new model; one that is there already keeps its own.
    ``checkpoint``: which one of a training's folder: ``best``, ``last``, an iteration's number, or nothing for the best
    that is known. ``has_place``: it was promised a place when there was one, so a garage that is full by now takes it.
    ``keep_upload``: the files themselves are kept with the model, for their owner to have them back.
    Raises UserFault (a code of the upload, metadata, conversion or gate section, or ``garage_full``,
    ``storage_full``, ``model_name_...``, ``description_too_long``) and PlatformFault.
    """
    if name is not None:
        name = _valid_name(name)
    description = _valid_description(description)
    if not has_place:
        refuse_full_garage(owner)
    admitted = admit(files, package_limits(), who=owner.pk, checkpoint=checkpoint.strip().lower())
    heal_network(admitted.sha256, admitted.onnx)
    # once before anything is stored, and once more under the lock
    known = _known_model(owner, admitted.sha256, name, has_place)
    while known is None:
        _stored_network(admitted, now=now)
        with _kept(files if keep_upload else ()) as (source_file, source_name), transaction.atomic():
            hold(owner)
            known = _known_model(owner, admitted.sha256, name, has_place)
            network = Network.objects.select_for_update().filter(pk=admitted.sha256).first()
            if known is None and network is not None:  # else it was purged in this very moment
                model = TrainedModel.objects.create(
                    owner=owner,
                    name=name or _free_name(owner, _name_of_upload(files)),
                    description=description,
                    shell=look.shell,
                    colour=look.colour,
                    network=network,
                    metadata=admitted.metadata.to_dict(),
                    source_kind=admitted.source_kind,
                    source_sha256=admitted.source_sha256,
                    source_file=source_file,
                    source_name=source_name,
                    created_at=now,
                )
                return UploadedModel(model, created=True, package=admitted)
    if keep_upload and not known.source_file and known.source_sha256 == admitted.source_sha256:
        _keep_now(known, files)
    return UploadedModel(known, created=False, package=admitted)


@contextmanager
def _kept(files: Sequence[UploadPart]) -> Iterator[tuple[str, str]]:
    """The stored file of an upload and its name, both empty without files; deleted again unless a model names it."""
    if not files:
        yield "", ""
        return
    stored, name = store_source(files)
    try:
        yield stored, name
    finally:
        if not TrainedModel.objects.filter(source_file=stored).exists():
            delete(stored)


def _keep_now(model: TrainedModel, files: Sequence[UploadPart]) -> None:
    """Keep the very file that a model was made of, which was uploaded before such files were kept."""
    with _kept(files) as (stored, name):
        TrainedModel.objects.filter(pk=model.pk, deleted_at=None, source_file="").update(
            source_file=stored, source_name=name
        )
    model.refresh_from_db(fields=["source_file", "source_name"])


@transaction.atomic
def describe_model(
    *, model: TrainedModel, name: str, description: str, look: VehicleLook | None = None
) -> TrainedModel:
    """Give a model another name and description, and another look unless it is None, which moves no result.

    Raises UserFault ``model_name_...``, ``description_too_long``, ``model_look``.
    """
    if look is not None and (look.shell not in Shell.values or not re.fullmatch(COLOUR, look.colour)):
        raise UserFault("model_look", known=", ".join(Shell.values))
    name, description = _valid_name(name), _valid_description(description)
    hold(model.owner)
    _refuse_taken_name(model.owner, name, but=model)
    model.name, model.description = name, description
    if look is not None:
        model.shell, model.colour = look
    model.save(update_fields=["name", "description", "shell", "colour"])
    return model


def share_model(*, model: TrainedModel, now: datetime) -> None:
    """Let every racer look at a model, download it and train on from its weights. Sharing it again changes nothing.

    Raises UserFault ``model_deleted_not_shared`` for one that has left the garage, ``learner_shares_nothing`` for one
    of an account of a class.
    """
    if is_learner(model.owner):
        raise UserFault("learner_shares_nothing")
    TrainedModel.objects.filter(pk=model.pk, deleted_at=None, shared_at=None).update(shared_at=now)
    model.refresh_from_db(fields=["shared_at", "deleted_at"])
    if model.shared_at is None:
        raise UserFault("model_deleted_not_shared")


def stop_sharing_model(*, model: TrainedModel) -> None:
    """Keep a model to its owner again. Trainings that began with its weights go on, and what they made stays."""
    TrainedModel.objects.filter(pk=model.pk).update(shared_at=None)
    model.refresh_from_db(fields=["shared_at"])


@transaction.atomic
def delete_model(*, model: TrainedModel, now: datetime) -> None:
    """Take a model out of its owner's garage, end its sharing, and delete what it was uploaded as. Its evaluations and
    what they reached on boards stay, as do trainings that began with its weights."""
    deleted = TrainedModel.objects.filter(pk=model.pk, deleted_at=None).update(deleted_at=now, shared_at=None)
    model.refresh_from_db(fields=["deleted_at", "shared_at"])
    if deleted:
        drop_source(model)
        model_deleted.send(sender=TrainedModel, model=model, now=now)


def purge_garages(*, now: datetime) -> int:
    """Remove for good what was deleted :data:`KEEP_DELETED` ago and never raced, and networks that nobody has.

    Returns how many networks were removed. What has an evaluation stays, so that its result can be verified, and so
    does what a training began with (a protected reference): it may yet have to begin anew. Uploads that a killed web
    server left half received on this machine go too.
    """
    before = now - KEEP_DELETED
    _remove_abandoned_uploads(before)
    delete_unnamed_sources(before)
    for model in TrainedModel.objects.filter(deleted_at__lt=before, evaluations=None, rival_evaluations=None):
        with suppress(ProtectedError, IntegrityError), transaction.atomic():
            model.delete()
    removed = 0
    for network in Network.objects.filter(created_at__lt=before, models=None):
        with suppress(ProtectedError, IntegrityError), transaction.atomic():  # somebody uploads it in this very moment
            network.delete()
            transaction.on_commit(partial(delete, network.onnx.name or ""), robust=True)
            removed += 1
    return removed


def _remove_abandoned_uploads(before: datetime) -> None:
    for path in Path(settings.FILE_UPLOAD_TEMP_DIR).glob("*.upload*"):  # as Django names them
        with suppress(OSError):
            if path.stat().st_mtime < before.timestamp():
                path.unlink()


def _known_model(owner: Racer, sha256: str, name: str | None, has_place: bool) -> TrainedModel | None:
    """The owner's model of this network. None when there is none, and one of this name may be added."""
    known = _garage(owner).filter(network=sha256).first()
    if known is None:
        if not has_place:
            refuse_full_garage(owner)
        if name is not None:
            _refuse_taken_name(owner, name)
    return known


def _stored_network(admitted: AdmittedPackage, *, now: datetime) -> None:
    """Make the network's row on first sight. Two uploads at once agree on one: the loser deletes its own file."""
    if Network.objects.filter(pk=admitted.sha256).exists():
        return
    network = Network(
        sha256=admitted.sha256,
        size=len(admitted.onnx),
        parameters=admitted.parameters,
        macs=admitted.macs,
        facts=admitted.facts.to_dict(),
        created_at=now,
    )
    with storage_at_work():
        network.onnx = store(f"networks/{admitted.sha256}.onnx", admitted.onnx)
    try:
        with transaction.atomic():
            network.save(force_insert=True)
    except IntegrityError:
        delete(network.onnx.name)
    except BaseException:
        delete(network.onnx.name)
        raise


def _garage(owner: Racer) -> QuerySet[TrainedModel]:
    return TrainedModel.objects.filter(owner=owner, deleted_at=None)


def refuse_full_garage(owner: Racer) -> None:
    now = timezone.now()
    limit = limit_of(owner, MODELS.name)
    if used_by(owner, MODELS.name, now) >= limit:
        raise UserFault("garage_full", limit=limit)
    limit_mb = limit_of(owner, STORAGE.name)
    if used_by(owner, STORAGE.name, now) >= limit_mb:
        raise UserFault("storage_full", limit_mb=limit_mb)


def _refuse_taken_name(owner: Racer, name: str, but: TrainedModel | None = None) -> None:
    same = _garage(owner).filter(name=name)
    if but is not None:
        same = same.exclude(pk=but.pk)
    if same.exists():
        raise UserFault("model_name_taken", name=name)


def _visible(text: str) -> str:
    """``text`` without invisible characters, and with single blanks."""
    kept = (" " if character.isspace() else character for character in text)
    return " ".join("".join(c for c in kept if unicodedata.category(c) not in _INVISIBLE).split())


def _valid_name(name: str) -> str:
    name = _visible(name)
    if not name:
        raise UserFault("model_name_missing")
    if len(name) > NAME_LIMIT:
        raise UserFault("model_name_too_long", limit=NAME_LIMIT)
    return name


def _valid_description(description: str) -> str:
    description = _visible(description)
    if len(description) > DESCRIPTION_LIMIT:
        raise UserFault("description_too_long", limit=DESCRIPTION_LIMIT)
    return description


def _name_of_upload(files: Sequence[UploadPart]) -> str:
    """After the first file that is not there to accompany another."""
    named = [file.name for file in files if not _COMPANION.search(file.name)]
    return _name_of_file((named or [files[0].name])[0])


def _name_of_file(file_name: str) -> str:
    """A model's name from its file's: ``C:\\cars\\my car.tar.gz`` is ``my car``."""
    stem = _ENDINGS.sub("", _visible(re.split(r"[\\/]", file_name)[-1])).strip(". ")
    return stem[:NAME_LIMIT].strip() or "model"


def _free_name(owner: Racer, wanted: str) -> str:
    """``wanted``, or ``wanted 2`` and so on, whichever the owner has not used."""
    used = set(_garage(owner).values_list("name", flat=True))
    name, number = wanted, 1
    while name in used:
        number += 1
        ending = f" {number}"
        name = wanted[: NAME_LIMIT - len(ending)].rstrip() + ending
    return name
