"""The settings of a fit, named as TensoRF names them where it has them."""

from dataclasses import dataclass, field, replace

from styletrf.configuration import SEEDS, require_at_least, require_within
from styletrf.field.field_config import FieldConfig


@dataclass(frozen=True, slots=True)
class FieldTrainingConfig:
    """Settings of the fit of a field; names in brackets are TensoRF's."""

    field: FieldConfig = field(default_factory=FieldConfig)
    iterations: int = 3000  # [n_iters]
    batch: int = 1536  # least rays an iteration [batch_size]
    batch_samples: int = 48 << 10  # more rays, up to eight times `batch`, while they have so few
    initial_voxels: int = 80**3  # [N_voxel_init]
    upsample_at: tuple[float, ...] = (0.06, 0.12, 0.2, 0.3)  # of the iterations [upsamp_list]
    steps_per_voxel: float = 0.7  # steps to the mean side of a voxel
    ndc_step: float = 1.0  # the steps of NDC, whose voxels are longest along the rays, times this
    factor_rate: float = 0.03  # [lr_init]
    network_rate: float = 3e-3  # [lr_basis]
    rate_decay: float = 0.05  # over the planned iterations, as of TV [lr_decay_target_ratio]
    average_share: float = 0.1  # of the iterations: window of the average of parameters; 0: none
    early_gain_db: float = 0.15  # of validation views: with less, a fit ends early; 0: none are
    steep_gain_db: float = 0.6  # likewise: with as much, a fit is a quarter longer; 0: never
    l1_weight: float = 2e-5  # on density factors [L1_weight_inital]
    tv_density: float = 0.01  # [TV_weight_density]
    tv_appearance: float = 0.003  # [TV_weight_app]
    tv_views: int = 100  # so many views have these two weights; fewer have more, in proportion
    tv_every: int = 4  # iterations between steps of L1 and total variation, weighted up to match
    distortion_weight: float | None = None  # where not given, the space decides: see `in_space`
    depth_weight: float = 0.1  # for every iteration, see `styletrf.field.training.observed_depths`
    depth_rays: int = 1024  # of pixels with depths, every `depth_every` iterations
    depth_every: int = 4
    depth_until: float = 0.3  # of the iterations: voxels that are empty by then stay so
    dense_depth_until: float = 0.1  # likewise with depths by stereo, see decision 54
    occupancy_every: int = 200
    occupancy_alpha: float = 0.02  # opacity of one step that counts as occupied [alpha_mask_thre]
    min_weight: float = 3e-3  # samples lighter than this get no color [rm_weight_mask_thre]
    termination: float = 1e-4
    gradient_threshold: float = 3.0  # smaller gradients are dropped, see `sparsification`
    color_threshold: float = 1.0  # likewise those of the colors
    shrink_rise: float = 0.01  # of the loss, for which a finished field is made smaller; 0: never
    checkpoint_seconds: float = 60.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not all(0 < fraction < 1 for fraction in self.upsample_at):
            raise ValueError(f"upsample_at is {self.upsample_at}, not fractions of the iterations")
        require_within(SEEDS, self, "seed")
        require_within("[0, 1]", self, "average_share")
        require_within("(0, 1]", self, "rate_decay")
        require_within("[0, 1)", self, "min_weight", "termination", "occupancy_alpha")
        require_within("(0, inf)", self, "steps_per_voxel", "ndc_step")
        require_within("(0, inf)", self, "factor_rate", "network_rate")
        weights = "l1_weight", "tv_density", "tv_appearance", "depth_weight"
        require_within("[0, inf)", self, *weights)
        if self.distortion_weight is not None:
            require_within("[0, inf)", self, "distortion_weight")
        counts = "iterations", "batch", "initial_voxels", "tv_views", "tv_every"
        require_at_least(1, self, *counts, "depth_rays", "depth_every", "occupancy_every")

    def in_space(self, kind: str) -> "FieldTrainingConfig":
        """Returns the settings, with the ranks and the weight of distortion that suit the space.

        Photographs from all around say where a surface is, and gathered weights draw strokes on it
        crisply. Those of NDC hardly say where leaves lie along their rays: density that is spread
        there fits them better (decision 43).
        """
        weight = self.distortion_weight
        if weight is None:
            weight = 0.0 if kind == "ndc" else 0.02
        return replace(self, field=self.field.in_space(kind), distortion_weight=weight)

    def steps_in(self, kind: str) -> float:
        """Returns the steps to the mean side of a voxel of a space."""
        return self.steps_per_voxel / (self.ndc_step if kind == "ndc" else 1.0)

    @property
    def average_every(self) -> int:
        """Iterations from one averaged value to the next: at most 10, and ten values a window."""
        return min(10, max(1, int(self.average_share * self.iterations / 10)))

    @property
    def average_window(self) -> float:
        """The length of the window, in averaged values."""
        return self.average_share * self.iterations / self.average_every

    @property
    def upsample_steps(self) -> tuple[int, ...]:
        """The iterations at which the grid grows."""
        last = max(1, self.iterations - 1)
        steps = (round(fraction * self.iterations) for fraction in self.upsample_at)
        return tuple(min(max(1, step), last) for step in steps)
