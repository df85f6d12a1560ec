"""Every write to videos of runs. The row is the truth, a message only a bell: as with evaluations."""

from .ask import Asked, ask_for_video, draw_again, stop_video
from .bell import ring_video_bell
from .keep import forget_lost_file, note_watched, purge_videos, remove_videos_of_model
from .leases import (
    DrawnVideo,
    beat_video,
    claim_next_video,
    fail_video,
    finish_video,
    release_video,
    sweep_videos,
)
from .work import encoder_problem, run_next_video

__all__ = [
    "Asked",
    "DrawnVideo",
    "ask_for_video",
    "beat_video",
    "claim_next_video",
    "draw_again",
    "encoder_problem",
    "fail_video",
    "finish_video",
    "forget_lost_file",
    "note_watched",
    "purge_videos",
    "release_video",
    "remove_videos_of_model",
    "ring_video_bell",
    "run_next_video",
    "stop_video",
    "sweep_videos",
]
