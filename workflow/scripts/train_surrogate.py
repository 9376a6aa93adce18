"""Train the surrogate on the data set's examples."""

from pathlib import Path

from raptor.configuration import content_hash
from raptor.dataset.examples import read_examples
from raptor.dataset.scaling import read_scaling
from raptor.dataset.stack import read_table
from raptor.device import chosen_device
from raptor.jobs import logged, progress
from raptor.surrogate.inference import save
from raptor.surrogate.networks import Architecture
from raptor.surrogate.training import TrainingRules, describe, train, write_history

with logged(snakemake.log[0]):
    given, stack = snakemake.params.surrogate, Path(snakemake.input.stack)
    table = read_table(stack)
    scaling = read_scaling(Path(snakemake.input.normalisation))
    sizes = {name: given[name] for name in ("base_channels", "dropout", "patch_layers", "network")}
    architecture = Architecture(given["pixels"] or table.pixels, **sizes)
    names = ("epochs", "batch_size", "learning_rate", "beta1", "lambda_l1", "workers")
    names += ("precision", "compiled", "deterministic", "adversarial")
    rules = TrainingRules(
        **{name: given[name] for name in names},
        seed=snakemake.params.seed % 2**63,
        threads=snakemake.threads,
        device=chosen_device(snakemake.config["device"]),
    )
    # A checkpoint goes on only if configuration and data are those that it was made from.
    files = [Path(snakemake.input[name]).read_text() for name in ("examples", "normalisation")]
    identity = content_hash([snakemake.params.identity, *files])
    with progress("training", rules.epochs) as done:
        trained = train(
            stack,
            read_examples(Path(snakemake.input.examples)),
            table.split,
            scaling,
            architecture,
            rules,
            Path(snakemake.params.checkpoint),
            identity,
            lambda epoch, row: done(f"epoch {epoch}, validation error {row['validation_error']:.3f}"),
        )
    save(
        Path(snakemake.output.weights).parent,
        trained.weights,
        architecture,
        scaling,
        snakemake.params.layers,
        table.pixels,
        describe(architecture, rules),
        identity,
    )
    write_history(Path(snakemake.output.history), trained.history)
