"""Writes to videos of runs. The row is the queue; a message is only a wake-up."""

from .queue import VIDEOS, DrawnVideo, finish_video
from .requests import VideoRequest, redraw_video, request_reel, request_video, stop_video
from .stored_files import forget_lost_file, note_watched, purge_videos, remove_videos_of_model
from .worker import encoder_problem, run_next_video
