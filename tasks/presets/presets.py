"""The presets draft, standard and paper (`--quality`): all values in which they differ.

A row is a field of the stage's configuration; dots reach into nested ones, and fields that are not
listed have the configuration's default. `draft` takes minutes on two CPU cores, `standard` is the
default, `paper` has the publication's settings for a GPU. `docs/knobs.md` explains the fields;
`docs/paper.md` compares them with the publication line by line.
"""

from typing import Any

PRESETS = ("draft", "standard", "paper")
DEFAULT_QUALITY = "standard"

_TABLE: dict[str, dict[str, tuple[Any, Any, Any]]] = {
    "SceneModel": {
        "image_long_side": (504, 1008, 1008),
        "max_voxels": (224**3, 384**3, 640**3),
    },
    "RadianceField": {
        "iterations": (5000, 8000, 15000),
        "batch": (1536, 3072, 4096),
        "batch_samples": (48 << 10, 96 << 10, 0),
        "upsample_at": (
            [0.06, 0.12, 0.2, 0.3],
            [0.06, 0.12, 0.2, 0.3],
            [2 / 15, 3 / 15, 4 / 15, 5 / 15],
        ),
        "initial_voxels": (80**3, 96**3, 128**3),
        "tv_views": (100, 100, 1),
        "occupancy_alpha": (0.02, 0.02, 5e-3),
        "ndc_step": (1.0, 1.4, 1.0),
        "factor_rate": (0.03, 0.03, 0.02),
        "network_rate": (3e-3, 3e-3, 1e-3),
        "field.density_ranks": ([16], [16], [4, 4, 4]),
        "field.appearance_ranks": ([24], [24], [12, 12, 12]),
        "field.hidden": (64, 64, 128),
    },
    "ContentImages": {
        "count": (1000, 8000, 80000),
    },
    "StyleNetwork": {
        "iterations": (90, 200, 40000),
        "batch": (2, 2, 4),
        "crop_px": (160, 192, 256),
        "style_px": (420, 420, 256),
        "learning_rate": (1e-3, 1e-3, 1e-3),
        "final_learning_rate": (1.5e-4, 1.5e-4, 1e-3),
        "identity_iterations": (150, 150, 0),
        "warm_start": (True, True, False),
        "statistics": ("sliced", "sliced", "gram"),
        "predictor_weight": (1.0, 1.0, 0.0),
        "color_weight": (2.0, 2.0, 0.0),
        "temporal_loss.weight": (0.0, 0.0, 0.0),
        "loss.relative": (
            True,
            True,
            False,
        ),  # False fits torchvision's VGG16 only, as do 1e5, 1e10
        "loss.content_layer": ("relu3_3", "relu3_3", "relu2_2"),
        "loss.content_weight": (1.2, 1.2, 1e5),
        "loss.style_weight": (1.0, 1.0, 1e10),
        "loss.style_layer_weights": (
            [4.0, 2.0, 1.5, 0.0],
            [4.0, 2.0, 1.5, 0.0],
            [1.0, 1.0, 1.0, 1.0],
        ),
        "loss.tv_weight": (15.0, 15.0, 0.0),
        "bfloat16": (True, True, False),
    },
    "PriorRenders": {
        "long_side_px": (504, 504, 0),
        "trajectory.frames": (40, 40, 30),
        "coverage.count": (0, 0, 30),
        "render.termination": (1e-2, 3e-3, 1e-3),
        "render.min_weight": (1e-2, 5e-3, 1e-3),
    },
    "TrajectoryFrames": {
        "trajectory.frames": (60, 120, 120),
        "render.termination": (1e-2, 1e-2, 1e-3),
        "render.min_weight": (1e-2, 1e-2, 1e-3),
    },
    "StylizedFrames": {
        "termination": (5e-2, 2e-2, 1e-3),
        "min_weight": (5e-2, 2e-2, 1e-3),
    },
    "QualityMetrics": {
        "render.termination": (1e-2, 3e-3, 1e-3),
        "render.min_weight": (1e-2, 5e-3, 1e-3),
        "perceptual_px": (252, 504, 504),
        "aligned": (False, True, True),
    },
    "ConsistencyMetrics": {
        "pairs": (8, 12, 12),
        "perceptual_pairs": (3, 4, 4),
    },
    "StylizedPriors": {
        "style_px": (420, 420, 256),
    },
    "StylizedField": {
        "adaptation.iterations": (300, 800, 1000),
        "adaptation.batch": (16384, 16384, 4096),
        "adaptation.factor_rate": (0.1, 0.1, 0.05),
        "adaptation.min_weight": (1e-2, 5e-3, 2e-3),
        "adaptation.fitted": ("samples", "samples", "rays"),
        "adaptation.sees_view": (False, False, True),
        "adaptation.tv_weight": (1e-4, 1e-4, 1e-3),
        "single_owner": (True, True, False),
        "shading": ("plain", "plain", "network"),
        "weight_power.powers": ([1.0, 1.5, 2.0], [1.0, 1.5, 2.0], [1.0]),
        "image.iterations": (75, 75, 60),
        "image.rate": (1.0, 1.0, 0.2),
        "image.rate_decay": (0.3, 0.3, 0.1),
        "image.color_weight": (3.0, 3.0, 20.0),
        "image.variance_weight": (30.0, 30.0, 0.0),
        "fit_fraction": (0.4, 0.4, 1.0),
        "image.min_weight": (5e-2, 2e-2, 1e-3),
        "image.termination": (5e-2, 2e-2, 1e-3),
        "content.rate": (0.8, 0.8, 0.0),
        "image_bfloat16": (True, True, False),
        "image_loss.content_layer": ("relu3_3", "relu3_3", "relu2_2"),
        "image_loss.content_weight": (0.8, 0.8, 3.0),
        "image_loss.tv_weight": (11.0, 11.0, 15.0),
        "image_loss.style_layer_weights": (
            [4.0, 2.0, 1.5, 0.0],
            [4.0, 2.0, 1.5, 0.0],
            [4.0, 2.0, 1.5, 1.0],
        ),
        "style_px": (420, 420, 256),
    },
}

_PAPER: dict[str, dict[str, Any]] = {  # only `paper` sets these
    "SceneModel": {"max_box_voxels": 300**3},
    "RadianceField": {
        "tv_density": 0.01,
        "tv_appearance": 0.001,
        "distortion_weight": 0.0,
        "average_share": 0.0,
        "early_gain_db": 0.0,
        "rate_decay": 0.1,
    },
    "PriorRenders": {"viewpoints": "path"},
    "StylizedPriors": {"start": "noise", "iterations": [300, 100]},
    "StylizedField": {"appearance_scale": 1.0},
}


def settings_for(family: str, quality: str) -> dict[str, Any]:
    """Returns a stage's settings in a preset, by field name."""
    column = PRESETS.index(quality)
    settings = {name: row[column] for name, row in _TABLE.get(family, {}).items()}
    return settings | (_PAPER.get(family, {}) if quality == "paper" else {})
