"""What a data set of 200 simulations lives through: kills, a full disk, a truncated shard.

python -m tests.endurance FOLDER

Each trial runs the same command until it succeeds, and compares what it made with an undisturbed run. It
takes some ten minutes on two cores; the full disk wants root, for a tmpfs.
"""

import contextlib
import os
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from raptor.dataset.compare import differences
from raptor.dataset.shards import shard_paths
from tests.small import ROOT

CONFIGURATION = ROOT / "tests" / "workflow" / "config" / "endurance.yaml"
MOMENTS = 5


class Trial:
    """A folder, and the one command that is run in it again and again."""

    def __init__(self, folder: Path, cores: int = 2) -> None:
        self.folder, self.runs = folder, 0
        folder.mkdir(parents=True, exist_ok=True)
        with contextlib.suppress(FileExistsError):
            (folder / "config").symlink_to(ROOT / "config")
        self.command = [
            sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile"),
            "--directory", str(folder), "--configfile", str(CONFIGURATION), "--cores", str(cores),
            "campaigns",
        ]  # fmt: skip
        self.results = folder / "results" / "endurance" / "campaigns" / "paper"

    def start(self) -> subprocess.Popen[str]:
        self.runs += 1
        environment = os.environ | {"SNAKEMAKE_PROFILE": str(ROOT / "workflow" / "profiles" / "default")}
        with (self.folder.parent / f"{self.folder.name}.{self.runs}.log").open("w") as log:
            return subprocess.Popen(self.command, env=environment, stdout=log, stderr=log, text=True)

    def log(self) -> str:
        return (self.folder.parent / f"{self.folder.name}.{self.runs}.log").read_text()

    def finish(self) -> int:
        """Run to the end; returns the exit status."""
        return self.start().wait()

    def shards(self) -> list[Path]:
        return shard_paths(self.results)


def workers(folder: Path) -> list[int]:
    """Process ids of the simulations that run in a folder."""
    found = []
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError, ValueError):
            number = int(entry.name)
            command = (entry / "cmdline").read_bytes().decode()
            if "simulate_shard" in command and (entry / "cwd").resolve() == folder.resolve():
                found.append(number)
    return found


def kill_snakemake(trial: Trial, moment: random.Random) -> str:
    """SIGKILL of Snakemake at five moments; its jobs run on as orphans, and the command is given again."""
    at = []
    for _ in range(MOMENTS):
        run = trial.start()
        time.sleep(moment.uniform(6, 24))
        run.send_signal(signal.SIGKILL)
        run.wait()
        at.append(f"{len(trial.shards())} shards, {len(workers(trial.folder))} jobs running on")
    status = trial.finish()
    return f"killed at {'; '.join(at)}; then the same command: exit {status}"


def kill_workers(trial: Trial, moment: random.Random) -> str:
    """SIGKILL of a simulation at five moments of a run."""
    run, at = trial.start(), []
    while len(at) < MOMENTS and run.poll() is None:
        time.sleep(moment.uniform(1, 6))
        if running := workers(trial.folder):
            with contextlib.suppress(ProcessLookupError):
                os.kill(moment.choice(running), signal.SIGKILL)
                at.append(str(len(trial.shards())))
    status = run.wait()
    restarted = trial.log().count("Trying to restart job")
    text = f"killed a job at {', '.join(at)} shards; {restarted} restarted by Snakemake: exit {status}"
    if status:
        text += f"; the same command again: exit {trial.finish()}"
    return text


def fill_disk(trial: Trial, moment: random.Random) -> str:
    """A tmpfs too small for the data set, made larger once the run has stopped."""
    at = ["-t", "tmpfs", "-o", "size=2m", "tmpfs", str(trial.folder)]
    subprocess.run(["mount", *at], check=True)
    (trial.folder / "config").symlink_to(ROOT / "config")
    status = trial.finish()
    said = re.search(r"no room left on the disk[^;]*", trial.log())
    kept = len(trial.shards())
    subprocess.run(["mount", "-o", "remount,size=200m", str(trial.folder)], check=True)
    return (
        f"2 MB disk: exit {status}, {kept} shards kept, said '{said.group() if said else 'nothing clear'}'; "
        f"with room, the same command: exit {trial.finish()}"
    )


def truncate_shard(trial: Trial, moment: random.Random) -> str:
    """A shard cut short after it was made, when the field stack is to be made from it."""
    trial.finish()
    shard = moment.choice(trial.shards())
    os.truncate(shard, shard.stat().st_size // 2)
    (trial.results / "fields.nc").unlink()
    status = trial.finish()
    said = re.search(r"error: (.*)", trial.log())
    shard.unlink()
    return (
        f"{shard.name} cut to half: exit {status}, said '{said.group(1) if said else 'nothing clear'}'; "
        f"after it was moved away, the same command: exit {trial.finish()}"
    )


def main(folder: Path) -> int:
    """Run all trials; returns the number of those that did not end in the same data."""
    seed = random.SystemRandom().randrange(10**6) if len(sys.argv) < 3 else int(sys.argv[2])
    sys.stdout.write(f"moments of seed {seed}\n")
    moment = random.Random(seed)
    plain = Trial(folder / "undisturbed")
    started = time.monotonic()
    if plain.finish():
        sys.stderr.write(plain.log()[-2000:])
        return 1
    sys.stdout.write(f"undisturbed, 2 cores: {time.monotonic() - started:.0f} s\n")
    trials: dict[str, tuple[int, Callable[[Trial, random.Random], str]]] = {
        "one core": (1, lambda trial, moment: f"exit {trial.finish()}"),
        "Snakemake killed": (2, kill_snakemake),
        "workers killed": (2, kill_workers),
        "full disk": (2, fill_disk),
        "truncated shard": (2, truncate_shard),
    }
    lost = 0
    for name, (cores, disturb) in trials.items():
        trial = Trial(folder / name.replace(" ", "_"), cores)
        try:
            happened = disturb(trial, moment)
            found = differences(plain.results, trial.results)
        finally:
            if os.path.ismount(trial.folder):
                subprocess.run(["umount", "--lazy", str(trial.folder)], check=True)
        lost += bool(found)
        sys.stdout.write(
            f"{name}: {happened}. {'NOT the same data: ' + found[0] if found else 'The same data'}\n"
        )
        sys.stdout.flush()
    return lost


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit("usage: python -m tests.endurance FOLDER [SEED]")
    sys.exit(main(Path(sys.argv[1]).absolute()))
