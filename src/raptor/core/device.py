"""Where work is done: on the processor, or on a GPU where torch sees one."""

import shutil
from typing import Literal, get_args

from raptor.core.errors import RaptorError

Device = Literal["auto", "cpu", "cuda"]


def chosen_device(name: str, gpus: int = 1) -> str:
    """Turn auto, cpu or cuda into cpu or cuda; torch is imported only where there may be a GPU.

    `gpus` is how many a job was given: with none, auto is the processor, whatever the machine has, so that
    jobs side by side do not all take the same GPU, or some of them one and others none.

    Raises
    ------
    RaptorError
        Where there is no such device, or a GPU is asked for and not seen.
    """
    if name not in get_args(Device):
        raise RaptorError(f"device is '{name}'; allowed are {', '.join(get_args(Device))}")
    if name == "cpu" or (name == "auto" and (gpus == 0 or shutil.which("nvidia-smi") is None)):
        return "cpu"
    import torch

    if torch.cuda.is_available():
        return "cuda"
    if name == "auto":
        return "cpu"
    raise RaptorError(
        f"device is cuda, but torch {torch.__version__} sees no GPU; choose device: auto or cpu, or make the "
        "environment with RAPTOR_TORCH=cuda"
    )
