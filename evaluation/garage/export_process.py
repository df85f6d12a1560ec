"""Writes a network in another format inside the sandbox.

Started by :mod:`.export`. Everything it needs is imported at the top: a locked process opens no file.
"""

from evaluation.sandbox.frames import LOCKED, MAX_NETWORK, read_message, write_message
from paddock.errors import UserFault
from paddock.packages.export import export_model
from paddock.packages.export import ir as ir  # imported by export_model, after the lock
from paddock.packages.limits import PackageLimits
from paddock.packages.metadata import parse_metadata


def main(frames_in: int, frames_out: int) -> int:
    """Answer one question: ``{form, limits}`` with the canonical network and the metadata as blobs."""
    write_message(frames_out, LOCKED)
    header, (onnx, about) = read_message(frames_in, blob_limit=MAX_NETWORK)
    try:
        metadata = parse_metadata(about, PackageLimits(**header["limits"]))
        archive = export_model(onnx, metadata, header["form"])
    except UserFault as fault:
        write_message(frames_out, {"state": "refused", "error": fault.to_dict()})
        return 0
    write_message(frames_out, {"state": "written"}, [archive])
    return 0
