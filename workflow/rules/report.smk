"""The report, written when a run ends: a rule cannot write the report of its own workflow."""

# Flags of --report-after-run would write it after dry runs too, and to one place for every
# configuration; this writes it where the configuration's results are, once all of them exist.
REPORTED = [RESULTS + "/configuration.yaml", *rules.all.input]


onsuccess:
    if all(Path(path).exists() for path in REPORTED):
        shell(
            "{sys.executable} -m snakemake --quiet --snakefile {workflow.main_snakefile}"
            " --configfile {REPORTED[0]} --report {RESULTS}/report.html"
            " && echo 'Report: {RESULTS}/report.html' >&2"
        )
