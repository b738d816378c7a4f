"""Labels of the metrics in a report: name, meaning, format, and the value to compare with."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from styletrf.reports.metric_table import Figure, Metric, MetricTable

NOT_MEASURED = "not measured"


@dataclass(frozen=True, slots=True)
class Label:
    """The label of a metric.

    Attributes:
        key: Its name in `summary.json`.
        name: Its name in the report.
        meaning: One line for the report.
        form: Format of the value; "" for three significant digits.
        other: Key of the value to compare with, if any.
        word: The name of the other value, such as its floor.
        flickers: Whether it grows with differences between frames, which blur reduces.
    """

    key: str
    name: str
    meaning: str
    form: str = ""
    other: str = ""
    word: str = "floor"
    flickers: bool = False


QUALITY = (
    Label("psnr", "PSNR", "how near the field is to photographs held out; more is better",
            "{:.2f} dB"),
    Label("psnr_exposed", "PSNR, exposed alike", "the same once a render has the exposure of its"
            " photograph, found from both", "{:.2f} dB"),
    Label("psnr_aligned", "PSNR, aligned", "the same once each camera is where its render agrees"
            " best with the photograph; for measuring only", "{:.2f} dB"),
    Label("ssim", "SSIM", "the structure kept of them; 1 is the photograph itself", "{:.3f}"),
    Label("perceptual", "perceptual distance", "how unlike them it looks to a VGG16; 0 is alike",
            "{:.4f}"),
    Label("lpips", "LPIPS", "how unlike them it looks to people, as learned; 0 is alike",
            "{:.4f}"),
)  # fmt: skip
RESEMBLANCE = (
    Label("style_swd_colors", "colors", "how far the frames' colors are from the painting's, in"
            " steps just visible", "{:.2f}", "style_swd_colors_unstylized", "unstylized"),
    Label("style_swd_patches", "patches", "the same of squares of 7x7 pixels, at three scales",
            "{:.2f}", "style_swd_patches_unstylized", "unstylized"),
    Label("style_swd_texture", "texture", "the same of these squares without their mean colors:"
            " what no recoloring paints", "{:.2f}", "style_swd_texture_unstylized", "unstylized"),
    Label("style_gram", "Gram matrices", "relative distance to the painting, by a network that"
            " nothing is trained with", "{:.3f}", "style_gram_unstylized", "unstylized"),
    Label("sifid_vgg", "SIFID with VGG16", "distance to the painting's statistics of features",
            "{:.2f}", "sifid_vgg_unstylized", "unstylized"),
    Label("content", "content lost", "0 shows the scene as it was, 1 as little of it as the"
            " painting does", "{:.2f}"),
    Label("sharpness", "sharpness", "of detail, whatever the contrast", "{:.3f}",
            "sharpness_priors", "priors"),
    Label("content_style_product", "content and style", "(1 + content lost) (1 + SIFID over the"
            " unstylized frames'), as ArtFID's; 2 for these", "{:.2f}"),
)  # fmt: skip
PATH = (
    Label("unsupported", "pixels without support", "share that fewer than three photographs see,"
            " along the path", "{:.1%}"),
)  # fmt: skip
CONSISTENCY = (
    Label("error", "error along the flow",
            "the paper's: squared difference to the other frame, moved along the flow of the"
            " unstylized ones; all pixels", other="floor", flickers=True),
    Label("masked_error", "error where the flow holds",
            "the same, where flow there and back agree", other="masked_floor", flickers=True),
    Label("valid_fraction", "pixels where the flow holds", "share of all", "{:.0%}"),
    Label("geometric_error", "error along the geometry",
            "the other frame moved by the field's own depth, where nothing hides it",
            other="geometric_floor", flickers=True),
    Label("geometric_fraction", "pixels seen in both frames", "share of all", "{:.0%}"),
    Label("normalized_error", "error by contrast",
            "along the geometry; 1 is as unlike as unrelated frames", other="normalized_floor",
            flickers=True),
    Label("own_error", "error along its own geometry",
            "the other frame moved by the depth of the stylized field, where it has one of its"
            " own (S1, S2)", other="geometric_floor", flickers=True),
    Label("own_normalized_error", "error by contrast along its own geometry",
            "the same by contrast", other="normalized_floor", flickers=True),
    Label("own_fraction", "pixels seen in both frames by its own geometry", "share of all",
            "{:.0%}"),
    Label("perceptual_error", "perceptual change", "how unlike the two look to a VGG16",
            other="perceptual_floor", flickers=True),
    Label("style_distance", "style distance",
            "of the frames to the painting, by Gram matrices: a gray video is steady, and far off",
            other="style_distance_unstylized", word="unstylized"),
    Label("pairs", "pairs of frames", "compared", "{}"),
    Label("perceptual_pairs", "pairs looked at", "by the network: perceptual change and style"
            " distance", "{}"),
    Label("pairs_without_flow", "pairs without flow", "left out of the masked means", "{}"),
    Label("pairs_without_contrast", "pairs without contrast", "left out by contrast", "{}"),
    Label("pairs_without_correspondence", "pairs that share nothing", "left out of the means",
            "{}"),
    Label("pairs_without_own_correspondence", "pairs that share nothing by its own geometry",
            "left out of the means along it", "{}"),
    Label("flow", "flow", "how it was found", "{}"),
)  # fmt: skip


def metric_tables(summary: Mapping[str, Any]) -> list[MetricTable]:
    """Returns the metrics of a result in tables, without those that were not requested."""
    held_out = _table("Against photographs held out", QUALITY, {"": summary["quality"]})
    resembling = {"": summary.get("resemblance", {})}
    painted = _table("Against the painting and the unstylized frames", RESEMBLANCE, resembling)
    deltas = {term(delta): values for delta, values in by_delta(summary).items()}
    apart = ", ".join(f"{term(delta)}: {delta} apart" for delta in by_delta(summary))
    sharpness = resembling[""].get("sharpness_to_unstylized")
    between = _table(f"Between frames ({apart})", CONSISTENCY, deltas, sharpness)
    return [
        held_out,
        painted,
        between,
        _table("Along the path", PATH, {"": summary.get("path", {})}),
    ]


def by_delta(summary: Mapping[str, Any]) -> dict[int, Mapping[str, Any]]:
    """Returns the metrics of pairs of frames by the distance of the pair in frames, ascending."""
    consistency = summary["consistency"]
    deltas = {int(n.removeprefix("delta_")): n for n in consistency if n.startswith("delta_")}
    return {delta: consistency[deltas[delta]] for delta in sorted(deltas)}


def term(delta: int) -> str:
    """Returns the paper's term for pairs at this distance in frames."""
    return {1: "short term", 5: "long term"}.get(delta, f"{delta} frames")


