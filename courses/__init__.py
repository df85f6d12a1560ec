"""Courses: classes of a teacher, assignments, marks."""

from . import reasons as reasons  # registers its codes
