"""Progress of campaigns: done, failed, rate, time left."""

import time
from dataclasses import dataclass
from pathlib import Path

from raptor.dataset.design import read_design
from raptor.dataset.netcdf import open_file
from raptor.dataset.shards import campaign_folders, read_failures, shard_paths

WINDOW = 1800.0  # s over which the rate is averaged


@dataclass(frozen=True)
class Progress:
    """Counts of simulations, and simulations per second over the last half hour."""

    designed: int
    done: int
    failed: int
    rate: float

    @property
    def seconds_left(self) -> float:
        """Time until all are done at this rate; infinite if nothing was done lately."""
        left = self.designed - self.done - self.failed
        if left == 0:
            return 0.0
        return left / self.rate if self.rate > 0 else float("inf")

    def __str__(self) -> str:
        text = f"{self.done} of {self.designed} simulations done, {self.failed} failed"
        if self.rate > 0 and self.seconds_left > 0:
            left = self.seconds_left / 3600
            text += f", {60 * self.rate:.1f} a minute, {left:.1f} h left"
        return text


def progress_of(folder: Path) -> Progress:
    """Progress of a results folder or a campaign's folder, finished or not.

    Raises
    ------
    RaptorError
        If it has no design, or a shard cannot be read.
    """
    campaigns = campaign_folders(folder).values()
    designed = sum(len(read_design(path / "design.csv")) for path in campaigns)
    now, done, failed, lately, since = time.time(), 0, 0, 0, 0.0
    for path in (shard for campaign in campaigns for shard in shard_paths(campaign)):
        with open_file(path) as file:
            made, took = file.dimensions["simulation"].size, float(file["wall_time"][:].sum())
        done += made
        failed += len(read_failures(path))
        age = now - path.stat().st_mtime
        if age < WINDOW:
            lately += made
            since = max(since, age + took)
    return Progress(designed, done, failed, lately / since if since else 0.0)
