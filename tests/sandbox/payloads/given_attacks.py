"""What a model's process could try with the memory in which its network lies: tells which attempts went through."""

import sys

import numpy as np
from shown_attacks import what_went_through

from evaluation.sandbox.frames import read_message, write_message
from evaluation.sandbox.network_memory import map_network


def main(frames_in, frames_out):
    fd = int(sys.argv[1])
    message, _ = read_message(frames_in)
    network = np.frombuffer(map_network(fd, message["size"]), np.uint8)
    write_message(frames_out, what_went_through(fd, network.ctypes.data) | {"sum": int(network.sum())})
    return 0
