"""Admits one network inside the sandbox: convert if need be, gate, write anew, run three synthetic frames.

Started by :mod:`.admission`, with the kind of network (a word of :mod:`paddock.packages.kinds`) as its argument.
Everything it needs is imported at the top: a locked process opens no file.
"""

import sys

from evaluation.sandbox.frames import LOCKED, MAX_NETWORK, read_message, write_message
from paddock.errors import UserFault
from paddock.packages.admission import admit_network
from paddock.packages.kinds import TENSORFLOW
from paddock.packages.limits import PackageLimits
from paddock.packages.metadata import parse_metadata

if TENSORFLOW in sys.argv[1:]:
    import paddock.packages.tensorflow  # noqa: F401  its format imports it at first use


def main(frames_in: int, frames_out: int) -> int:
    """Answer one question: ``{kind, limits, weights}`` with network, metadata and weights as blobs."""
    write_message(frames_out, LOCKED)
    header, blobs = read_message(frames_in, blob_limit=MAX_NETWORK)
    limits = PackageLimits(**header["limits"])
    try:
        metadata = parse_metadata(blobs.pop(1), limits)
        network, weights = [blobs.pop(0)], dict(zip(header["weights"], blobs, strict=True))
        del blobs
        canonical = admit_network(header["kind"], network, metadata, limits, weights)
    except UserFault as fault:
        write_message(frames_out, {"state": "refused", "error": fault.to_dict()})
        return 0
    admitted = {"state": "admitted", "parameters": canonical.parameters, "macs": canonical.macs}
    answer = {**admitted, "output": canonical.taken, "facts": canonical.facts.to_dict()}
    write_message(frames_out, answer, [canonical.onnx])
    return 0
