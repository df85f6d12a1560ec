"""A stranger's picture becomes ours: within bounds, square, small, and with nothing in it but pixels."""

import warnings
from io import BytesIO
from typing import IO

from PIL import Image, ImageOps, UnidentifiedImageError

from paddock.errors import UserFault

FORMATS = ("PNG", "JPEG", "WEBP")
MOST_MB = 4
MOST_MEGAPIXELS = 25  # 100 MB unpacked; what a telephone takes has 12
MOST_SIDE = 16_000
SIDE = 192  # twice what a profile shows, for sharp screens
QUALITY = 82


def read_picture(file: IO[bytes]) -> bytes:
    """Convert a picture to a square WebP of ``SIDE`` pixels without metadata; of an animation the first frame. Nothing
    is unpacked before its size is known. Raises UserFault("picture_too_large" | "picture_format" |
    "picture_too_many_pixels" | "picture_broken")."""
    content = file.read(MOST_MB * 1024 * 1024 + 1)
    if len(content) > MOST_MB * 1024 * 1024:
        raise UserFault("picture_too_large", limit_mb=MOST_MB)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # our own bound is lower
            picture = Image.open(BytesIO(content), formats=FORMATS)
    except Image.DecompressionBombError:
        raise UserFault("picture_too_many_pixels", limit=MOST_MEGAPIXELS) from None
    except (UnidentifiedImageError, OSError, ValueError, SyntaxError):
        raise UserFault("picture_format") from None
    if picture.width * picture.height > MOST_MEGAPIXELS * 1_000_000 or max(picture.size) > MOST_SIDE:
        raise UserFault("picture_too_many_pixels", limit=MOST_MEGAPIXELS)
    try:
        picture.draft("RGB", (2 * SIDE, 2 * SIDE))  # a JPEG is unpacked no finer than it is needed
        picture.load()
        turned = ImageOps.exif_transpose(picture)
        square = ImageOps.fit(turned.convert("RGBA"), (SIDE, SIDE), Image.Resampling.LANCZOS)
    except Exception as error:  # decoders of broken files raise whatever they like
        if isinstance(error, MemoryError):
            raise
        raise UserFault("picture_broken") from error
    opaque = square.getchannel("A").getextrema()[0] == 255
    clean = Image.frombytes(square.mode, square.size, square.tobytes())  # which knows no metadata at all
    out = BytesIO()
    (clean.convert("RGB") if opaque else clean).save(out, "WEBP", quality=QUALITY, method=4)
    return out.getvalue()
