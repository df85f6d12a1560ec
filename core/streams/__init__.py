"""The site's one stream of server-sent events: what moves, for whoever may see it.

A page says what it shows as *topics* (``race:7``, ``run:Ab3``, ``me``). The stream process (:mod:`config.streams`)
follows the events and tells each reader which of their topics moved, by the positions of the events; what is there to
see, the page then asks for as it always does. So nothing private travels on the stream.

- :mod:`.topics`: which topics there are, who may follow them, and which of them an event moves. Rooms register theirs.
- :mod:`.bell`: wakes the stream processes of all machines after a commit, and carries what is not kept in the table:
  the progress of a run (:func:`poke`), and messages with data of their own (:func:`push`).
- :mod:`.reading`: the table as the stream process reads it.
"""

from .bell import poke, poke_after_commit, push, ring_after_commit
from .topics import TOPICS, Backstage, Topic, can_follow, register_moves, register_topic, topics_of

__all__ = [
    "TOPICS",
    "Backstage",
    "Topic",
    "can_follow",
    "poke",
    "poke_after_commit",
    "push",
    "register_moves",
    "register_topic",
    "ring_after_commit",
    "topics_of",
]
