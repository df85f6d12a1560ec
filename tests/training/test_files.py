"""What a training is downloaded as: a zip and a JSON that are sent while they are written."""

from __future__ import annotations

import gzip
import io
import json
import re
import zipfile
from functools import partial

import pytest
from django.core.files.base import ContentFile
from django.core.files.storage import default_storage

from core.files.zip_stream import part_of, part_of_gzip, zipped
from tests.community import community
from tests.evaluation.stubs import trace_csv
from tests.training.jobs import REWARD, a_training
from training.jobs.exports import logs_zip, metrics_json, training_metrics
from training.models import TrainingIteration, TrainingJob


def opened(parts) -> zipfile.ZipFile:
    archive = zipfile.ZipFile(io.BytesIO(b"".join(zipped(parts))))
    assert archive.testzip() is None, "a check sum is wrong"
    return archive


class TestZip:
    TEXT = b"steps,X,Y\n" * 5000

    def test_it_holds_every_part_it_was_given(self):
        parts = [part_of("a.txt", [b"one ", b"two"]), part_of("차량/empty", []), part_of("b.csv", [self.TEXT])]
        with opened(parts) as archive:
            assert archive.namelist() == ["a.txt", "차량/empty", "b.csv"]
            assert [archive.read(name) for name in archive.namelist()] == [b"one two", b"", self.TEXT]

    def test_a_gzip_is_copied_without_unpacking(self):
        packed = gzip.compress(self.TEXT)
        part = part_of_gzip("trace.csv", packed)
        assert part.deflated in packed, "it is not packed anew"
        with opened([part]) as archive:
            assert archive.read("trace.csv") == self.TEXT

    def test_an_unusual_gzip_is_unpacked_first(self):
        file = io.BytesIO()
        with gzip.GzipFile("a name in the head.csv", "wb", fileobj=file) as packed:
            packed.write(self.TEXT)
        with opened([part_of_gzip("trace.csv", file.getvalue())]) as archive:
            assert archive.read("trace.csv") == self.TEXT

    def test_no_parts_make_an_empty_zip(self):
        assert opened([]).namelist() == []

    def test_only_one_part_is_in_memory_at_a_time(self):
        read = []

        def parts():
            for name in ("a", "b"):
                read.append(name)
                yield part_of(name, [b"x"])

        pieces = zipped(parts())
        next(pieces)
        assert read == ["a"]


