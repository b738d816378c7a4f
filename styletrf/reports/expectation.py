"""The expected time and quality of a scene at each preset: a table of the scene's page."""

import html
from collections.abc import Mapping
from dataclasses import dataclass

from styletrf.field.training.cost import FieldCost
from styletrf.reports.page import duration, gibibytes


@dataclass(frozen=True, slots=True)
class Expectation:
    """The expected cost of a fly-through from an empty store, and the quality of its field.

    Attributes:
        field: The cost of the fit, timed on this scene.
        job_seconds: The seconds of all stages, one after the other.
        peak_memory_bytes: The peak memory of the stage that takes most.
        output_bytes: The bytes of all artifacts on disk.
        psnr_db: The PSNR of views that the field does not see; None where it is unknown.
        is_tried: Whether the field was timed and fitted briefly; else its cost is predicted, too.
    """

    field: FieldCost
    job_seconds: float
    peak_memory_bytes: int
    output_bytes: int
    psnr_db: float | None
    is_tried: bool = True


def expectation_table(expected: Mapping[str, Expectation], machine: str) -> str:
    """Returns the table as HTML, a row for each quality, of a machine; names are escaped."""
    columns = (
        "whole job", "of which the field", "memory", "disk", "voxels", "PSNR of unseen views",
    )  # fmt: skip
    head = "".join(f'<th class="number">{column}</th>' for column in columns)
    rows = "".join(_row(quality, each) for quality, each in expected.items())
    note = (
        f"On this machine: {html.escape(machine)}. The field is timed by a few iterations at its "
        "final size. Its PSNR is extrapolated from two brief fits, and may be off by a decibel or "
        "more. The other stages are predicted from earlier builds here, or from a reference and "
        f"the machine's speed.{_untried(expected)}"
    )
    return (
        f'<p class="quiet small">{note}</p><div class="card"><table><thead><tr><th>quality</th>'
        f"{head}</tr></thead><tbody>{rows}</tbody></table></div>"
    )


def _untried(expected: Mapping[str, Expectation]) -> str:
    """Returns a sentence on the qualities whose fields were not tried, or nothing."""
    names = [html.escape(quality) for quality, each in expected.items() if not each.is_tried]
    if not names:
        return ""
    return (
        f" The field of {', '.join(names)} is predicted, too, and its PSNR is unknown: brief fits"
        " of it take too long to try."
    )


def _row(quality: str, each: Expectation) -> str:
    values = (
        duration(each.job_seconds),
        duration(each.field.seconds),
        gibibytes(each.peak_memory_bytes),
        gibibytes(each.output_bytes),
        f"{each.field.voxels / 1e6:.1f} million",
        "unknown" if each.psnr_db is None else f"about {each.psnr_db:.1f} dB",
    )
    cells = "".join(f'<td class="number">{value}</td>' for value in values)
    return f'<tr><th scope="row">{html.escape(quality)}</th>{cells}</tr>'
