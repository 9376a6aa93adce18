"""Draw the design."""

from pathlib import Path

import pandas as pd

from raptor.core.files import atomic_path
from raptor.core.jobs import logged
from raptor.moulds import read_moulds
from raptor.plotting import design_figure, save

with logged(snakemake.log[0]):
    design = pd.read_csv(snakemake.input.design)
    moulds = read_moulds(Path(snakemake.input.moulds))
    design["area"] = [mould.depression.area for mould in moulds]
    design["symmetry"] = [mould.symmetry for mould in moulds]
    design["tethers"] = [len(mould.tethers) for mould in moulds]
    save(design_figure(design, moulds), Path(snakemake.output.png).with_suffix(""))
    with atomic_path(Path(snakemake.output.data)) as path:
        design.to_csv(path, index=False)
