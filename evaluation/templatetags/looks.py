"""Pictures of cars in their shells and colours."""

from django import template
from django.utils.html import format_html
from django.utils.safestring import SafeString

from evaluation.appearance.looks import Shell
from evaluation.appearance.shells import FROM_ABOVE, FROM_THE_SIDE, GROUND

register = template.Library()


@register.simple_tag
def shell_picture(shell: str, colour: str, label: str = "") -> SafeString:
    """A shell in a colour (``#rrggbb``), as a picture from the side. Without a ``label`` it is decoration."""
    drawing = FROM_THE_SIDE.get(shell, FROM_THE_SIDE[Shell.PADDOCK])
    rear, front, radius = drawing.wheels
    wheels = [
        format_html(
            '<circle class="shell-tyre" cx="{0}" cy="{1}" r="{2}"/>'
            '<circle class="shell-rim" cx="{0}" cy="{1}" r="{3}"/>',
            x,
            GROUND - radius,
            radius,
            radius * 0.45,
        )
        for x in (rear, front)
    ]
    named = format_html(' role="img" aria-label="{}"', label) if label else SafeString(' aria-hidden="true"')
    return format_html(
        '<svg class="shell" viewBox="0 0 120 52"{}><path class="shell-body" fill="{}" d="{}"/>'
        '<path class="shell-dark" d="{}"/><path class="shell-glass" d="{}"/>{}{}</svg>',
        named,
        colour,
        drawing.body,
        drawing.dark,
        drawing.glass,
        *wheels,
    )


@register.simple_tag
def shell_from_above(shell: str, colour: str) -> SafeString:
    """The paths of a shell in a colour as it drives in a replay: the middle of the car at 0, driving to the right, 2
    units long."""
    drawing = FROM_ABOVE.get(shell, FROM_ABOVE[Shell.PADDOCK])
    return format_html(
        '<g transform="scale(.0175)"><path class="above-dark" d="{}"/><path class="above-body" fill="{}" d="{}"/>'
        '<path class="above-trim" d="{}"/><path class="above-glass" d="{}"/></g>',
        drawing.under,
        colour,
        drawing.body,
        drawing.dark,
        drawing.glass,
    )
