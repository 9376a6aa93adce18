"""raptor simulate | predict | measure | check | trace | same | progress | well | reference."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer
import yaml

from raptor.errors import RaptorError

app = typer.Typer(
    help="Rapid prediction of tissue organisation: CONDOR simulations and their surrogate.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

Mould = Annotated[Path, typer.Argument(help="mould file (GeoJSON, one feature; lengths in l0)")]
Delta = Annotated[float, typer.Option(help="cell-matrix interaction")]
KappaNNN = Annotated[float, typer.Option("--kappa-nnn", help="second spring constant, in kappa0")]
KappaNNNN = Annotated[float, typer.Option("--kappa-nnnn", help="third spring constant, in kappa0")]
Output = Annotated[Path, typer.Option(help="netCDF file to write")]


@app.command()
def simulate(
    mould: Mould,
    delta: Delta,
    kappa_nnn: KappaNNN,
    kappa_nnnn: KappaNNNN,
    output: Output,
    layers: Annotated[int, typer.Option(help="cell layers between floor and fill height")] = 7,
    accuracy: Annotated[str, typer.Option(help="draft, standard, reference or anneal-SWEEPS")] = "standard",
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="of every random number")] = 0,
) -> None:
    """Simulate one mould and write a file of the form of a shard.

    Example: raptor simulate config/moulds/four_post_rectangle.geojson --delta 0.5
    --kappa-nnn 0.5 --kappa-nnnn 0.3 --output tissue.nc
    """
    from raptor.condor import accuracy_named
    from raptor.condor import simulate as run_simulation
    from raptor.configuration import content_hash
    from raptor.dataset.design import Run
    from raptor.dataset.shards import write_shard
    from raptor.moulds import read_mould
    from raptor.parameters import CellParameters, NetworkModel

    parameters = CellParameters(delta, kappa_nnn, kappa_nnnn)
    model = NetworkModel(layers)
    accuracy_named(accuracy)
    shape = read_mould(mould)
    _require_writable(output)
    tissue = run_simulation(shape, parameters, model, accuracy, seed)
    run = Run(0, shape.name, "test", False, parameters, seed)
    identity = content_hash([shape.as_feature(), delta, kappa_nnn, kappa_nnnn, layers, accuracy, seed])
    write_shard(output, [run], {0: tissue}, model, accuracy, identity)
    state = "converged" if tissue.converged else "NOT converged"
    typer.echo(
        f"{output}: {tissue.cells} cells, energy {tissue.energy:.4g} kappa0 l0^2, {state}, "
        f"folded {tissue.folded_fraction:.1e}, {tissue.wall_time:.1f} s"
    )


@app.command()
def predict(
    mould: Mould,
    delta: Delta,
    kappa_nnn: KappaNNN,
    kappa_nnnn: KappaNNNN,
    output: Output,
    model: Annotated[Path, typer.Option(help="folder with weights.safetensors and model.json")],
) -> None:
    """Predict the eight fields of a mould by a trained surrogate.

    Example: raptor predict config/moulds/four_post_rectangle.geojson --delta 0.5
    --kappa-nnn 0.5 --kappa-nnnn 0.3 --model results/laptop/surrogate/pix2pix --output tissue.nc
    """
    from raptor.condor import cast_sites
    from raptor.moulds import read_mould
    from raptor.parameters import CellParameters
    from raptor.surrogate.inference import load, write_prediction

    parameters = CellParameters(delta, kappa_nnn, kappa_nnnn).require_sampled("prediction")
    shape = read_mould(mould)
    _require_writable(output)
    cast_sites(shape, 1)  # a mould without a cell has no tissue to predict
    surrogate = load(model)
    area, width = write_prediction(output, surrogate, shape, parameters)
    typer.echo(f"{output}: A/A0 {area:.3f}, w/w0 {width:.3f} ({surrogate.layers} layers)")


@app.command()
def progress(
    folder: Annotated[Path, typer.Argument(help="results folder, for instance results/paper")],
) -> None:
    """Tell how many of a data set's simulations are done, at what rate, and the time left."""
    from raptor.dataset.progress import progress_of

    typer.echo(f"{folder}: {progress_of(folder)}")


@app.command()
def well(
    stack: Annotated[Path, typer.Argument(help="dataset/fields.nc of a results folder")],
    folder: Annotated[Path, typer.Argument(help="where data/train, data/valid and data/test are put")],
) -> None:
    """Write a field stack in the HDF5 layout of The Well, one file a split."""
    from raptor.dataset.well import write_well

    for path in write_well(stack, folder):
        typer.echo(path)


@app.command()
def check(
    path: Annotated[Path, typer.Argument(help="results folder, shard or field stack")],
    part: Annotated[
        float,
        typer.Option(min=0, max=1, help="of a folder's simulations, chosen at random, to compute again"),
    ] = 1.0,
) -> None:
    """Hold a data set, a shard or a field stack against its rules; name every fault."""
    from raptor.dataset.checks import check as find_faults

    if not path.exists():
        raise RaptorError(f"{path} does not exist; check the path")
    faults = find_faults(path, part)
    for fault in faults:
        typer.echo(fault)
    typer.echo(f"{path}: {len(faults)} faults" if faults else f"{path}: no faults")
    raise typer.Exit(1 if faults else 0)


