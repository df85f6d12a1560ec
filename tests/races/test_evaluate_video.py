"""``manage.py evaluate --video``: the run as a video, after its figures."""

from __future__ import annotations

from io import StringIO

import av
import pytest
from django.core.management import CommandError, call_command

from core.management.base import REFUSED, Refusal
from races.management.commands import evaluate as command
from races.management.commands.evaluate import name_of
from tests.evaluation.stubs import car_outcome, outcome_of
from tests.races.test_evaluate import CAR_FILES
from tests.videos.drawing.runs import car, driven, lap
from videos.drawing import MAX_SECONDS
from videos.drawing.scene import CARD_MS

DUEL = ("--race-type", "head_to_head", "--rival", ",".join(CAR_FILES))


@pytest.fixture
def drive(monkeypatch):
    """Calls the command with a pipeline that only plays; returns what it printed."""

    def call(*arguments: str, seconds: float = 0.4, trace: bytes | None = None) -> str:
        def play(job, **kwargs):
            rivals = [car_outcome() for _ in job.rivals]
            outcome = outcome_of(rivals=rivals, layout={"boxes": [], "bots": []})
            changed = {"trace_csv": car(driven(seconds)).trace if trace is None else trace, "laps": [lap(1, 0, 400)]}
            for result in (outcome, *rivals):
                for name, value in changed.items():
                    object.__setattr__(result, name, value)
            return outcome

        monkeypatch.setattr(command, "evaluate", play)
        monkeypatch.setattr(command.Command, "_table", lambda self, *rest: self.stdout.write("the figures"))
        out = StringIO()
        try:
            call_command("evaluate", *CAR_FILES, "--track", "oval", *arguments, stdout=out, stderr=StringIO())
        except CommandError as error:
            error.printed = out.getvalue()
            raise
        return out.getvalue()

    return call


def test_a_video_of_a_duel_overwrites_an_existing_file(drive, tmp_path):
    path = tmp_path / "run.mp4"
    path.write_bytes(b"an older one")
    assert "the figures" in drive(*DUEL, "--video", str(path))
    with av.open(str(path)) as file:
        assert file.duration / 1e6 == pytest.approx(0.4 + CARD_MS / 1000, abs=0.05)


@pytest.mark.parametrize("where", ["nowhere/run.mp4", "folder"])
def test_figures_are_printed_even_if_the_video_cannot_be_written(drive, tmp_path, where):
    (tmp_path / "folder").mkdir()
    with pytest.raises(CommandError, match=r"cannot be written: \w+") as caught:
        drive("--video", str(tmp_path / where))
    assert "the figures" in caught.value.printed
    assert caught.value.returncode == 1
    assert [entry.name for entry in tmp_path.rglob("*")] == ["folder"]


@pytest.mark.parametrize(("trace", "code"), [(b"", "video_no_steps"), (None, "video_too_long")])
def test_a_run_without_a_possible_video_is_refused_with_its_code(drive, tmp_path, trace, code):
    if code == "video_too_long":
        rows = driven(0.4)
        trace = car([*rows, rows[-1]._replace(tstamp=MAX_SECONDS + 2.0)]).trace
    with pytest.raises(Refusal) as caught:
        drive("--video", str(tmp_path / "run.mp4"), trace=trace)
    assert caught.value.fault.code == code and caught.value.returncode == REFUSED
    assert list(tmp_path.iterdir()) == []


def test_cars_are_named_after_their_files():
    assert name_of("/a/b/fast.tar.gz") == "fast"
    assert name_of("car.onnx,model_metadata.json") == "car"
    assert name_of("folder/odd.name") == "odd.name"
