"""The stream process: ``python -m config.streams``. It holds the open streams of all readers (:mod:`core.streams`).

- :mod:`.server`: Uvicorn, with connections of its own port and those that the web server hands over (:mod:`.handover`).
- :mod:`.application`: what it answers.
- :mod:`.hub`: who follows what, and what they are told. :mod:`.reader` is one of them.
- :mod:`.feed`: where news come from: the table, and the bell.
- :mod:`.life`: a sign of life for the health page and ``doctor``.
- :mod:`.viewers`: who a reader is, and whether they still are.

The database is asked in threads of this process; everything else is one thread and waits for nothing.
"""
