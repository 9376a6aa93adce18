"""The report, and Snakemake's own, written at the end, since no rule can write its own workflow's report."""

# Snakemake's --report-after-run would write it after dry runs too, and to one place for every
# configuration. Here a stamp is the last thing that a run makes; that report follows it, and a
# stamp without both reports is dropped, so that a lost one is written again.
REPORT = Path(RESULTS) / "report.html"
TECHNICAL = Path(RESULTS) / "workflow.html"
STAMP = Path(RESULTS) / "report.stamp"
if STAMP.exists() and "--report" not in sys.argv:
    if not (REPORT.exists() and TECHNICAL.exists()):
        STAMP.unlink()


localrules:
    report,


rule write_report:
    """Write the report: one file with every figure and number."""
    input:
        rules.record_configuration.output,
        rules.campaigns.input,
        rules.train.input,
        rules.evaluate.input,
        rules.studies.input,
        rules.tradeoff.input,
        rules.fit.input,
        rules.figures.input,
        template=f"{workflow.basedir}/workflow/report/report.html.jinja",
    output:
        report=str(REPORT),
    log:
        f"{RESULTS}/logs/write_report.log",
    benchmark:
        f"{RESULTS}/benchmarks/write_report.tsv"
    threads: 1
    resources:
        mem_mb=800,
    params:
        model_version=MODEL_VERSION,
    script:
        "../scripts/write_report.py"


rule report:
    """Both reports and all that they show."""
    input:
        rules.write_report.input,
        rules.write_report.output,
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
        not TECHNICAL.exists() or TECHNICAL.stat().st_mtime < STAMP.stat().st_mtime
    ):
        shell(
            "{sys.executable} -m snakemake --quiet --snakefile {workflow.main_snakefile:q}"
            " --configfile {RESULTS}/configuration.yaml --report {RESULTS}/workflow.part.html"
            " && mv {RESULTS}/workflow.part.html {TECHNICAL}"
            " && echo 'Report: {REPORT}' >&2"
        )