def significant(value: float, digits: int = 3) -> str:
    """Returns a number with `digits` significant digits, without an exponent."""
    if not value or not math.isfinite(value):
        return f"{value:.0f}"
    rounded = float(f"{value:.{digits - 1}e}")
    return f"{rounded:.{max(0, digits - 1 - math.floor(math.log10(abs(rounded))))}f}"


def _table(
    title: str,
    labels: Sequence[Label],
    columns: Mapping[str, Mapping[str, Any]],
    sharpness: float | None = None,
) -> MetricTable:
    metrics = [
        Metric(m.name, m.meaning, [_figure(m, values, sharpness) for values in columns.values()])
        for m in labels
        if any(m.key in values for values in columns.values())
    ]
    return MetricTable(title, list(columns), metrics)


def _figure(label: Label, values: Mapping[str, Any], sharpness: float | None) -> Figure:
    value, other = values.get(label.key), values.get(label.other)
    if value is None:
        return Figure(NOT_MEASURED)
    write = label.form.format if label.form else significant
    if not label.other:
        return Figure(write(value))
    if other is None:
        return Figure(write(value), f"{label.word} {NOT_MEASURED}")
    beside = f"{label.word} {write(other)}"
    if other > 0:
        beside += f", {significant(value / other)}\N{NO-BREAK SPACE}times"
    if label.flickers and value < other:
        beside += f": {_why_below(sharpness)}"
    return Figure(write(value), beside)


def _why_below(sharpness: float | None) -> str:
    """Returns why stylized frames differ less than unstylized ones: less detail, or less change.

    `sharpness` is the ratio of sharpness, stylized over unstylized.
    """
    if sharpness is None:
        return (
            "less fine detail than the unstylized frames, or less contrast; sharpness not measured"
        )
    times = f"sharpness {significant(sharpness)}\N{NO-BREAK SPACE}times theirs"
    if sharpness < 1:
        return f"less fine detail than the unstylized frames ({times})"
    return f"less change than the unstylized frames, not for want of fine detail ({times})"
