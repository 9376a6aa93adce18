"""Train one network of a model on the data set's examples."""

from pathlib import Path

import pandas as pd

from raptor.config import content_hash
from raptor.core.device import chosen_device
from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.dataset.examples import read_examples, with_further
from raptor.dataset.scaling import read_scaling
from raptor.dataset.stack import read_table
from raptor.surrogate.batches import split_examples
from raptor.surrogate.files import load, save
from raptor.surrogate.inference import Surrogate
from raptor.surrogate.rules import ModelRules
from raptor.surrogate.training import describe, joined, train

with logged(snakemake.log[0]):
    given, stack = dict(snakemake.params.surrogate), Path(snakemake.input.stack)
    extra = [Path(snakemake.input.extra)] if snakemake.input.extra else []
    begun = Path(snakemake.input.begun).parent if snakemake.input.begun else None
    campaigns = [given["extra"]] if extra else []
    rules = ModelRules.model_validate({name: given[name] for name in ModelRules.model_fields})
    table, listed = read_table(stack), read_examples(Path(snakemake.input.examples))
    scaling = read_scaling(Path(snakemake.input.normalisation))
    architecture = rules.architecture(table.pixels)
    # A checkpoint goes on only if configuration and data are those that it was made from.
    files = [Path(snakemake.input[name]).read_text() for name in ("examples", "normalisation")]
    files += [str(read_table(path).parameters) for path in extra]
    files += [(begun / "model.json").read_text()] if begun else []
    identity = content_hash([snakemake.params.identity, snakemake.params.seed, *files])
    stacks, (examples, splits) = [stack, *extra], with_further(stack, listed, extra)
    with progress("training", rules.epochs) as advance:
        trained = train(
            *split_examples(stacks, examples, splits, scaling, architecture.pixels),
            architecture,
            rules,
            seed=snakemake.params.seed,
            checkpoint=Path(snakemake.params.checkpoint),
            identity=identity,
            device=chosen_device(snakemake.config["device"], snakemake.resources.get("gpu", 0)),
            initial_weights=load(begun).members[0].state_dict() if begun else None,
            on_progress=lambda epoch, row: advance(
                f"epoch {epoch}, validation error {row['validation_error']:.3f}"
            ),
        )
    save(
        Path(snakemake.output.weights).parent,
        Surrogate((trained.generator,), architecture, scaling, snakemake.params.layers, table.pixels),
        describe(rules.training(), snakemake.params.seed, campaigns, rules.initial_weights),
        identity,
    )
    earlier = pd.read_csv(begun / "training.csv") if begun else pd.DataFrame()
    with atomic_path(Path(snakemake.output.history)) as path:
        joined(earlier, trained.history).to_csv(path, index=False)