@pytest.mark.django_db
class TestTrainingFiles:
    @pytest.fixture
    def job(self, alice, oval, now, training_wakes) -> TrainingJob:
        job = a_training(alice, oval, now)
        TrainingJob.objects.filter(pk=job.pk).update(log="한 줄\n")
        one = {"reward": 1.5, "progress": 20.0, "status": "Off track", "steps": 30, "time_ms": 2000}
        for number in (1, 2, 3):
            name = default_storage.save(f"training/{number}.csv.gz", ContentFile(gzip.compress(b"%d\n" % number)))
            TrainingIteration.objects.create(
                job=job,
                number=number,
                steps=number,
                seconds=1.0,
                episodes=[one] * (number - 1),
                eval_trials=[one] * (number % 2),
                eval_progress=20.0,
                eval_reward=1.5,
                simtrace=name,
            )
        job.refresh_from_db()
        return job

    def test_streamed_metrics_equal_the_whole_ones(self, job):
        pieces = list(metrics_json(job))
        assert len(pieces) == 4
        assert json.loads(b"".join(pieces)) == training_metrics(job)
        assert len(training_metrics(job)["metrics"]) == 5

    def test_a_training_that_never_drove_has_no_metrics(self, job):
        job.iterations.all().delete()
        assert json.loads(b"".join(metrics_json(job))) == training_metrics(job)
        assert training_metrics(job)["metrics"] == []

    def test_the_zip_has_every_file_that_still_exists(self, job):
        default_storage.delete(job.iterations.get(number=2).simtrace.name)
        with zipfile.ZipFile(io.BytesIO(b"".join(logs_zip(job)))) as archive:
            assert archive.testzip() is None
            assert archive.read("reward_function.py").decode() == REWARD
            log = archive.read("logs/training/first-robomaker.log").decode()
            assert "한 줄\n" in log and " * /WORLD_NAME: oval\n" in log
            traces = [name for name in archive.namelist() if name.startswith("sim-trace/")]
            assert [name[-15:] for name in traces] == ["0-iteration.csv", "2-iteration.csv"]
            assert archive.read(traces[1]) == b"3\n"

    def test_deepracer_utils_reads_the_metrics(self, job, tmp_path, monkeypatch):
        """deepracer-utils, TrainingMetrics: it looks for AWS's shop first, which nothing is asked of."""
        monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
        path = tmp_path / "training-metrics.json"
        path.write_bytes(b"".join(metrics_json(job)))
        table = community().metrics.TrainingMetrics("no-bucket", fname=str(path))
        training = table.getTraining()
        assert list(training["reward"]) == [2, 2, 2] and list(training["completion"]) == [20, 20, 20]
        assert len(table.getEvaluation()) == 2

    @pytest.fixture
    def unpacked(self, job, tmp_path):
        """The folder that somebody unpacks; three iterations with traces as they are driven."""
        for iteration in job.iterations.order_by("number"):
            csv = trace_csv(laps=4, steps=6, salt=iteration.number)
            csv = re.sub(rb"^([0-9]+),([0-9]+),", partial(_counted, iteration.number), csv, flags=re.MULTILINE)
            with default_storage.open(iteration.simtrace.name, "wb") as file:
                file.write(gzip.compress(csv))
        with zipfile.ZipFile(io.BytesIO(b"".join(logs_zip(job)))) as archive:
            archive.extractall(tmp_path)
        return tmp_path

    def test_deepracer_utils_reads_the_unpacked_folder(self, job, unpacked):
        log = community().DeepRacerLog(str(unpacked))
        log.load()
        # the first cells of the community's notebook Training_analysis
        frame = log.dataframe()
        assert len(frame) == 3 * 4 * 6
        assert frame["episode"].tolist() == sorted(frame["episode"].tolist())
        assert log.hyperparameters() == job.hyperparameters
        assert log.action_space() == job.action_space
        assert log.agent_and_network() == {
            "world": "oval",
            "sensor_list": job.sensors,
            "network": job.neural_network,
            "simapp_version": "5",
        }
        table = community().AnalysisUtils.simulation_agg(frame)
        assert table["steps"].tolist() == [6] * 12
        community().AnalysisUtils.analyze_training_progress(table, title="Training progress")

    def test_deepracer_utils_reads_the_traces_alone(self, job, unpacked):
        log = community().DeepRacerLog(str(unpacked))
        log.load_training_trace()
        assert sorted(log.dataframe()["iteration"].unique()) == [0, 1, 2]
        assert log.hyperparameters() == job.hyperparameters
        assert log.agent_and_network()["sensor_list"] == job.sensors

    def test_deepracer_utils_reads_a_continuous_car_and_a_cut_log(self, job, unpacked, tmp_path):
        ranges = {"steering_angle": {"low": -30.0, "high": 30.0}, "speed": {"low": 0.5, "high": 2.0}}
        TrainingJob.objects.filter(pk=job.pk).update(
            action_space_type="continuous", action_space=ranges, log="cut off in the mid"
        )
        job.refresh_from_db()
        with zipfile.ZipFile(io.BytesIO(b"".join(logs_zip(job)))) as archive:
            archive.extractall(tmp_path / "again")
        log = community().DeepRacerLog(str(tmp_path / "again"))
        log.load()
        assert log.action_space() == ranges
        assert len(log.dataframe()) == 3 * 4 * 6


def _counted(number: int, row: re.Match) -> bytes:
    """Episodes go on from iteration to iteration, and steps are floats, as the trainer writes them."""
    return b"%d,%d.0," % (int(row[1]) + 4 * (number - 1), int(row[2]))
