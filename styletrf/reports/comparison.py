"""Two videos of one path over each other, with a slider between them, played as one.

Without JavaScript they stand one below the other, each with the browser's own controls.
"""

import html
from dataclasses import dataclass
from pathlib import Path

STYLE = Path(__file__).with_name("comparison.css").read_text(encoding="utf-8")
SCRIPT = Path(__file__).with_name("comparison.js").read_text(encoding="utf-8")


@dataclass(frozen=True, slots=True)
class Comparison:
    """The pictures to show, as URIs; an empty one is left out. `aspect` is width over height."""

    video: str = ""
    unstylized_video: str = ""
    poster: str = ""
    aspect: float = 4 / 3


def comparison(shown: Comparison) -> str:
    """Returns the HTML; a video alone has the browser's controls, without any stands the poster.

    The page that holds it needs `STYLE` and `SCRIPT`.
    """
    poster = html.escape(shown.poster)
    if not shown.video:
        image = f'<img src="{poster}" alt="A frame of the stylized trajectory">'
        return f'<div class="stage">{image}</div>' if shown.poster else ""
    stylized = _video(shown.video, f'aria-label="The stylized video" poster="{poster}"')
    if not shown.unstylized_video:
        return _stage(shown, f'<div class="single">{stylized}</div>')
    unstylized = _video(shown.unstylized_video, 'class="before" aria-label="Before it was painted"')
    return _stage(shown, f'<div class="compare">{stylized}{unstylized}{_SLIDER}</div>{_CONTROLS}')


def _stage(shown: Comparison, body: str) -> str:
    return f'<div class="stage" style="--aspect:{shown.aspect:.4f}">{body}</div>'


def _video(uri: str, attributes: str) -> str:
    """The script puts the video into a Blob: Firefox has URIs of up to 32 MB, Safari plays none."""
    common = 'controls muted loop playsinline preload="metadata"'
    return f'<video src="{html.escape(uri)}" {common} {attributes}></video>'


_SLIDER = (
    '<span class="label">before</span><span class="label after">stylized</span>'
    '<div class="edge"></div>'
    '<input class="split" type="range" min="0" max="100" value="50" step="any" '
    'aria-label="Where the unstylized video ends and the stylized one begins">'
)
_CONTROLS = (
    '<div class="controls"><button type="button">Play</button>'
    '<input class="seek" type="range" min="0" max="1" value="0" step="any" aria-label="Time">'
    '<output class="quiet small"></output></div>'
)
