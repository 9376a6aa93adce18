"""The run's data and weights, ready for an archive."""

PUBLISHED = f"{RESULTS}/publish"


rule publish:
    """Make a folder for an archive: data, weights, cards, The Well's layout, metadata, checksums."""
    input:
        rules.campaigns.input,
        # `shipped/` and how it was trained.
        model=[*rules.ship_model.output, *OWN["history"]] if MODELS else [],
    output:
        manifest=f"{PUBLISHED}/SHA256SUMS",
    log:
        f"{RESULTS}/logs/publish.log",
    benchmark:
        f"{RESULTS}/benchmarks/publish.tsv"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        campaigns=list(CAMPAIGNS),
        code=workflow.basedir,
    script:
        "../scripts/publish.py"
