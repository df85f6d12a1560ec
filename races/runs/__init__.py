"""Pages, files, videos and comparisons of one run."""
