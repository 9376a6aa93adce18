"""One line a job in the log of a workflow, and errors in full: the logger `raptor` of the default profile.

`snakemake --logger` finds a module by this name. A dry run, and a run with `--verbose`, is printed as
Snakemake prints it.
"""

import sys
from datetime import datetime
from logging import LogRecord
from typing import Any

from snakemake.logging import (  # type: ignore[import-untyped]
    ColorizingTextHandler,
    DefaultFilter,
    DefaultFormatter,
    format_wildcards,
)
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

SILENT = (LogEvent.WORKFLOW_STARTED, LogEvent.JOB_STARTED, LogEvent.RESOURCES_INFO)
CHATTER = ("Building DAG", "Select jobs", "Assuming unrestricted", "Using ", "host:")
"""First words of messages about what Snakemake does itself."""


class BriefFormatter(DefaultFormatter):  # type: ignore[misc]
    """A line when a job ends; Snakemake's own words for errors and for the rest."""

    def __init__(self, *settings: Any) -> None:
        super().__init__(*settings)
        self.jobs: dict[int, str] = {}
        self.finished: list[str] = []

    def format(self, record: LogRecord) -> str:
        """The text of a record; empty for one that is left out."""
        event, about = getattr(record, "event", None), record.__dict__
        if event is LogEvent.JOB_INFO:
            wildcards = format_wildcards(about["wildcards"])
            self.jobs[about["jobid"]] = f"{about['rule_name']} {wildcards}".rstrip()
            return ""
        if event is LogEvent.JOB_FINISHED:
            self.finished.append(self.jobs.pop(about["job_id"], "a group"))
            return ""
        if event is LogEvent.PROGRESS:
            jobs, self.finished = "; ".join(self.finished), []
            return f"[{datetime.now():%H:%M:%S}] {about['done']} of {about['total']}: {jobs}"
        if event in SILENT or (event is None and str(record.msg or "").startswith(CHATTER)):
            return ""
        return str(super().format(record))


class LogHandler(LogHandlerBase):
    """Writes to standard error, in colour on a terminal."""

    def __post_init__(self) -> None:
        """Take the settings of the command line."""
        common = self.common_settings
        formatter = DefaultFormatter if common.dryrun or common.verbose else BriefFormatter
        self.inner = ColorizingTextHandler(
            nocolor=common.nocolor,
            stream=sys.stdout if common.stdout else sys.stderr,
            formatter=formatter(common.quiet, common.show_failed_logs),
            filter=DefaultFilter(
                common.quiet, common.debug_dag, common.verbose, common.dryrun, common.printshellcmds
            ),
        )

    def emit(self, record: LogRecord) -> None:
        """Write a record."""
        if not self.inner.filter(record):
            return
        if getattr(record, "event", None) is LogEvent.JOB_INFO and not self.common_settings.dryrun:
            self.inner.format(record)  # noted; `emit` would write an empty line
        else:
            self.inner.emit(record)

    writes_to_stream = True
    writes_to_file = False
    has_filter = True
    has_formatter = True
    needs_rulegraph = False
