"""Classes: pages for teachers and learners, progress, deletion."""
