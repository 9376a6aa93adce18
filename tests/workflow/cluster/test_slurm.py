"""The data set made by jobs of a real Slurm, one of them killed, is the data set made here."""

import os
import re
import shutil
import subprocess
import time
from pathlib import Path

import pytest

from raptor.dataset.compare import differences
from tests.workflow.place import ENVIRONMENT, PROFILES, variant

SLURM = Path(__file__).with_name("slurm")
PROFILE = PROFILES / "slurm"
MISSING = [name for name in ("munged", "slurmctld", "slurmd", "squeue") if shutil.which(name) is None]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """A Slurm with four slots: two nodes' worth."""
    if MISSING:
        pytest.skip(f"{', '.join(MISSING)} not found; apt-get install slurmctld slurmd slurm-client munge")
    if os.geteuid() != 0:
        pytest.skip("Slurm's daemons are started by root only")
    folder = tmp_path_factory.mktemp("slurm")
    started = subprocess.run([SLURM, "up", folder], capture_output=True, text=True, check=False)
    if started.returncode == 3:
        pytest.skip(started.stderr.strip())
    assert started.returncode == 0, started.stderr
    yield folder
    subprocess.run([SLURM, "down", folder], check=True)


def running(rule):
    """Ids of the rule's jobs that Slurm runs now."""
    listed = subprocess.run(
        ["squeue", "--noheader", "--states=RUNNING", "--format=%i %k"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    return re.findall(rf"^(\d+) rule_{rule}", listed.stdout, re.MULTILINE)


def test_jobs_are_submitted_a_cancelled_one_again_and_the_data_are_the_same(
    cluster, results, workplace, tmp_path
):
    place = workplace("cluster")
    log = place.folder / "snakemake.log"
    command = place.command(
        "--workflow-profile", str(PROFILE), "--slurm-init-seconds-before-status-checks", "1",
        "--slurm-no-account", "--slurm-keep-successful-logs", "--latency-wait", "5",
        "campaign_paper",
        configuration=variant(tmp_path, shard_size=4),
    )  # fmt: skip
    environment = ENVIRONMENT | {"SLURM_CONF": str(cluster / "slurm.conf")}
    with log.open("w") as output:
        run = subprocess.Popen(command, cwd=place.folder, env=environment, stdout=output, stderr=output)
        try:
            while not (victims := running("simulate_shard")):
                assert run.poll() is None, log.read_text()[-3000:]
                time.sleep(0.1)
            subprocess.run(["scancel", victims[0]], check=True)
            assert run.wait(timeout=600) == 0, log.read_text()[-3000:]
        finally:
            run.kill()

    text = log.read_text()
    submitted = re.findall(r"Job \d+ has been submitted with SLURM jobid (\d+)", text)
    assert victims[0] in submitted
    assert len(submitted) >= 5 + 2 + 1  # the rules, two shards, one of them twice
    assert re.search(rf"SLURM-job '{victims[0]}' failed, SLURM status is: '?CANCELLED", text)
    ended = (cluster / "log" / "jobs.txt").read_text()
    assert re.search(rf"JobId={victims[0]} .*JobState=CANCELLED", ended)
    assert ended.count("JobState=COMPLETED") == len(submitted) - 1
    assert differences(*(folder / "campaigns" / "paper" for folder in (results, place.results))) == []
