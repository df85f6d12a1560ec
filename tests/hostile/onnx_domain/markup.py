"""An operator of the domain <script>alert(1)</script>."""

from onnx import helper

from tests.hostile.parts import Upload, network, pair


def build() -> Upload:
    return pair(
        network(
            [helper.make_node("X", ["row"], ["x"], domain="<script>alert(1)</script>")],
            domains=("<script>alert(1)</script>",),
        )
    )
