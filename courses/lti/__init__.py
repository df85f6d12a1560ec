"""Courses on a learning platform (Moodle, Canvas) by LTI 1.3: log-in, links to assignments, marks back.

Loaded only where PADDOCK_LTI is set; the library (PyLTI1p3) only by the first launch of a process."""
