"""A racer's models: upload, describe, share, delete."""

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path

from django.conf import settings
from django.core.files.storage import default_storage
from django.db import IntegrityError, transaction
from django.db.models import ProtectedError, QuerySet
from django.utils import timezone
from django.utils.translation import gettext_lazy as _

from accounts.class_accounts.services import is_learner
from accounts.models import Racer
from accounts.quotas import limit_of, used_by
from core.audit.recording import audited
from core.database.after_commit import after_commit
from core.database.columns import length_of
from core.database.locks import hold
from core.files.atomic_storage import WholeFileStorage
from core.files.storage_faults import storage_at_work
from core.metrics import Counter
from core.validators import without_invisible
from paddock.errors import PaddockError, UserFault
from paddock.packages.read import UploadPart

from ..appearance.looks import COLOUR, Shell, VehicleLook
from ..models import Network, TrainedModel
from ..signals import model_deleted
from ..stored_files import delete, heal_network, store
from .admission import AdmittedPackage, admit
from .original_uploads import delete_unnamed_sources, drop_source, store_source
from .quotas import MODELS, STORAGE
from .uploads import package_limits

KEEP_DELETED = timedelta(days=1)
NAME_LIMIT = length_of(TrainedModel, "name")
DESCRIPTION_LIMIT = length_of(TrainedModel, "description")
_ENDINGS = re.compile(r"(\.(tar|t?gz|tgz|zip|onnx|pb|json))+$", re.IGNORECASE)
UPLOADS = Counter(
    "paddock_uploads_total",
    "Uploads of models that were checked, by result: accepted, or the code of the reason.",
    ("result",),
)
_COMPANION = re.compile(r"(\.json|\.data|_data|\.bin)$", re.IGNORECASE)


@dataclass(frozen=True)
class UploadedModel:
    """The racer's model, and whether this upload made it (False: the same network was in the garage already)."""

    model: TrainedModel
    created: bool
    package: AdmittedPackage | None = None  # what was taken of the upload, and what was not needed; without the network


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
    admitted: AdmittedPackage | None = None,
    now: datetime,
) -> UploadedModel:
    """Read, check and keep a model. Nothing is stored unless all of it is valid.

    ``name=None`` names it after its file. ``look``: of a new model. ``checkpoint``: of a training's folder: ``best``,
    ``last``, a number, or nothing for the best known. ``has_place``: a full garage takes it all the same.
    ``keep_upload``: keep the files for their owner. ``admitted``: what :func:`admit_upload` returned for these files.
    Raises UserFault (a code of the upload, metadata, conversion or gate section, or ``garage_full``, ``storage_full``,
    ``model_name_...``, ``description_too_long``) and PlatformFault.
    """
    if admitted is None:
        admitted = admit_upload(
            owner=owner, files=files, name=name, description=description, has_place=has_place, checkpoint=checkpoint
        )
    name, description = name and _valid_name(name), _valid_description(description)
    summary = replace(admitted, onnx=b"")  # a response may keep it for long: DRF's serializers are cycles
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
                return UploadedModel(model, created=True, package=summary)
    if keep_upload and not known.source_file and known.source_sha256 == admitted.source_sha256:
        _keep_now(known, files)
    return UploadedModel(known, created=False, package=summary)


def admit_upload(
    *,
    owner: Racer,
    files: Sequence[UploadPart],
    name: str | None = None,
    description: str = "",
    has_place: bool = False,
    checkpoint: str = "",
) -> AdmittedPackage:
    """The slow half of :func:`upload_model`: read, convert and check. Stores nothing; raises what that raises."""
    if name is not None:
        _valid_name(name)
    _valid_description(description)
    if not has_place:
        refuse_full_garage(owner)
    try:
        admitted = admit(files, package_limits(), racer_pk=owner.pk, checkpoint=checkpoint.strip().lower())
    except PaddockError as fault:
        UPLOADS.inc(fault.code)
        raise
    UPLOADS.inc("accepted")
    heal_network(admitted.sha256, admitted.onnx)
    return admitted


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


@audited("model.changed", _("Model changed"), target="model", unless="owner")
@transaction.atomic
def describe_model(
    *, model: TrainedModel, name: str, description: str, look: VehicleLook | None = None
) -> TrainedModel:
    """Change a model's name, description and, unless None, look. Raises UserFault ``model_name_...``,
    ``description_too_long``, ``model_look``."""
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
    """Let every racer look at a model, download it and train on from its weights. Raises UserFault
    ``model_deleted_not_shared``, and ``learner_shares_nothing`` for an account of a class."""
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


@audited("model.deleted", _("Model deleted"), target="model", unless="owner")
@transaction.atomic
def delete_model(*, model: TrainedModel, now: datetime) -> None:
    """Take a model out of its owner's garage, end its sharing, and delete its upload. Results and trainings that began
    with its weights stay."""
    deleted = TrainedModel.objects.filter(pk=model.pk, deleted_at=None).update(deleted_at=now, shared_at=None)
    model.refresh_from_db(fields=["deleted_at", "shared_at"])
    if deleted:
        drop_source(model)
        model_deleted.send(sender=TrainedModel, model=model, now=now)


def purge_garages(*, now: datetime) -> int:
    """Remove models deleted :data:`KEEP_DELETED` ago that never raced, networks without models, and uploads that were
    cut off. Returns how many networks were removed. Evaluations and trainings keep what they refer to."""
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
            after_commit(delete, network.onnx.name or "")
            removed += 1
    return removed


def _remove_abandoned_uploads(before: datetime) -> None:
    if isinstance(default_storage, WholeFileStorage):
        default_storage.delete_unfinished(before)
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
    """Create the network's row on first sight. Of two simultaneous uploads the loser deletes its own file."""
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


def _valid_name(name: str) -> str:
    name = without_invisible(name)
    if not name:
        raise UserFault("model_name_missing")
    if len(name) > NAME_LIMIT:
        raise UserFault("model_name_too_long", limit=NAME_LIMIT)
    return name


def _valid_description(description: str) -> str:
    description = without_invisible(description)
    if len(description) > DESCRIPTION_LIMIT:
        raise UserFault("description_too_long", limit=DESCRIPTION_LIMIT)
    return description


def _name_of_upload(files: Sequence[UploadPart]) -> str:
    """The name of the first file that does not accompany another."""
    named = [file.name for file in files if not _COMPANION.search(file.name)]
    return _name_of_file((named or [files[0].name])[0])


def _name_of_file(file_name: str) -> str:
    """A model's name from its file's: ``C:\\cars\\my car.tar.gz`` is ``my car``."""
    stem = _ENDINGS.sub("", without_invisible(re.split(r"[\\/]", file_name)[-1])).strip(". ")
    return stem[:NAME_LIMIT].strip() or "model"


def _free_name(owner: Racer, wanted: str) -> str:
    used = set(_garage(owner).values_list("name", flat=True))
    name, number = wanted, 1
    while name in used:
        number += 1
        ending = f" {number}"
        name = wanted[: NAME_LIMIT - len(ending)].rstrip() + ending
    return name
