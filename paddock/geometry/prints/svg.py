"""A track as an SVG whose size is the floor's: one unit is a millimetre."""

from __future__ import annotations

from xml.sax.saxutils import escape

from .drawing import COLOURS, Drawing


def write_svg(drawing: Drawing) -> bytes:
    """The drawing with a group for each layer."""
    width, height = f"{drawing.width:.2f}", f"{drawing.height:.2f}"
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}mm" height="{height}mm" '
        f'viewBox="0 0 {width} {height}" fill-rule="evenodd">',
        f"<title>{escape(drawing.name)}</title>",
    ]
    for layer, (red, green, blue) in COLOURS.items():
        lines.append(f'<g id="{layer}" fill="#{red:02x}{green:02x}{blue:02x}">')
        for shape in drawing.layers[layer]:
            rings = (
                "M" + "L".join(f"{x:.2f} {drawing.height - y:.2f}" for x, y in ring.tolist()) + "Z" for ring in shape
            )
            lines.append(f'<path d="{"".join(rings)}"/>')
        lines.append("</g>")
    return "\n".join([*lines, "</svg>", ""]).encode()
