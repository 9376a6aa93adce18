"""RAPTOR: from random moulds to a trained surrogate, fitted tissues and every figure."""

from snakemake.utils import min_version

min_version("9.27")

if not config:

    configfile: f"{workflow.basedir}/config/laptop.yaml"


report: "workflow/report/workflow.rst"


include: "workflow/rules/common.smk"
include: "workflow/rules/campaign.smk"
include: "workflow/rules/surrogate.smk"
include: "workflow/rules/studies.smk"
include: "workflow/rules/fit.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/report.smk"
include: "workflow/rules/publish.smk"


localrules:
    all,
    campaigns,
    train,
    evaluate,
    studies,
    tradeoff,
    fit,
    figures,


# Everything. (A comment: snakefmt puts default_target first, and takes no docstring after it.)
rule all:
    default_target: True
    input:
        rules.report.output,
        rules.write_report.output,  # named, or it would not be made again when lost
