"""Every write to videos of runs. The row is the truth, a message is only a wake-up: as with evaluations."""

from .ask import Asked, ask_for_reel, ask_for_video, draw_again, stop_video
from .jobs import VIDEOS, DrawnVideo, finish_video
from .keep import forget_lost_file, note_watched, purge_videos, remove_videos_of_model
from .work import encoder_problem, run_next_video

__all__ = [
    "VIDEOS",
    "Asked",
    "DrawnVideo",
    "ask_for_reel",
    "ask_for_video",
    "draw_again",
    "encoder_problem",
    "finish_video",
    "forget_lost_file",
    "note_watched",
    "purge_videos",
    "remove_videos_of_model",
    "run_next_video",
    "stop_video",
]