@app.command()
def trace(
    folder: Annotated[Path, typer.Argument(help="results folder")],
    simulation: Annotated[int | None, typer.Option(help="simulation id")] = None,
    example: Annotated[int | None, typer.Option(help="row of dataset/examples.csv, from 0")] = None,
) -> None:
    """Tell where a sample comes from: mould, parameters, seed, solver, package and model version."""
    from raptor.dataset.provenance import trace_example, trace_simulation

    if (simulation is None) == (example is None):
        raise RaptorError("give one of --simulation and --example")
    if simulation is not None:
        found = trace_simulation(folder, simulation)
    else:
        assert example is not None
        found = trace_example(folder, example)
    typer.echo(yaml.safe_dump(found, sort_keys=False).rstrip())


@app.command()
def same(
    first: Annotated[Path, typer.Argument(help="results folder")],
    second: Annotated[Path, typer.Argument(help="another one")],
) -> None:
    """Say whether two results folders hold the same data: bit-equal but for times."""
    from raptor.dataset.same import differences

    for folder in (first, second):
        if not (folder / "dataset" / "fields.nc").is_file():
            raise RaptorError(f"{folder} holds no dataset/fields.nc; give a results folder")
    found = differences(first, second)
    for difference in found:
        typer.echo(difference)
    typer.echo("not the same data" if found else "the same data")
    raise typer.Exit(1 if found else 0)


@app.command()
def reference(
    root: Annotated[Path, typer.Argument(help="the project's folder")] = Path(),
) -> None:
    """Write what is generated from the configuration model: JSON schema and key table."""
    from raptor.reference import write_reference

    for path in write_reference(root):
        typer.echo(path)


@app.command(name="measure")
def measure_tissue(
    image: Annotated[Path, typer.Argument(help="photograph, or mask of two values (PNG, TIFF, JPEG)")],
    mould: Annotated[Path, typer.Option(help="mould file (GeoJSON, one feature; lengths in l0)")],
    tissue: Annotated[str, typer.Option(help="bright, dark or auto: how it looks beside the floor")] = "auto",
    threshold: Annotated[
        float | None, typer.Option(help="brightness that parts tissue and floor, over the plate's; Otsu's")
    ] = None,
    landmark: Annotated[
        list[str] | None, typer.Option(help='"column,row=x,y" or "column,row=tether 1"; twice or more')
    ] = None,
    aligned: Annotated[
        bool, typer.Option("--aligned", help="the image is the mould's, 62.5 l0 wide")
    ] = False,
    mirrored: Annotated[bool, typer.Option("--mirrored", help="taken from below or in a mirror")] = False,
    overlay: Annotated[Path | None, typer.Option(help="PNG to write, to check by eye")] = None,
    outline: Annotated[Path | None, typer.Option(help="GeoJSON of the tissue's outline to write, l0")] = None,
    as_record: Annotated[bool, typer.Option("--json", help="print the result as JSON")] = False,
) -> None:
    """Measure A/A0, w/w0 and the outline of a tissue in a photograph or mask.

    Example: raptor measure photograph.png --mould config/moulds/four_post_rectangle.geojson
    --overlay overlay.png --outline tissue.geojson
    """
    from raptor.files import atomic_path
    from raptor.measuring import measure, read_picture, register, tissue_named
    from raptor.measuring.report import as_feature, as_json, as_sentence
    from raptor.moulds import read_mould

    look, shape = tissue_named(tissue), read_mould(mould)
    for output in filter(None, (overlay, outline)):
        _require_writable(output)
    picture = read_picture(image)
    registration = register(picture, shape, landmark or (), aligned, mirrored)
    measured = measure(picture, shape, registration, look, threshold)
    if overlay is not None:
        from raptor.measuring.overlay import write_overlay

        write_overlay(overlay, picture, shape, measured)
    if outline is not None:
        with atomic_path(outline) as temporary:
            feature = as_feature(measured, picture, shape)
            temporary.write_text(json.dumps(feature) + "\n", encoding="utf-8")
    if as_record:
        typer.echo(json.dumps(as_json(measured, picture, shape)))
    else:
        typer.echo(f"{image}: {as_sentence(measured, picture)}")


def _require_writable(output: Path) -> None:
    """Find out before the work, not after it, that the result cannot be written."""
    if output.is_dir():
        raise RaptorError(f"{output} is a folder; give the name of a file")
    folder = output.parent
    if not folder.is_dir():
        raise RaptorError(f"folder {folder} does not exist; create it or choose another output")


def main() -> None:
    """Run the command line; bad input ends in one sentence and exit status 1."""
    try:
        app()
    except RaptorError as error:
        sys.stderr.write(f"error: {error}\n")
        raise SystemExit(1) from None
