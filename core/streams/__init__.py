"""The site's single stream of server-sent events.

A page follows *topics* (``race:7``, ``run:Ab3``, ``me``); the stream process (:mod:`config.serving.streams`) sends it
the positions of events that move them, and the page reloads its parts. No private data travels on the stream."""

from ..wakeups.streams import poke, poke_after_commit, push, ring_after_commit
from .topics import TOPICS, Backstage, Topic, can_follow, register_moves, register_topic, topics_of
