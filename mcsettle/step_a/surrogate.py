"""Transfer functions predicted from those of other grounds.

A passage (a train at a speed on a ground) is described by numbers: layers, axle loads, suspensions,
speed. The passages of one service on many grounds, alike but for numbers, are a family. What varies
within a family, in logarithms where it is positive, are its inputs; its transfer functions on the
training grounds are combined with weights of ``kriging``. Services of one train at several speeds have
the same weights, so that most of the error cancels where they are compared.

On soil that softens every speed has a ground of its own. A training ground is the one of the highest
speed, under which every speed is computed; what a ground softened by the speed itself changes is smaller
by a factor of ten to a hundred and is predicted by a second level, from fewer grounds. Geostatic stresses
and depths follow from the ground itself.
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
from mcsettle.step_a.kriging import Kriging
from mcsettle.step_a.track_response import depths_of
from mcsettle.step_a.transfer import TransferFunctions

FIELDS = ("quasi_static", "dynamic", "force", "track_compliance", "rail_deflection", "following")
SAME = 1e-9  # relative: numbers, and correlations of inputs, that are one
MARGIN = 1.0  # SDs of an input beyond the passages that it was learnt from
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

    ``constant`` [L] are the numbers of its first passage, ``columns`` [D] which of them vary, from points
    ``lowest`` to ``highest`` [D].
    """

    constant: np.ndarray
    varies: np.ndarray
    columns: np.ndarray
    logarithmic: np.ndarray
    mean: np.ndarray
    deviation: np.ndarray
    lowest: np.ndarray
    highest: np.ndarray

    def point(self, numbers: np.ndarray) -> np.ndarray | None:
        """Point [D]; None where something else differs, or it lies outside of what was learnt from."""
        fixed = ~self.varies
        if not np.allclose(numbers[fixed], self.constant[fixed], rtol=SAME, atol=0.0):
            return None
        values = numbers[self.columns]
        if np.any(values[self.logarithmic] <= 0.0) or not np.all(np.isfinite(values)):
            return None
        logs = np.log(np.where(self.logarithmic, values, 1.0))
        point = (np.where(self.logarithmic, logs, values) - self.mean) / self.deviation
        outside = np.any((point < self.lowest - MARGIN) | (point > self.highest + MARGIN))
        return None if outside else point


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
        kept.min(axis=0),
        kept.max(axis=0),
    )


Arrays = dict[str, np.ndarray]


@dataclass(frozen=True, eq=False)
class Level:
    """Arrays that are combined with one set of weights: of each field real numbers [N, n].

    ``sources`` [N]: digests of what they are; ``remainder``: how large what the trend leaves is, relative
    to that of the first level.
    """

    kriging: Kriging
    stacks: Arrays
    sources: tuple[str, ...]
    remainder: float = 1.0

    def combined(self, weights: np.ndarray) -> Arrays:
        """Sum of the training arrays with ``weights`` [N]."""
        return {name: weights @ stack for name, stack in self.stacks.items()}


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Transfer functions of one family, the sum of its ``levels``.

    ``like``: transfer functions of one of its passages, whose shapes all have.
    """

    inputs: Inputs
    like: TransferFunctions
    levels: tuple[Level, ...]

    @cached_property
    def digest(self) -> str:
        """SHA-256 [hex] of all that a prediction depends on."""
        told = [(level.sources, level.kriging.terms) for level in self.levels]
        total = hashlib.sha256(repr(told).encode())
        arrays = [
            a for k in (level.kriging for level in self.levels) for a in (k.points, k.lengths)
        ]
        for array in (self.inputs.mean, *arrays):
            total.update(array.tobytes())
        return total.hexdigest()

    def fits(self, scene: Scene, track: Track) -> bool:
        """Whether ``track`` has as many depths in each layer as the training grounds."""
        grid = depths_of(track, scene.integration_depth)
        return np.array_equal(grid.layer, self.like.grid.layer)

    def deviations(self, at: np.ndarray) -> np.ndarray:
        """SDs [M] of the error at ``at`` [M, D], relative to the remainder of the first level."""
        parts = [level.remainder * level.kriging.deviations(at) for level in self.levels]
        return np.asarray(np.linalg.norm(parts, axis=0))

    def predict(
        self, scene: Scene, service: Service, track: Track, point: np.ndarray
    ) -> TransferFunctions:
        """Transfer functions at ``point`` [D]: those of ``service`` on ``track``."""
        weights = [level.kriging.weights(point[None])[0] for level in self.levels]
        total = hashlib.sha256(self.digest.encode())
        total.update(point.tobytes())
        return self.combined(weights, scene, service, track, total.hexdigest())

    def combined(
        self,
        weights: Sequence[np.ndarray],
        scene: Scene,
        service: Service,
        track: Track,
        digest: str,
    ) -> TransferFunctions:
        """Sum of the training transfer functions with ``weights`` [N] of each level."""
        grid, arrays = depths_of(track, scene.integration_depth), Arrays()
        for level, of_level in zip(self.levels, weights, strict=True):
            for name, values in level.combined(of_level).items():
                arrays[name] = arrays[name] + values if name in arrays else values
        for name, values in arrays.items():
            present = getattr(self.like, name)
            arrays[name] = values.view(present.dtype).reshape(present.shape)
        return replace(
            self.like,
            train=service.train.name,
            speed=service.speed,
            grid=grid,
            geostatic=geostatic_stress(track.layers, grid),
            digest=digest,
            **arrays,
        )


def stacked(transfers: Sequence[TransferFunctions]) -> Arrays:
    """Of every field of ``transfers`` [N] real numbers [N, n]."""
    return {
        name: np.stack([np.ravel(getattr(t, name)).view(float) for t in transfers])
        for name in FIELDS
        if getattr(transfers[0], name) is not None
    }


def inner_products(stacks: Arrays, of: Arrays, like: TransferFunctions) -> np.ndarray:
    """Inner products [N, N] of transfer functions: quasi-static and dynamic stress of each layer.

    Each of these parts has the same weight, on average over the transfer functions ``of``.
    """
    n = len(next(iter(stacks.values())))
    gram = np.zeros((n, n))
    for name in ("quasi_static", "dynamic"):
        for layer in np.unique(like.grid.layer):
            part, whole = (_part(arrays[name], name, layer, like) for arrays in (stacks, of))
            gram += part @ part.T / max(float(np.sum(whole**2)) / len(whole), 1e-300)
    return gram


def _part(stack: np.ndarray, name: str, layer: int, like: TransferFunctions) -> np.ndarray:
    """Real numbers [N, m] of one layer in a ``stack`` [N, n] of stresses."""
    present = getattr(like, name)
    values = stack.view(present.dtype).reshape(len(stack), *present.shape)
    here = np.ascontiguousarray(values[..., like.grid.layer == layer])
    return here.reshape(len(stack), -1).view(float)


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
