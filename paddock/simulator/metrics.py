"""The evaluation metrics file of the field, so that its tools read our results."""

from __future__ import annotations

from typing import Any

from .race import CompetitorRun, RaceResult


def metrics_json(result: RaceResult | CompetitorRun) -> dict[str, Any]:
    """``{"metrics": [one dict a lap]}`` with times in simulated milliseconds (deepracer-simapp, metrics/s3_metrics.py).

    ``metric_time`` is the simulated time at the end of the lap, ``start_time`` at its beginning. ``episode``, ``phase``
    and ``reward_score`` belong to the training file of the same family; deepracer-utils reads no metrics without them.
    """
    return {
        "metrics": [
            {
                "completion_percentage": lap.completion_percentage,
                "metric_time": lap.start_ms + lap.time_ms,
                "start_time": lap.start_ms,
                "elapsed_time_in_milliseconds": lap.time_ms,
                "episode_status": lap.status,
                "crash_count": lap.crashes,
                "immobilized_count": lap.immobilised,
                "off_track_count": lap.off_tracks,
                "reversed_count": lap.reversals,
                "reset_count": lap.resets,
                "trial": lap.number,
                "episode": lap.number,
                "phase": "evaluation",
                "reward_score": 0,
            }
            for lap in result.laps
        ]
    }
