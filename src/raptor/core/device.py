"""The device that computes: the processor, or a GPU if torch sees one."""

import shutil
from typing import Literal, get_args

from raptor.core.errors import RaptorError

Device = Literal["auto", "cpu", "cuda"]


def chosen_device(name: str, gpus: int = 1) -> str:
    """Resolve auto, cpu or cuda to cpu or cuda; imports torch only if there may be a GPU.

    `gpus` is the number that a job was given. With none, auto is the processor even on a machine with a GPU,
    so that parallel jobs do not compete for it and all use the same kind of device.

    Raises
    ------
    RaptorError
        If the name is unknown, or a GPU is requested and not found.
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
