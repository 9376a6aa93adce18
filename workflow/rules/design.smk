"""Which moulds and parameters are simulated."""


rule sample_design:
    """Draw a mould and parameters for every simulation, and the splits."""
    output:
        design=report(
            f"{RESULTS}/design/design.csv",
            caption="../report/design_table.rst",
            category="Data set",
        ),
        moulds=f"{RESULTS}/design/moulds.geojson",
    log:
        f"{RESULTS}/logs/sample_design.log",
    benchmark:
        f"{RESULTS}/benchmarks/sample_design.tsv"
    threads: 1
    resources:
        mem_mb=500,
    params:
        configuration=CONFIG.fingerprint("design"),
        dump=CONFIG.dump_drawn(),
    script:
        "../scripts/sample_design.py"
