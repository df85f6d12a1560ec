"""What the camera of a finished run saw, and which parts of a frame moved the network's answer."""
