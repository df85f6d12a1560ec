"""The field's simulation log ("robomaker log") as deepracer-utils reads it (logs/log.py, logs/log_utils.py): settings,
then a line for each control step. No Django."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

_STEP = re.compile(rb"^([0-9]+,[0-9]+)\.0,", re.MULTILINE)
_LINE = b"SIM_TRACE_LOG:"
METADATA, HYPERPARAMETERS = "model/model_metadata.json", "ip/hyperparameters.json"  # where the tools look for them


def settings_lines(
    world: str, hyperparameters: Mapping[str, Any] | None = None, metadata: Mapping[str, Any] | None = None
) -> bytes:
    """The head of a log: the track, the car and the hyperparameters (flat: the tools stop at the first brace).
    ``metadata``: a model_metadata.json; left out for somebody else's car."""
    lines = [f" * /WORLD_NAME: {world}"]
    if metadata is not None:
        sensors, actions = list(metadata["sensor"]), metadata["action_space"]
        lines += [
            f"Sensor list {sensors!r}, network {metadata['neural_network']}, simapp_version {metadata['version']}, "
            f"training_algorithm {metadata['training_algorithm']}, "
            f"action_space_type {metadata['action_space_type']}",
            f"Loaded action space from file: {actions!r}",
        ]
    lines += ["Using the following hyper-parameters", json.dumps(dict(hyperparameters or {}), indent=2)]
    return ("\n".join(lines) + "\n").encode()


def trace_lines(sim_traces: Iterable[bytes]) -> Iterator[bytes]:
    """The rows of sim-traces (CSV with a header) as lines of the log; a step's number is a whole one there."""
    for csv in sim_traces:
        rows = csv.partition(b"\n")[2].rstrip(b"\n")
        if rows:
            yield _LINE + _STEP.sub(rb"\1,", rows).replace(b"\n", b"\n" + _LINE) + b"\n"
