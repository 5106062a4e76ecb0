"""Transfer functions predicted from those of other grounds.

A passage (a train at a speed on a ground) is described by numbers: layers, axle loads, suspensions,
speed. Passages that differ in numbers alone are a family. What varies within a family, in logarithms
where it is positive, are its inputs; its transfer functions at the training passages are combined with
weights of ``kriging``. Geostatic stresses and depths follow from the ground itself.
"""

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from mcsettle.railway.scene import Scene
from mcsettle.railway.track import Track
from mcsettle.railway.traffic import Service, Train
from mcsettle.step_a.depths import geostatic_stress
from mcsettle.step_a.kriging import Kriging, conditioned, fitted
from mcsettle.step_a.track_response import depths_of
from mcsettle.step_a.transfer import TransferFunctions

FIELDS = ("quasi_static", "dynamic", "force", "track_compliance", "rail_deflection", "following")
SAME = 1e-9  # relative: numbers, and correlations of inputs, that are one
GEOSTATIC_ONLY = ("law", "k0", "name")  # of a layer: what its transfer functions do not depend on


@dataclass(frozen=True, eq=False)
class Description:
    """A passage in numbers: ``kind`` is a digest of all that is no number, ``numbers`` [L]."""

    kind: str
    numbers: np.ndarray


def describe(scene: Scene, service: Service, track: Track) -> Description:
    """Description of a service of ``scene`` on ``track``."""
    softening = None if scene.softening is None else asdict(scene.softening)
    data = {
        "track": _of_track(track),
        "train": _of_train(service.train),
        "speed": float(service.speed),
        "contact": float(scene.contact),
        "depth": float(scene.integration_depth),
        "loads": scene.rail_loads.description,
        "softening": softening,
        "wavenumbers": hashlib.sha256(scene.wavenumbers.tobytes()).hexdigest(),
    }
    numbers: list[float] = []
    kind = hashlib.sha256()
    for path, value in _leaves(data, ""):
        if isinstance(value, float):
            numbers.append(value)
            value = ""
        kind.update(f"{path}={value!r}\n".encode())
    return Description(kind.hexdigest(), np.array(numbers))


@dataclass(frozen=True, eq=False)
class Inputs:
    """What varies within a family: from numbers [L] to points [D] in standard deviations.

    ``constant`` [L] are the numbers of its first passage, ``columns`` [D] which of them vary.
    """

    constant: np.ndarray
    varies: np.ndarray
    columns: np.ndarray
    logarithmic: np.ndarray
    mean: np.ndarray
    deviation: np.ndarray

    def point(self, numbers: np.ndarray) -> np.ndarray | None:
        """Point [D]; None where something else differs, or a logarithm has no argument."""
        fixed = ~self.varies
        if not np.allclose(numbers[fixed], self.constant[fixed], rtol=SAME, atol=0.0):
            return None
        values = numbers[self.columns]
        if np.any(values[self.logarithmic] <= 0.0) or not np.all(np.isfinite(values)):
            return None
        logs = np.log(np.where(self.logarithmic, values, 1.0))
        return (np.where(self.logarithmic, logs, values) - self.mean) / self.deviation


