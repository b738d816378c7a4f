"""Jobs as text, and what they request of a cluster."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import luigi
import pytest
from build_toys import Act
from expected_failures import refuses

from pipeline.cluster import backends
from pipeline.cluster.ray_driver import resource_request
from pipeline.cluster.remote_job import JobResult, RemoteJob
from pipeline.cluster.submission import remote_job_of


def test_a_job_requests_what_one_node_has():
    """The GPUs of one node and the cores of another do not add up."""
    job = replace(remote_job_of(Act("succeed"), "0" * 64, 8 << 30, 0), cores=8, gpus=2)
    nodes = {
        "small": {"CPU": 4.0, "GPU": 1.0, "memory": 4.0 * 2**30},
        "large": {"CPU": 64.0, "memory": 256.0 * 2**30},
    }
    request = resource_request(job, nodes)
    assert request.pop("label_selector") == {}
    assert request == {"num_cpus": 4, "num_gpus": 1, "memory": 4 << 30}
    assert resource_request(replace(job, gpus=0), nodes)["num_cpus"] == 8
    away = resource_request(replace(job, excluded_nodes=("small",)), nodes)
    assert (away["num_cpus"], away["num_gpus"]) == (8, 0)
    assert away["label_selector"] == {"ray.io/node-id": "!in(small)"}
    nowhere = resource_request(replace(job, excluded_nodes=("small", "large")), nodes)
    assert nowhere["label_selector"] == {}, "one of them runs the job"
    for growing in ({}, {"head": {"CPU": 0.0, "memory": 2.0**30}}):
        request = resource_request(job, growing)
        assert (request["num_cpus"], request["num_gpus"], request["memory"]) == (8, 2, 8 << 30)


def test_a_job_survives_json():
    job = remote_job_of(Act("succeed"), "0" * 64, 5 << 30, 0)
    assert RemoteJob.from_json(job.to_json()) == job
    assert job.parameters["executor"] == "subprocess", "the node does not submit it again"


@pytest.mark.parametrize("output", ["", "a line\n", '{"kind": "bui', "Killed\n[]\n"])
def test_output_without_a_result_means_a_lost_machine(output):
    assert JobResult.from_output(output).kind == "killed"


def test_the_last_result_in_the_output_counts():
    result = JobResult("built", host="n1")
    assert (
        JobResult.from_output(f"noise\n{JobResult('crash').to_json()}\n{result.to_json()}\n\n")
        == result
    )


@pytest.fixture
def options_of_slurm() -> Iterator[Callable[[str], list[str]]]:
    """Returns the options of `sbatch` for a job with `[slurm] options`."""
    config, job = luigi.configuration.get_config(), remote_job_of(Act("succeed"), "0" * 64, 0, 0)

    def options(text: str) -> list[str]:
        config.set("slurm", "options", text)
        return backends._sbatch_options(replace(job, gpus=0))

    yield options
    config.remove_section("slurm")


def test_quotes_in_options_of_slurm_are_those_of_a_shell(options_of_slurm):
    found = options_of_slurm("""--constraint="a100|h100" --comment='my grid' -p gpu""")
    assert found[-4:] == ["--constraint=a100|h100", "--comment=my grid", "-p", "gpu"]
    with refuses("[slurm] options", "luigi.cfg"):
        options_of_slurm("--comment='my grid")
