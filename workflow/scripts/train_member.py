"""Train one network of a model on the data set's examples."""

from pathlib import Path

import pandas as pd

from raptor.config import content_hash
from raptor.core.device import chosen_device
from raptor.core.jobs import logged, progress
from raptor.dataset.examples import read_examples, with_further
from raptor.dataset.scaling import read_scaling
from raptor.dataset.stack import read_table
from raptor.surrogate.files import load, save
from raptor.surrogate.networks import architecture_of
from raptor.surrogate.training import describe, joined, rules_of, train, write_history

with logged(snakemake.log[0]):
    given, stack = snakemake.params.surrogate, Path(snakemake.input.stack)
    extra = [Path(snakemake.input.extra)] if snakemake.input.extra else []
    begun = Path(snakemake.input.begun).parent if snakemake.input.begun else None
    table, listed = read_table(stack), read_examples(Path(snakemake.input.examples))
    examples, splits = with_further(stack, listed, extra)
    scaling = read_scaling(Path(snakemake.input.normalisation))
    architecture = architecture_of(given, table.pixels)
    device = chosen_device(snakemake.config["device"], snakemake.resources.get("gpu", 0))
    rules = rules_of(given, snakemake.params.seed, snakemake.threads, device)
    # A checkpoint goes on only if configuration and data are those that it was made from.
    files = [Path(snakemake.input[name]).read_text() for name in ("examples", "normalisation")]
    files += [str(read_table(path).parameters) for path in extra]
    files += [(begun / "model.json").read_text()] if begun else []
    identity = content_hash([snakemake.params.identity, snakemake.params.seed, *files])
    with progress("training", rules.epochs) as advance:
        trained = train(
            [stack, *extra],
            examples,
            splits,
            scaling,
            architecture,
            rules,
            Path(snakemake.params.checkpoint),
            identity,
            lambda epoch, row: advance(f"epoch {epoch}, validation error {row['validation_error']:.3f}"),
            load(begun).members[0].state_dict() if begun else None,
        )
    save(
        Path(snakemake.output.weights).parent,
        [trained.weights],
        architecture,
        scaling,
        snakemake.params.layers,
        table.pixels,
        describe(architecture, rules, given["extra"], given["continues"]),
        identity,
    )
    earlier = pd.read_csv(begun / "training.csv") if begun else pd.DataFrame()
    write_history(Path(snakemake.output.history), joined(earlier, trained.history))
