"""RAPTOR: from random moulds to a trained surrogate, fitted tissues and every figure."""

from snakemake.utils import min_version

min_version("9.27")

if "name" not in config:

    configfile: "config/laptop.yaml"


report: "workflow/report/workflow.rst"


include: "workflow/rules/common.smk"
include: "workflow/rules/design.smk"
include: "workflow/rules/simulate.smk"
include: "workflow/rules/dataset.smk"
include: "workflow/rules/surrogate.smk"
include: "workflow/rules/evaluate.smk"
include: "workflow/rules/fit.smk"
include: "workflow/rules/tradeoff.smk"
include: "workflow/rules/figures.smk"


localrules:
    all,
    dataset,
    train,
    evaluate,
    fit,
    tradeoff,
    figures,
    report,


# Everything: data set, surrogate, evaluation, fits, trade-off, figures. (A comment: snakefmt puts
# default_target first, and takes no docstring after it.)
rule all:
    default_target: True
    input:
        rules.dataset.input,
        rules.train.input,
        rules.evaluate.input,
        rules.fit.input,
        rules.tradeoff.input,
        rules.figures.input,


rule report:
    """What the report shows; the report itself is written when the run ends."""
    input:
        rules.all.input,


include: "workflow/rules/report.smk"
