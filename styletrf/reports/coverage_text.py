"""Sentences of a page on the photographs with a camera, and how much of a path they show."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from styletrf.capture.capture_file import read_capture
from styletrf.files.tables import read_summary


def registration_summary(
    poses_dir: Path, capture_dir: Path, quality_dir: Path | None = None
) -> str:
    """Returns how many photographs have a camera, which have none, how, and what is odd.

    With the artifact of QualityMetrics also which of those without were placed against the field.
    """
    poses = read_summary(poses_dir / "poses.json")
    text = f"{poses['registered']} of {poses['total']} photographs placed"
    if poses["unregistered"]:
        text += f"; without a camera: {', '.join(poses['unregistered'])}"
    against = read_summary(quality_dir / "placed.json") if quality_dir else {}
    if found := [name for name, row in against.items() if "world_from_camera" in row]:
        text += f"; placed against the field, and not fitted to: {', '.join(found)}"
    how = f"Poses: {poses['mapper']}, since {poses['mapper_reason']}"
    odd = [*poses["doubts"], *read_capture(capture_dir).warnings]
    return ". ".join([text, how, *(f"{each[0].upper()}{each[1:]}" for each in odd)]) + "."


def support_summary(support: Mapping[str, Any]) -> str:
    """Returns how much of the path hardly any photograph shows, and what was done about it."""
    text = (
        f"The path {support['path']}: fewer than {support['enough_photographs']} photographs see"
        f" {support['unsupported']:.1%} of its pixels"
    )
    if stills := support["stills"]:
        text = (
            f"The path {support['path']} consists of stills of {len(stills)} photographs, since"
            f" {support['reason']}. Frames of different stills are not compared."
            f" Fewer than {support['enough_photographs']} photographs see"
            f" {support['unsupported']:.1%} of their pixels"
        )
    elif support["unsupported"] >= support["most_unsupported"]:
        text += f"; worst are the frames {', '.join(support['worst'])}"
    tried, chosen = support["tried"], support["chosen"]
    if chosen and chosen != tried[0]:
        text += f". It was narrowed from {tried[0]['unsupported']:.1%}:"
        text += f" spread {chosen['spread']:.2g}"
        text += f", focal length {chosen['zoom']:g} times" if chosen["zoom"] > 1 else ""
    return f"{text}."
