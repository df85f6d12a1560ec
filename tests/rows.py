"""Rows that tests of several rooms need, made without going through the services under test."""

from __future__ import annotations

import hashlib
from datetime import datetime

from django.core.files.base import ContentFile
from django.utils import timezone

from accounts.models import Racer
from evaluation.models import Network, TrainedModel
from paddock.geometry.catalogue import CATALOGUE
from tracks.models import Track

METADATA = {
    "action_space_type": "discrete",
    "action_space": [
        {"steering_angle": -30.0, "speed": 1.0, "index": 0},
        {"steering_angle": 0.0, "speed": 1.0, "index": 1},
        {"steering_angle": 30.0, "speed": 1.0, "index": 2},
    ],
    "sensor": ["FRONT_FACING_CAMERA"],
    "neural_network": "DEEP_CONVOLUTIONAL_NETWORK_SHALLOW",
    "training_algorithm": "clipped_ppo",
    "version": "5",
}


def track_row(slug: str) -> Track:
    """A track of the catalogue."""
    entry = next(track for track in CATALOGUE if track.slug == slug)
    return Track.objects.create(
        slug=slug,
        name=entry.name,
        npy=entry.npy,
        fingerprint=entry.fingerprint,
        length_m=entry.length_m,
        width_m=entry.width_m,
        corners=entry.corners,
        difficulty=entry.difficulty,
        direction=entry.direction,
        is_open=entry.is_open,
        is_catalogue=True,
    )


def model_row(owner: Racer, name: str = "Bolt", onnx: bytes = b"a network", at: datetime | None = None) -> TrainedModel:
    """A model in ``owner``'s garage whose network is ``onnx`` (no real one: nothing here runs it)."""
    digest = hashlib.sha256(onnx).hexdigest()
    network = Network.objects.filter(pk=digest).first()
    if network is None:
        network = Network(sha256=digest, size=len(onnx), parameters=10, macs=100)
        network.onnx.save(f"{digest}.onnx", ContentFile(onnx), save=False)
        network.save(force_insert=True)
    return TrainedModel.objects.create(
        owner=owner,
        name=name,
        network=network,
        metadata=METADATA,
        source_kind="onnx",
        source_sha256=digest,
        created_at=at or timezone.now(),
    )
