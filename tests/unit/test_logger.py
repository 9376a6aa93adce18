"""The log of a workflow: one line a job, errors in full."""

from logging import makeLogRecord

from snakemake_interface_logger_plugins.common import LogEvent

from snakemake_logger_plugin_raptor import BriefFormatter


def lines(formatter, event, msg="", **about):
    return formatter.format(makeLogRecord({"event": event, "msg": msg, **about})).splitlines()


def test_a_job_is_one_line_and_an_error_is_whole():
    brief, printed = BriefFormatter(), []
    for number in range(10):
        job = {"rule_name": "simulate_shard", "wildcards": {"shard": f"{number}"}, "jobid": number}
        printed += lines(brief, None, "Select jobs to execute...")
        printed += lines(brief, LogEvent.JOB_INFO, **job)
        printed += lines(brief, LogEvent.JOB_STARTED, "Execute 1 jobs...")
        printed += lines(brief, LogEvent.JOB_FINISHED, f"Finished jobid: {number}", job_id=number)
        printed += lines(brief, LogEvent.PROGRESS, done=number + 1, total=10)
    assert len(printed) == 10
    assert printed[3].endswith("4 of 10: simulate_shard shard=3")
    failed = {
        "rule_name": "simulate_shard", "rule_msg": None, "jobid": 3, "input": [], "output": ["3.nc"],
        "log": ["3.log"], "conda_env": None, "shellcmd": None, "aux": {},
    }  # fmt: skip
    assert "    log: 3.log (check log file(s) for error details)" in lines(
        brief, LogEvent.JOB_ERROR, **failed
    )
    assert lines(brief, None, "MissingInputException: no moulds") == ["MissingInputException: no moulds"]
