"""campaigns.profile: machines as a file states them, complaints with file, line and key, and the job scripts."""

import subprocess
from pathlib import Path

import pytest
from distributed import LocalCluster

from conespot.campaigns.cluster import client_of, security
from conespot.campaigns.ending import RunError
from conespot.campaigns.machines import jobs_in_words
from conespot.campaigns.profile import read_profile, scheduler_at
from conespot.scene import InputError

SLURM = """\
kind: slurm
jobs: 3
cores: 8
memory: 32 GB
walltime: '02:30:00'
queue: compute
account: eyes
interface: lo
log_directory: logs
variant: llvm_ad_spectral
job_extra_directives: ['--constraint=avx512']
job_script_prologue: ['module load python']
"""


@pytest.fixture
def read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def read(text):
        (tmp_path / "cluster.yaml").write_text(text)
        return read_profile("cluster.yaml")

    return read


def test_a_slurm_profile_is_the_job_script_that_it_says(read, tmp_path):
    profile = read(f"{SLURM}insecure: true\n")
    assert profile.workers == 24
    words = jobs_in_words(profile)
    assert words.startswith("3 jobs of this script:\n#!/usr/bin/env bash\n")
    lines = words.splitlines()
    for line in (
        "#SBATCH -p compute",
        "#SBATCH -A eyes",
        "#SBATCH --cpus-per-task=8",
        "#SBATCH --mem=30G",
        "#SBATCH -t 02:30:00",
        "#SBATCH --constraint=avx512",
        "module load python",
        "export CONESPOT_VARIANT=llvm_ad_spectral",
    ):
        assert line in lines
    command = lines[-1]
    assert "-m distributed.cli.dask_worker tcp://" in command
    # eight processes of one thread with a nanny each: a pose takes one thread, and a nanny replaces who dies or leaks
    assert "--nthreads 1 --memory-limit 3.73GiB --nworkers 8 --nanny" in command


@pytest.fixture
def certificates(tmp_path):
    """A key and a certificate that signs itself, as docs/cluster.md has them made."""
    command = "openssl req -x509 -newkey rsa:2048 -nodes -days 30 -subj /CN=conespot -keyout key.pem -out cert.pem"
    try:
        subprocess.run(command.split(), cwd=tmp_path, check=True, capture_output=True)
    except FileNotFoundError:
        pytest.skip("needs openssl")
    return "tls: {ca_file: cert.pem, cert: cert.pem, key: key.pem}\n"


def test_certificates_beside_the_profile_reach_the_jobs(read, certificates, tmp_path):
    profile = read(SLURM + certificates)
    command = jobs_in_words(profile).splitlines()[-1]
    assert "dask_worker tls://" in command
    assert f"--protocol tls:// --tls-ca-file {tmp_path / 'cert.pem'}" in command
    assert f"--tls-key {tmp_path / 'key.pem'}" in command


def test_a_scheduler_behind_tls_answers_those_who_show_its_certificate_and_nobody_else(read, certificates, tmp_path):
    profile = read(f"kind: scheduler\naddress: tls://127.0.0.1:1\n{certificates}")
    with LocalCluster(
        n_workers=0, processes=False, protocol="tls", security=security(profile.tls), dashboard_address="127.0.0.1:0"
    ) as cluster:
        address = cluster.scheduler_address
        assert address.startswith("tls://")
        with client_of(profile.model_copy(update={"address": address})) as client:
            assert client.nthreads() == {}
        with pytest.raises(RunError, match="no scheduler to work with"), client_of(scheduler_at(address)):
            pass


@pytest.mark.parametrize(
    ("kind", "line"),
    [
        ("pbs", "#PBS -l select=1:ncpus=8:mem=30GB"),
        ("sge", "#$ -q compute"),
        ("lsf", "#BSUB -n 8"),
        ("moab", "#PBS -q compute"),
        ("oar", "#OAR -q compute"),
        ("htcondor", "RequestCpus = MY.DaskWorkerCores"),
    ],
)
def test_every_job_system_has_a_script(read, kind, line):
    queue = "" if kind == "htcondor" else "queue: compute\n"
    text = f"kind: {kind}\njobs: 1\ncores: 8\nmemory: 32 GB\n{queue}insecure: true\n"
    assert line in jobs_in_words(read(text))


def test_a_machine_that_cannot_submit_jobs_is_said_before_anything_waits_for_them(read, monkeypatch):
    monkeypatch.setenv("PATH", "")
    profile = read(SLURM + "insecure: true\n")
    with pytest.raises(InputError, match="slurm: there is no sbatch here"), client_of(profile):
        pass


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("kind: slurn\n", "cluster.yaml:1: unknown kind 'slurn'; did you mean 'slurm'?"),
        ("kind: local\nworkers: 0\n", "cluster.yaml:2: workers: input should be greater than or equal to 1"),
        ("kind: local\nworkers: 2\nposes: 3\n", "cluster.yaml:3: poses: unknown key 'poses'"),
        ("kind: slurm\ncores: 8\nmemory: 1 GB\ninsecure: true\n", "cluster.yaml:1: jobs: is required but missing"),
        (SLURM, "cluster.yaml:1: the workers of jobs are reached over the network"),
        (f"{SLURM}tls: {{ca_file: no.pem, cert: c.yaml, key: c.yaml}}\n", "cluster.yaml:13: tls.ca_file: "),
        (SLURM.replace("'02:30:00'", "90") + "insecure: true\n", "cluster.yaml:5: walltime: write a time such as"),
        ("kind: local\nworkers: 2\npose_limit: 10\n", "cluster.yaml:3: pose_limit: 10 has no unit"),
        ('kind: pbs\njobs: 1\ncores: 1\nmemory: "1 GB\\nrm -rf"\ninsecure: true\n', "cluster.yaml:4: memory: "),
    ],
)
def test_what_is_wrong_with_a_profile_is_said_with_line_and_key(read, text, says):
    with pytest.raises(InputError) as caught:
        read(text)
    assert str(caught.value).startswith(says)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "address", ["tls://cluster:8786", "tcp://127.0.0.1:8786", "tcp://localhost:1", "tcp://[::1]:1"]
)
def test_a_scheduler_of_this_machine_or_behind_tls_is_trusted(address):
    assert scheduler_at(address).address == address


@pytest.mark.parametrize(
    "address", ["tcp://10.0.0.7:8786", "tcp://cluster:8786", "tcp://localhost.evil.org:1", "ws://h:1"]
)
def test_a_scheduler_over_the_open_network_is_refused_unless_the_profile_trusts_it(address, read):
    with pytest.raises(InputError, match=rf"--scheduler: {address} is neither this machine nor TLS.*insecure: true"):
        scheduler_at(address)
    assert read(f"kind: scheduler\naddress: {address}\ninsecure: true\n").insecure


@pytest.mark.parametrize("address", ["here", "http://127.0.0.1:8786", "tcp://127.0.0.1:99999", "tls://"])
def test_an_address_that_is_none_is_refused(address):
    with pytest.raises(InputError, match="--scheduler: .*must be one of Dask's, such as tls://HOST:8786"):
        scheduler_at(address)


def test_the_profiles_that_the_docs_show_can_be_read(read, certificates):
    text = (Path(__file__).parents[3] / "docs" / "cluster.md").read_text("utf-8")
    blocks = [block.partition("```")[0] for block in text.split("```yaml\n")[1:]]
    kinds = [read(block).kind for block in blocks if block.startswith("kind:")]
    assert kinds == ["local", "scheduler", "slurm"]
