"""A network that the AWS console trained drives here. OpenVINO reads its file: no converter of ours takes part."""

import io
import json
import tarfile

import numpy as np
import pytest

from paddock.geometry.files import read_npy
from paddock.rules.race import RaceRules
from paddock.simulator.action import ActionSpace
from paddock.simulator.race import Entrant, RaceSettings, run_race
from tests.shared import CONSOLE_CAR, SHARED, needs_shared


@pytest.fixture(scope="module")
def console_car(tmp_path_factory):
    openvino = pytest.importorskip("openvino")
    folder = tmp_path_factory.mktemp("console")
    with tarfile.open(fileobj=io.BytesIO(CONSOLE_CAR.read_bytes())) as archive:
        model = archive.extractfile("agent/model.pb").read()
        metadata = json.load(archive.extractfile("model_metadata.json"))
    (folder / "model.pb").write_bytes(model)
    core = openvino.Core()
    network = core.read_model(folder / "model.pb")
    network.reshape([1, 120, 160, 1])
    compiled = core.compile_model(network, "CPU", {"INFERENCE_PRECISION_HINT": "f32", "INFERENCE_NUM_THREADS": 1})
    request = compiled.create_infer_request()

    def policy(readings):
        frame = readings["FRONT_FACING_CAMERA"][None].astype(np.float32)
        return request.infer([frame])[compiled.output(0)].reshape(-1)

    return ActionSpace.from_metadata(metadata), policy


@needs_shared
@pytest.mark.slow
def test_it_laps_a_to_z_speedway_at_the_official_pace(console_car):
    space, policy = console_car
    track = read_npy((SHARED / "tracks" / "reInvent2019_wide.npy").read_bytes(), "reInvent2019_wide")
    result = run_race(RaceSettings(track, RaceRules(laps=3), [Entrant(space, ["FRONT_FACING_CAMERA"], policy)]))
    assert result.end_reason == "laps_done"
    assert [lap.resets for lap in result.laps] == [0, 0, 0]
    assert all(7_500 <= lap.time_ms <= 10_000 for lap in result.laps)


@needs_shared
@pytest.mark.slow
@pytest.mark.parametrize("apart", [24.0, pytest.param(2.4, marks=pytest.mark.soak)])
def test_its_laps_do_not_depend_on_a_lucky_start(console_car, apart):
    """``apart``: metres from one start to the next."""
    space, policy = console_car
    track = read_npy((SHARED / "tracks" / "reInvent2019_wide.npy").read_bytes(), "reInvent2019_wide")
    laps = []
    for start_m in np.arange(0.0, track.length, apart):
        result = run_race(
            RaceSettings(
                track, RaceRules(laps=2), [Entrant(space, ["FRONT_FACING_CAMERA"], policy)], start_m=float(start_m)
            )
        )
        assert result.end_reason == "laps_done"
        laps.extend(result.laps)
    clean = [lap for lap in laps if lap.resets == 0]
    assert len(clean) >= 0.75 * len(laps)
    assert all(7_000 <= lap.time_ms <= 10_000 for lap in clean)
