"""Models downloaded for others: by the API and from the model's page, and uploaded again."""

from __future__ import annotations

import fcntl
import io
import json
import threading
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
import pytest
from django.test import Client

from evaluation.garage.export import export_in_sandbox
from paddock.errors import PlatformFault, UserFault
from paddock.geometry.catalogue import by_slug
from paddock.network.session import load
from paddock.packages.admission import admit_network
from paddock.packages.limits import DEFAULT_LIMITS, PackageLimits
from paddock.packages.metadata import parse_metadata
from paddock.packages.read import UploadPart, read_upload
from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.deciding import Policy
from paddock.simulator.race import Entrant, RaceSettings, run_race
from paddock.simulator.sensors import sensor_spec
from tests.factories import a_model
from tests.paddock.packages.coach import coach_graph, metadata_dict
from tests.sandbox.networks import METADATA

pytestmark = pytest.mark.django_db
FORMS = ("car", "openvino")


@pytest.fixture
def written(monkeypatch) -> list[tuple[str, int]]:
    """No process writes; the forms and racers that were asked for."""
    asked = []

    def export(onnx, metadata, form, limits, *, racer_pk):
        asked.append((form, racer_pk))
        return b"an archive"

    monkeypatch.setattr("evaluation.garage.downloads.export_in_sandbox", export)
    return asked


class TestPages:
    @pytest.fixture
    def client(self, alice) -> Client:
        client = Client()
        client.force_login(alice)
        return client

    def test_a_models_page_offers_every_form(self, client, alice, written):
        model = a_model(alice)
        page = client.get(f"/models/{model.public_id}/").content.decode()
        for form in FORMS:
            assert f'href="/models/{model.public_id}/export/{form}/"' in page
        assert "Upload the file again to keep it." in page
        assert client.get(f"/models/{model.public_id}/export/car/").content == b"an archive"
        assert client.get(f"/models/{model.public_id}/export/tflite/").status_code == 404

    def test_a_network_that_reads_several_observations_says_why_there_is_no_other_form(self, client, alice):
        model = a_model(alice)
        model.metadata = {**model.metadata, "frame_stack": 4}
        model.save()
        page = client.get(f"/models/{model.public_id}/").content.decode()
        assert "/export/" not in page and "this network reads the last 4 observations at once" in page
        assert "<dt>Observations read at once</dt><dd>4</dd>" in page

    def test_a_network_that_a_form_cannot_say_is_explained_on_the_page(self, client, alice, monkeypatch):
        def refuse(*args, **options):
            raise UserFault("export_operator", operator="MaxPool", where="_v3")

        monkeypatch.setattr("evaluation.garage.downloads.export_in_sandbox", refuse)
        model = a_model(alice)
        answer = client.get(f"/models/{model.public_id}/export/car/", follow=True)
        assert answer.redirect_chain == [(f"/models/{model.public_id}/", 302)]
        assert "no equivalent of the operator MaxPool (_v3)" in answer.content.decode()

    def test_a_model_without_its_upload_says_so(self, client, alice):
        model = a_model(alice)
        answer = client.get(f"/models/{model.public_id}/uploaded/", follow=True)
        assert "This model has no uploaded file" in answer.content.decode()


class TestTurns:
    """Six at once: two are written, four wait."""

    @pytest.fixture
    def others(self, tmp_path, monkeypatch):
        """Two are being written, and so many wait."""
        monkeypatch.setenv("PADDOCK_DATA", str(tmp_path))
        folder = tmp_path / "locks" / "exports"
        folder.mkdir(parents=True)

        def hold(stack: ExitStack, waiting: int) -> ExitStack:
            for name in ("upload-0", "upload-1", *(f"waiting-{seat}" for seat in range(waiting))):
                file = stack.enter_context((folder / name).open("w"))
                fcntl.flock(file, fcntl.LOCK_EX)
            return stack

        return hold

    @staticmethod
    def asked(limits: PackageLimits = DEFAULT_LIMITS) -> str:
        with pytest.raises(PlatformFault) as fault:  # what is to be written is no network
            export_in_sandbox(b"no network", json.dumps(METADATA).encode(), "car", limits, racer_pk=1)
        return fault.value.code

    def test_one_more_waits_for_its_turn(self, others):
        with ExitStack() as stack:
            threading.Timer(0.3, others(stack, waiting=3).pop_all().close).start()
            assert self.asked() == "export_failed"

    def test_where_as_many_wait_as_may_the_next_is_asked_to_come_again(self, others):
        with ExitStack() as stack:
            others(stack, waiting=4)
            assert self.asked() == "upload_busy"

    def test_nobody_waits_longer_than_an_operator_says(self, others):
        with ExitStack() as stack:
            others(stack, waiting=0)
            assert self.asked(replace(DEFAULT_LIMITS, slot_wait_s=0.1)) == "upload_busy"


