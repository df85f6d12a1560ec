"""Every bound on an upload."""

# Settings pass a changed copy; other modules of this package define no limits.

from dataclasses import dataclass

MEGABYTE = 1024 * 1024


@dataclass(frozen=True)
class PackageLimits:
    """What an uploaded package may weigh and what its network may cost.

    The defaults let all of the console's cars through. Three layers: a graph of 23.4 MB with one layer of 5.77 million
    weights, 22 million multiplications and half a million values read and written a step. Five layers: 115 MB, 28.7
    million weights in one layer, 126 million multiplications; with stereo cameras 230 MB, 57.3 and 511 million.
    """

    # --- the upload
    upload_bytes: int = 512 * MEGABYTE  # all parts together, as sent
    model_bytes: int = 256 * MEGABYTE  # the network, unpacked
    metadata_bytes: int = 100_000
    expanded_bytes: int = 2048 * MEGABYTE  # everything in an archive, unpacked
    expansion_ratio: int = 100  # unpacked : packed, once more than `expansion_free_bytes` came out
    expansion_free_bytes: int = 4 * MEGABYTE
    parts: int = 8  # files sent together
    archive_members: int = 10_000
    member_name_bytes: int = 255

    # --- the network's file
    wire_fields: int = 200_000  # protobuf fields, at any depth
    graph_nodes: int = 4_096  # operations in a frozen TensorFlow graph, before conversion
    nodes: int = 512  # operations in the ONNX graph
    tensor_elements: int = 64_000_000  # one weight tensor

    # --- the network's work, for one step. Measured on one core: 22 million multiplications (the three-layer network,
    # bound by reading its weights) 1 ms, 99 million (five layers) 2 ms, 457 million 5-10 ms.
    macs: int = 600_000_000  # multiplications
    elements: int = 8_000_000  # values read and written, summed over all operations; the costliest take 20 ns each

    # --- admitting
    slots: int = 2  # conversions at a time
    slot_wait_s: float = 20.0
    waiting: int = 2  # uploads that may wait for a slot; with the slots fewer than the web server has threads


DEFAULT_LIMITS = PackageLimits()
