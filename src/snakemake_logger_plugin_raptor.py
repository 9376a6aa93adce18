"""One line a job in the log of a workflow, and errors in full: the logger `raptor` of the default profile.

`snakemake --logger` finds a module by this name. A dry run is printed as Snakemake prints it.
"""

import sys
from datetime import datetime
from logging import LogRecord

from snakemake.logging import ColorizingTextHandler, DefaultFilter, DefaultFormatter, format_wildcards
from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

SILENT = (LogEvent.WORKFLOW_STARTED, LogEvent.JOB_INFO, LogEvent.RESOURCES_INFO, LogEvent.PROGRESS)
CHATTER = ("Building DAG", "Select jobs", "Execute ", "Assuming unrestricted", "Using shell", "host:")
"""First words of messages about what Snakemake does itself."""


class BriefFormatter(DefaultFormatter):
    """A line when a job ends; Snakemake's own words for errors and for the rest."""

    jobs: dict[int, str]
    done = total = 0

    def format(self, record: LogRecord) -> str:
        """The text of a record; empty for one that is left out."""
        event = getattr(record, "event", None)
        self.jobs = getattr(self, "jobs", {})
        if event is LogEvent.JOB_INFO:
            wildcards = format_wildcards(record.wildcards)
            self.jobs[record.jobid] = f"{record.rule_name} {wildcards}".rstrip()
        if event is LogEvent.RUN_INFO:
            self.total = sum(record.per_rule_job_counts.values())
            return f"{self.total} jobs to do"
        if event is LogEvent.JOB_FINISHED:
            self.done += 1
            job = self.jobs.pop(record.job_id, "job")
            return f"[{datetime.now():%H:%M:%S}] {self.done} of {self.total or '?'}: {job}"
        if event in SILENT or (event is None and str(record.msg or "").startswith(CHATTER)):
            return ""
        return super().format(record)


class LogHandler(LogHandlerBase):
    """Writes to standard error, in colour on a terminal."""

    def __post_init__(self) -> None:
        """Take the settings of the command line."""
        common = self.common_settings
        formatter = DefaultFormatter if common.dryrun else BriefFormatter
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
        if self.inner.filter(record):
            self.inner.emit(record)

    writes_to_stream = True
    writes_to_file = False
    has_filter = True
    has_formatter = True
    needs_rulegraph = False
