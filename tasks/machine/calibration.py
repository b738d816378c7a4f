"""The speed of this machine: seconds of reference workloads, measured and kept in the store.

They are measured with the environment of builds, and again after 30 days. Times measured on one
machine are multiplied by the ratio of two calibrations to become those of another. No result
depends on calibrations, and no key has them.
"""

import functools
import json
import logging
import platform
import subprocess
import sys
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from datetime import UTC, date, datetime, timedelta
from importlib.metadata import version
from pathlib import Path
from typing import Any

from pipeline.code.interpreters import json_from
from pipeline.digest import typed_digest
from pipeline.execution.cpu_memory import usable_cores
from pipeline.execution.environment import build_environment
from pipeline.execution.gpu import visible_gpus
from styletrf.errors import InputError
from tasks.machine.local_facts import add_fact, read_facts

_MAIN = "tasks.machine.calibration:main"
_log = logging.getLogger("pipeline")

CALIBRATIONS = "calibrations"
"""The file of the store that has those of all its machines."""
_LONGEST_KEPT = timedelta(days=30)
_LIBRARIES = ("numba", "opencv-contrib-python-headless", "pycolmap", "torch")
_THREADS_AND_ALLOCATOR = ("GOMP_", "OMP_", "MKL_", "MALLOC_", "GLIBC_TUNABLES")
_POSES = {"CameraPoses", "ContentImages", "SceneCapture", "SceneModel", "StyleImage"}
_FIELD = {
    "PriorRenders", "QualityMetrics", "RadianceField", "StylizedField", "StylizedFrames",
    "TrajectoryFrames",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Machine:
    """The machine and versions of a calibration, which holds for no others.

    Attributes:
        processor: Its name.
        cores: The number of cores that this process may use.
        device: The device of stages: `cpu`, or the GPUs by their UUIDs.
        versions: The versions of the libraries that compute.
        environment: The variables of builds for threads and memory; empty in older files.
    """

    processor: str
    cores: int
    device: str
    versions: Mapping[str, str]
    environment: Mapping[str, str] = field(default_factory=dict)

    @property
    def digest(self) -> str:
        """Its name in the file of calibrations."""
        return typed_digest("machine-v1", json.dumps(asdict(self), sort_keys=True).encode())

    @property
    def description(self) -> str:
        """Its cores and its processor, and how many GPUs stages compute on."""
        gpus = 0 if self.device == "cpu" else len(self.device.split(","))
        return f"{self.cores} cores, {self.processor}" + (f", {gpus} GPUs" if gpus else "")


@dataclass(frozen=True, slots=True)
class Calibration:
    """The seconds of the workloads `poses`, `field` and `network` on a machine, and the day."""

    machine: Machine
    seconds: Mapping[str, float]
    measured: str

    @classmethod
    def from_json(cls, fields: Mapping[str, Any]) -> "Calibration":
        """Returns the calibration with the fields that `dataclasses.asdict` returned."""
        return cls(**{**fields, "machine": Machine(**fields["machine"])})

    def times_slower_than(self, other: "Calibration", family: str) -> float:
        """Returns the seconds of a stage here over those on the other machine."""
        kind = workload_of(family)
        return self.seconds[kind] / other.seconds[kind]


def workload_of(family: str) -> str:
    """Returns the workload that stands for a stage."""
    return "poses" if family in _POSES else "field" if family in _FIELD else "network"


def this_machine(device: str = "auto") -> Machine:
    """Returns the machine and versions of a calibration for `--device`."""
    gpus = [] if device == "cpu" else visible_gpus()
    versions = {name: version(name) for name in _LIBRARIES}
    variables = build_environment().items()
    environment = {n: value for n, value in variables if n.startswith(_THREADS_AND_ALLOCATOR)}
    device = ",".join(gpus) or "cpu"
    return Machine(processor(), len(usable_cores()), device, versions, environment)


@functools.cache
def calibration_of_machine(device: str = "auto") -> Calibration:
    """Returns the calibration of this machine; measures it if the store has no recent one.

    The measurement takes some ten seconds, in an interpreter of its own; where kernels of the field
    were never compiled, half a minute more.

    Raises:
        InputError: The workloads fail, such as on a GPU that is not there.
    """
    machine = this_machine(device)
    with suppress(KeyError, TypeError, ValueError):
        kept = Calibration.from_json(read_facts(CALIBRATIONS)[machine.digest])
        if _today() - date.fromisoformat(kept.measured) <= _LONGEST_KEPT:
            return kept
    _log.info("Measuring how fast this machine is; it takes less than a minute.")
    return keep_calibration(machine, _measured(device))


def keep_calibration(machine: Machine, seconds: Mapping[str, float]) -> Calibration:
    """Keeps the seconds of the workloads, measured today, for a machine; returns both."""
    calibration = Calibration(machine, seconds, f"{_today()}")
    add_fact(CALIBRATIONS, machine.digest, asdict(calibration))
    return calibration


def _today() -> date:
    return datetime.now(UTC).date()


def processor() -> str:
    """Returns the processor's name."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text().splitlines() if path.exists() else []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def _measured(device: str) -> dict[str, float]:
    environment = build_environment()
    try:
        return dict(json_from(_MAIN, device, environment=environment, stderr=subprocess.PIPE))
    except subprocess.CalledProcessError as error:
        last = "".join(error.__notes__).strip().rpartition("\n")[2]
        raise InputError(
            f"--device {device}",
            f"could not be measured: {last or error}",
            "Correct it, or choose another device",
        ) from error


def main(device: str) -> None:
    """Writes the seconds of the workloads on a device, as JSON."""
    from styletrf.devices import device_named
    from styletrf.evaluation.calibration.workloads import measure_workloads

    sys.stdout.write(f"{json.dumps(measure_workloads(device_named(device)))}\n")
