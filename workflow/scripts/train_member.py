"""Train one network of a model on the examples of its campaigns."""

from pathlib import Path

import pandas as pd

from raptor.core.blocks import content_hash
from raptor.core.device import chosen_device
from raptor.core.files import atomic_path
from raptor.core.jobs import logged, progress
from raptor.dataset.examples import join_examples, read_examples, training_rows
from raptor.dataset.scaling import read_scaling
from raptor.dataset.stack import read_table
from raptor.moulds import moulds_by_id
from raptor.surrogate.batches import split_examples
from raptor.surrogate.files import load, save
from raptor.surrogate.inference import Surrogate
from raptor.surrogate.rules import ModelRules
from raptor.surrogate.training import describe, joined, train

with logged(snakemake.log[0]):
    given, params = dict(snakemake.params.model), snakemake.params
    campaigns, fraction = given.pop("campaigns"), given.pop("training_fraction")
    rules = ModelRules.model_validate(given)
    stacks, files = ([Path(path) for path in snakemake.input[name]] for name in ("stacks", "examples"))
    begun = Path(snakemake.input.initial[0]).parent if snakemake.input.initial else None
    pixels, scaling = read_table(stacks[0]).pixels, read_scaling(Path(snakemake.input.normalisation))
    architecture = rules.architecture(pixels)
    # A checkpoint is used only if configuration and data are those of its training.
    data = [path.read_text(encoding="utf-8") for path in (*files, Path(snakemake.input.normalisation))]
    data += [str(read_table(stack).parameters) for stack in stacks]
    data += [(begun / "model.json").read_text(encoding="utf-8")] if begun else []
    identity = content_hash([params.identity, params.seed, *data])
    runs = {name: len(training_rows(stack, fraction)) for name, stack in zip(campaigns, stacks, strict=True)}
    listed = [read_examples(path) for path in files]
    moulds = dict(item for path in snakemake.input.moulds for item in moulds_by_id(Path(path)).items())
    examples, splits = join_examples(stacks, listed, fraction, every_image=rules.noise > 0)
    with progress("training", rules.epochs) as advance:
        trained = train(
            *split_examples(stacks, examples, splits, moulds, scaling, architecture.pixels),
            architecture,
            rules,
            seed=params.seed,
            checkpoint=Path(params.checkpoint),
            identity=identity,
            device=chosen_device("auto", snakemake.resources.get("gpu", 0)),
            initial_weights=load(begun).members[0].state_dict() if begun else None,
            on_progress=lambda epoch, row: advance(
                f"epoch {epoch}, validation error {row['validation_error']:.3f}"
            ),
        )
    save(
        Path(snakemake.output.weights).parent,
        Surrogate((trained.generator,), architecture, scaling, params.layers, pixels),
        describe(rules.training(), params.seed, runs, fraction, rules.initial_weights),
        identity,
    )
    earlier = pd.read_csv(begun / "training.csv") if begun else pd.DataFrame()
    with atomic_path(Path(snakemake.output.history)) as path:
        joined(earlier, trained.history).to_csv(path, index=False)
