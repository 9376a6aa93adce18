"""One step of training: a generator, its discriminator if it has one, and their optimisers."""

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor, nn

from raptor.dataset.scaling import Scaling
from raptor.surrogate.generator import Generator, delta_of
from raptor.surrogate.losses import (
    adversarial_loss,
    balanced,
    discriminator_loss,
    reconstruction_loss,
    sample_loss,
)
from raptor.surrogate.networks import Discriminator
from raptor.surrogate.recording import Recorded
from raptor.surrogate.rules import Architecture, TrainingRules

SAMPLES = 2
"""Samples that a network with noise draws for every example in a step."""

RECONSTRUCTION_WEIGHT = 1000.0
"""Of the loss of a generator without a discriminator, whose scaled fields differ by some thousandths."""

BETA1 = {"pix2pix": 0.5, "pix2pix_film": 0.5}
"""Adam's first decay rate, as Isola et al. chose it (arXiv:1611.07004); of other networks 0.9."""

LOSSES = ("generator_loss", "reconstruction_loss", "discriminator_loss")


class Learner:
    """Networks in training.

    Parameters
    ----------
    seed : int
        Of the first weights.

    Attributes
    ----------
    keeps_moments : bool
        Whether batch normalisation uses the moments that it has, as in prediction, instead of each batch's.
    """

    def __init__(
        self,
        architecture: Architecture,
        scaling: Scaling,
        rules: TrainingRules,
        seed: int,
        device: torch.device,
    ) -> None:
        torch.manual_seed(seed)
        self.rules, self.scaling, self.device = rules, scaling, device
        self.generator = Generator(architecture, scaling)
        self.keeps_moments = False
        networks: dict[str, nn.Module] = {"generator": self.generator}
        if rules.lambda_l1 is not None:
            networks["discriminator"] = Discriminator(architecture.pixels, architecture.base_channels)
        for network in networks.values():
            # Convolutions are faster with channels last: tensor cores need it, a processor gains an eighth.
            network.to(device=device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.networks = networks
        beta1 = BETA1.get(architecture.network, 0.9)
        self.optimisers = {
            name: torch.optim.Adam(
                network.parameters(),
                torch.tensor(rules.learning_rate, device=device),  # which a recorded step reads anew
                (beta1, 0.999),
                fused=all(map(torch.is_floating_point, network.parameters())) or None,  # fno's are complex
                capturable=device.type == "cuda",
            )
            for name, network in networks.items()
        }
        self._recorded = Recorded(self._step)

    def start_epoch(self, epoch: int) -> None:
        """Set training mode and the learning rate: constant, then linearly to zero."""
        rate = self.rules.learning_rate * min(1.0, 2 * (1 - epoch / self.rules.epochs))
        for name, network in self.networks.items():
            network.train()
            for group in self.optimisers[name].param_groups:
                group["lr"].fill_(rate)
        if self.keeps_moments:
            for norm in self.generator.normalisations():
                norm.eval()

    def keep_moments(self) -> None:
        """Let batch normalisation use the moments that it has from the next epoch on."""
        self.keeps_moments, self._recorded = True, Recorded(self._step)

    def step(self, inputs: Tensor, target: Tensor) -> Tensor:
        """Update the discriminator, if any, then the generator, on scaled pairs; returns `LOSSES` (3,)."""
        return self._recorded(inputs, target)

    def _step(self, inputs: Tensor, target: Tensor) -> Tensor:
        cells, delta = cells_of(target, self.scaling), delta_of(inputs)
        if self.generator.noise:
            noise = torch.randn(SAMPLES * len(inputs), self.generator.noise, device=inputs.device)
            repeated = inputs.repeat_interleave(SAMPLES, 0), cells.repeat_interleave(SAMPLES, 0)
            samples = self._evaluate("generator", *repeated, noise).reshape(-1, SAMPLES, *target.shape[1:])
            prediction = samples[:, 0]
            reconstruction = sample_loss(balanced(samples, delta), balanced(target, delta))
        else:
            prediction = self._evaluate("generator", inputs, cells)
            pair = prediction, target
            if "discriminator" in self.networks:  # as published
                reconstruction = reconstruction_loss(*pair, signed=True)
            else:
                reconstruction = reconstruction_loss(*(balanced(each, delta) for each in pair), signed=False)
        total = (self.rules.lambda_l1 or RECONSTRUCTION_WEIGHT) * reconstruction
        adversary = torch.zeros((), device=inputs.device)
        if "discriminator" in self.networks:
            logits = [
                self._evaluate("discriminator", inputs, fields) for fields in (target, prediction.detach())
            ]
            adversary = discriminator_loss(*logits)
            self._descend("discriminator", adversary)
            self.networks["discriminator"].requires_grad_(False)
            opinion = self._evaluate("discriminator", inputs, prediction)
            total = total + adversarial_loss(opinion)
        self._descend("generator", total)
        if "discriminator" in self.networks:
            self.networks["discriminator"].requires_grad_(True)
        return torch.stack([total, reconstruction, adversary]).detach().double()

    def _evaluate(self, name: str, *images: Tensor) -> Tensor:
        """A network's output in float32, computed in the precision of the rules."""
        half = self.rules.precision == "bfloat16"
        with torch.autocast(images[0].device.type, torch.bfloat16, enabled=half):
            found: Tensor = self.networks[name](*images)
        return found.float()

    def _descend(self, name: str, loss: Tensor) -> None:
        """One step of a network's optimiser."""
        self.optimisers[name].zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimisers[name].step()

    def state_dict(self) -> dict[str, Any]:
        """Weights and the state of the optimisers."""
        return {
            "networks": {name: network.state_dict() for name, network in self.networks.items()},
            "optimisers": {name: optimiser.state_dict() for name, optimiser in self.optimisers.items()},
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Load what `state_dict` returned."""
        for name, network in self.networks.items():
            network.load_state_dict(state["networks"][name])
            self.optimisers[name].load_state_dict(state["optimisers"][name])
            for group in self.optimisers[name].param_groups:
                group["lr"] = group["lr"].to(self.device)


def cells_of(fields: Tensor, scaling: Scaling) -> Tensor:
    """Numbers of cells (n,) in scaled fields (n, 8, y, x): the sum of their density."""
    return (fields[:, 0].double() * scaling.scale[0] + scaling.offset[0]).sum((1, 2)).float()
