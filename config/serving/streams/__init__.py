"""The stream process (``python -m config.streams``) holds the open streams of all readers (:mod:`core.streams`). Its
threads query the database; everything else is one thread that never blocks."""
