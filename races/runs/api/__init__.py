"""The API of runs: results, files, comparisons, videos and test runs."""
