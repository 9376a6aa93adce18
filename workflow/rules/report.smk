"""The report, written when a run ends: a rule cannot write the report of its own workflow."""

# Snakemake's --report-after-run would write it after dry runs too, and to one place for every
# configuration. Here a stamp is the last thing that a run makes; the report follows it, and a
# stamp without its report is dropped, so that a lost report is written again.
REPORT = Path(RESULTS) / "report.html"
STAMP = Path(RESULTS) / "report.stamp"
if STAMP.exists() and not REPORT.exists() and "--report" not in sys.argv:
    STAMP.unlink()


localrules:
    report,


rule report:
    """The report, and all that it shows."""
    input:
        rules.record_configuration.output,
        rules.dataset.input,
        rules.train.input,
        rules.evaluate.input,
        rules.fit.input,
        rules.tradeoff.input,
        rules.figures.input,
    output:
        stamp=touch(str(STAMP)),
    log:
        f"{RESULTS}/logs/report.log",
    benchmark:
        f"{RESULTS}/benchmarks/report.tsv"
    threads: 1
    resources:
        mem_mb=200,


onsuccess:
    if STAMP.exists() and (
        not REPORT.exists() or REPORT.stat().st_mtime < STAMP.stat().st_mtime
    ):
        shell(
            "{sys.executable} -m snakemake --quiet --snakefile {workflow.main_snakefile}"
            " --configfile {RESULTS}/configuration.yaml --report {RESULTS}/report.part.html"
            " && mv {RESULTS}/report.part.html {REPORT} && echo 'Report: {REPORT}' >&2"
        )
