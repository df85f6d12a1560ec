"""Classes: pages for teachers and learners, progress, and deleting one with all that was made in it."""