def inputs_of(numbers: np.ndarray) -> Inputs:
    """Inputs of passages described by ``numbers`` [P, L].

    Of numbers that are the same function of each other one is kept.
    """
    finite = np.where(np.isfinite(numbers), numbers, 0.0)
    scale = np.maximum(np.abs(finite).max(axis=0), 1e-300)
    varies = np.ptp(finite, axis=0) > SAME * scale
    columns, kept = [], np.zeros((len(numbers), 0))
    logarithmic, means, deviations = [], [], []
    for column in np.flatnonzero(varies):
        positive = bool(np.all(finite[:, column] > 0.0))
        values = np.log(finite[:, column]) if positive else finite[:, column]
        mean, deviation = float(values.mean()), float(values.std())
        standard = (values - mean) / deviation
        if np.any(np.abs(kept.T @ standard) > (1.0 - SAME) * len(standard)):
            continue
        kept = np.column_stack([kept, standard])
        columns.append(int(column))
        logarithmic.append(positive)
        means.append(mean)
        deviations.append(deviation)
    return Inputs(
        numbers[0],
        varies,
        np.array(columns, dtype=int),
        np.array(logarithmic, dtype=bool),
        np.array(means),
        np.array(deviations),
    )


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Transfer functions of one family, predicted from ``training`` at the points of ``kriging``."""

    inputs: Inputs
    kriging: Kriging
    training: tuple[TransferFunctions, ...]

    @cached_property
    def digest(self) -> str:
        """SHA-256 [hex] of all that a prediction depends on."""
        total = hashlib.sha256()
        for transfer in self.training:
            total.update(transfer.digest.encode())
        for array in (self.kriging.points, self.kriging.lengths, self.inputs.mean):
            total.update(np.ascontiguousarray(array).tobytes())
        total.update(repr(self.kriging.terms).encode())
        return total.hexdigest()

    def fits(self, scene: Scene, track: Track) -> bool:
        """Whether ``track`` has as many depths in each layer as the training grounds."""
        grid = depths_of(track, scene.integration_depth)
        return np.array_equal(grid.layer, self.training[0].grid.layer)

    def predict(
        self, scene: Scene, service: Service, track: Track, point: np.ndarray
    ) -> TransferFunctions:
        """Transfer functions at ``point`` [D]: those of ``service`` on ``track``."""
        weights = self.kriging.weights(point[None])[0]
        total = hashlib.sha256(self.digest.encode())
        total.update(np.ascontiguousarray(point).tobytes())
        return self.combined(weights, scene, service, track, total.hexdigest())

    def combined(
        self, weights: np.ndarray, scene: Scene, service: Service, track: Track, digest: str
    ) -> TransferFunctions:
        """Sum of the training transfer functions with ``weights`` [N]."""
        grid = depths_of(track, scene.integration_depth)
        arrays = {
            name: (weights @ flat).view(dtype).reshape(shape)
            for name, (flat, dtype, shape) in self._stacks.items()
        }
        return replace(
            self.training[0],
            train=service.train.name,
            speed=service.speed,
            grid=grid,
            geostatic=geostatic_stress(track.layers, grid),
            digest=digest,
            **arrays,
        )

    @cached_property
    def _stacks(self) -> dict[str, tuple[np.ndarray, Any, tuple[int, ...]]]:
        """Of every field: real numbers [N, n] of the training passages, their type and shape."""
        stacks = {}
        for name in FIELDS:
            first = getattr(self.training[0], name)
            if first is not None:
                flat = np.stack([np.ravel(getattr(t, name)).view(float) for t in self.training])
                stacks[name] = flat, first.dtype, first.shape
        return stacks


def learnt(
    inputs: Inputs,
    points: np.ndarray,
    training: Sequence[TransferFunctions],
    groups: Sequence[np.ndarray],
) -> Surrogate:
    """Surrogate of a family from its ``training`` passages at ``points`` [N, D].

    ``groups``: indices of the passages of each ground, which are left out together.
    """
    return Surrogate(inputs, fitted(points, inner_products(training), groups), tuple(training))


def relearnt(
    inputs: Inputs,
    points: np.ndarray,
    training: Sequence[TransferFunctions],
    lengths: np.ndarray,
    terms: tuple[tuple[int, ...], ...],
) -> Surrogate:
    """Surrogate with lengths and trend that were found before."""
    return Surrogate(inputs, conditioned(points, lengths, terms), tuple(training))


def inner_products(training: Sequence[TransferFunctions]) -> np.ndarray:
    """Inner products [N, N] of transfer functions: quasi-static and dynamic stress of each layer.

    Each of these parts has the same weight, on average over ``training``.
    """
    gram = np.zeros((len(training), len(training)))
    for name in ("quasi_static", "dynamic"):
        for layer in np.unique(training[0].grid.layer):
            here = training[0].grid.layer == layer
            part = np.stack([np.ravel(getattr(t, name)[..., here]).view(float) for t in training])
            products = part @ part.T
            gram += products / max(float(np.trace(products)) / len(training), 1e-300)
    return gram


def _of_track(track: Track) -> dict[str, Any]:
    data = asdict(track)
    for layer in data["layers"]:
        for key in GEOSTATIC_ONLY:
            del layer[key]
    return data | {"model": type(track).__name__}


def _of_train(train: Train) -> dict[str, Any]:
    different = list(dict.fromkeys(train.cars))
    order = [different.index(car) for car in train.cars]
    return {"order": tuple(order), "cars": [asdict(car) for car in different]}


def _leaves(data: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Every value of nested mappings and lists under its path."""
    if isinstance(data, Mapping):
        for key, value in data.items():
            yield from _leaves(value, f"{path}.{key}")
    elif isinstance(data, list | tuple) and not all(isinstance(v, int | str) for v in data):
        for place, value in enumerate(data):
            yield from _leaves(value, f"{path}.{place}")
    elif isinstance(data, np.floating):
        yield path, float(data)
    else:
        yield path, data
