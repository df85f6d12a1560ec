"""Pages of one run: result, replay, comparison, camera and video."""
