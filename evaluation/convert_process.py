"""The admission of one network, inside the sandbox: convert if need be, gate, write anew, run three synthetic frames.

Started by :mod:`.admit` through ``evaluation.sandbox.launch``, which locks the process before :func:`main` is called.
Everything it needs is imported here at the top: a locked process opens no file. Only this process ever parses a byte
of a stranger's network before its canonical form exists.
"""

from __future__ import annotations

from evaluation.sandbox.frames import MAX_NETWORK, read_message, write_message
from paddock.errors import UserFault
from paddock.packages.admission import admit_network
from paddock.packages.limits import PackageLimits
from paddock.packages.metadata import parse_metadata

LOCKED = {"state": "locked"}


def main(frames_in: int, frames_out: int) -> int:
    """Answer one question: ``{kind, limits, weights}`` with the network, the metadata and the files of weights that
    ``weights`` names as blobs in, the canonical network out."""
    write_message(frames_out, LOCKED)
    header, blobs = read_message(frames_in, blob_limit=MAX_NETWORK)
    limits = PackageLimits.from_dict(header["limits"])
    try:
        metadata = parse_metadata(blobs.pop(1), limits)
        network, weights = [blobs.pop(0)], dict(zip(header["weights"], blobs, strict=True))
        del blobs
        canonical = admit_network(header["kind"], network, metadata, limits, weights)
    except UserFault as fault:
        write_message(frames_out, {"state": "refused", "error": fault.to_dict()})
        return 0
    said = {"state": "admitted", "parameters": canonical.parameters, "macs": canonical.macs, "output": canonical.taken}
    write_message(frames_out, {**said, "facts": canonical.facts.to_dict()}, [canonical.onnx])
    return 0