class TestProcess:
    def test_what_is_no_network_of_ours_is_our_fault(self):
        with pytest.raises(PlatformFault) as fault:
            export_in_sandbox(b"no network", json.dumps(METADATA).encode(), "car", DEFAULT_LIMITS, racer_pk=1)
        assert fault.value.code == "export_failed"

    def test_a_refusal_of_its_process_reaches_the_racer(self, tmp_path):
        from onnx import TensorProto, helper

        camera, actions = (
            helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)
            for name, shape in (("FRONT_FACING_CAMERA", (1, 1, 120, 160)), ("actions", (1, 1)))
        )
        pool = {"kernel_shape": [2, 2], "dilations": [119, 159]}
        nodes = [
            helper.make_node("MaxPool", [camera.name], ["most"], **pool),
            helper.make_node("Flatten", ["most"], ["actions"]),
        ]
        graph = helper.make_graph(nodes, "holes", [camera], [actions])
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
        one_action = {**METADATA, "action_space": [{"steering_angle": 0, "speed": 1}]}
        with pytest.raises(UserFault) as fault:
            export_in_sandbox(
                model.SerializeToString(), json.dumps(one_action).encode(), "openvino", DEFAULT_LIMITS, racer_pk=1
            )
        assert (fault.value.code, fault.value.params["operator"]) == ("export_operator", "MaxPool")

    def test_what_reads_several_observations_is_refused(self):
        metadata = json.dumps({**METADATA, "frame_stack": 4}).encode()
        with pytest.raises(UserFault) as fault:
            export_in_sandbox(b"is not opened", metadata, "car", DEFAULT_LIMITS, racer_pk=1)
        assert (fault.value.code, fault.value.params) == ("export_frame_stack", {"count": "4"})


def test_the_car_that_comes_back_drives_the_same_trace():
    from paddock.packages.export import export_model

    sensors = ["FRONT_FACING_CAMERA", "SECTOR_LIDAR"]
    metadata = parse_metadata(json.dumps(metadata_dict(sensors)).encode())
    first = admit_network("tensorflow", coach_graph(sensors, middleware=[8]), metadata, DEFAULT_LIMITS)
    package = read_upload([UploadPart("a", io.BytesIO(export_model(first.onnx, metadata, "car")))])
    returned = parse_metadata(package.metadata_json)
    second = admit_network(package.kind, package.model, returned, DEFAULT_LIMITS)
    assert second.sha256 == first.sha256 and second.facts == first.facts
    rules, track = RaceRules(max_simulated_ms=1500), by_slug("oval").geometry()
    traces = []
    for car, said in ((first, metadata), (second, returned)):
        specs = [sensor_spec(name, None) for name in sorted(said.sensors)]
        inputs = [{"name": spec.name, "dtype": spec.dtype, "shape": list(spec.shape)} for spec in specs]
        space = ActionSpace.from_metadata(said.to_dict())
        policy = Policy(load(car.onnx, car.facts), {"inputs": inputs, "outputs": space.size, "ranges": space.ranges})
        traces.append(
            run_race(RaceSettings(track, rules, [Entrant(space, list(said.sensors), policy.answer)])).trace.sha256
        )
    assert np.unique(traces).size == 1
