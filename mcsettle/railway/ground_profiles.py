"""Layered grounds with probabilities: many possible soil profiles of the segments of a line.

Two tables: ``layers`` has the layers of each ground from the top down (the level of a layer's top, its
material), ``weights`` the probability of each ground within its segment. The grounds are cut into
slabs of common depths, so that all of them share one mesh; a slab is made of what lies at its middle.
"""

import csv
import io
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mcsettle.errors import InputError

LARGEST_FILE = 50_000_000  # bytes
MOST_GROUNDS = 100_000
MOST_LAYERS = 200  # of one ground


@dataclass(frozen=True)
class Ground:
    """One possible ground of a segment; ``probability`` within it, adding up to 1.

    ``tops`` [m] depths of the layers' tops below the first one that counts, rising from 0;
    ``materials`` their names.
    """

    name: str
    segment: str
    probability: float
    tops: tuple[float, ...]
    materials: tuple[str, ...]

    def at(self, depth: float) -> str:
        """Material at ``depth`` [m]; the lowest layer goes on for ever."""
        return self.materials[int(np.searchsorted(self.tops, depth, side="right")) - 1]


@dataclass(frozen=True)
class Columns:
    """Names of the columns of both tables, and what separates them."""

    separator: str = ";"
    ground: str = "soilprofile_id"
    top: str = "top_level"
    material: str = "soil_name"
    segment: str = "segment_id"
    probability: str = "probability"


def read_grounds(
    layers: Path, weights: Path, columns: Columns, leave_out: Sequence[str] = ()
) -> tuple[Ground, ...]:
    """Every ground of both files: the likeliest of each segment first, then the second ones.

    ``leave_out``: materials that are no ground (a placeholder above the surface); the surface is the
    top of the first layer that is left. The first grounds of any number thus cover as many segments
    as they can.

    Raises
    ------
    InputError
        A file that cannot be read, levels that do not fall, probabilities that do not add up.
    """
    found: dict[str, list[tuple[float, str]]] = defaultdict(list)
    for line, row in _rows(layers, columns, (columns.ground, columns.top, columns.material)):
        top = _number(layers, line, columns.top, row[columns.top])
        found[row[columns.ground]].append((top, row[columns.material]))
    shares = _shares(weights, columns)
    grounds = []
    for name, (segment, share) in shares.items():
        if name not in found:
            raise InputError(f"{weights}: ground '{name}' has no layers in {layers}")
        tops, materials = _column(layers, name, found[name], leave_out)
        grounds.append(Ground(name, segment, share, tops, materials))
    return tuple(sorted(grounds, key=_rank(grounds)))


def slabs(fine: float, fine_depth: float, coarse: float, depth: float) -> tuple[float, ...]:
    """Heights [m] of the slabs down to ``depth``; a half-space follows.

    ``fine`` ones to ``fine_depth``, ``coarse`` ones from there on.

    Examples
    --------
    >>> slabs(0.5, 1.0, 1.0, 3.0)
    (0.5, 0.5, 1.0, 1.0)
    """
    upper = max(1, round(fine_depth / fine))
    lower = max(0, round((depth - upper * fine) / coarse))
    return (fine,) * upper + (coarse,) * lower


def slab_materials(ground: Ground, heights: Sequence[float]) -> tuple[str, ...]:
    """Material of each slab and of the half-space below, by what lies at its middle."""
    edges = np.concatenate([[0.0], np.cumsum(heights)])
    middles = [*(0.5 * (edges[:-1] + edges[1:])), edges[-1] + heights[-1]]
    return tuple(ground.at(float(depth)) for depth in middles)


def _column(
    path: Path, name: str, layers: list[tuple[float, str]], leave_out: Sequence[str]
) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Depths and materials of one ground from its levels, top down; equal neighbours are one."""
    if len(layers) > MOST_LAYERS:
        raise InputError(f"{path}: ground '{name}' has {len(layers)} layers; at most {MOST_LAYERS}")
    kept = [(top, material) for top, material in layers if material not in leave_out]
    if not kept:
        raise InputError(f"{path}: nothing is left of ground '{name}'")
    levels = [top for top, _ in kept]
    if any(lower >= upper for upper, lower in zip(levels, levels[1:], strict=False)):
        raise InputError(
            f"{path}: the levels of ground '{name}' do not fall ({', '.join(map(str, levels))}); "
            "layers go from the top down, by the level of their top in metres"
        )
    tops, materials = [0.0], [kept[0][1]]
    for top, material in kept[1:]:
        if material != materials[-1]:
            tops.append(levels[0] - top)
            materials.append(material)
    return tuple(tops), tuple(materials)


def _shares(path: Path, columns: Columns) -> dict[str, tuple[str, float]]:
    """Segment and share of each ground; the shares of a segment add up to 1."""
    found: dict[str, tuple[str, float]] = {}
    sums: dict[str, float] = defaultdict(float)
    needed = (columns.segment, columns.ground, columns.probability)
    for line, row in _rows(path, columns, needed):
        name, segment = row[columns.ground], row[columns.segment]
        share = _number(path, line, columns.probability, row[columns.probability])
        if name in found:
            raise InputError(f"{path}, line {line}: ground '{name}' comes a second time")
        if share <= 0.0:
            raise InputError(f"{path}, line {line}: probability {share:g}; it must be positive")
        found[name] = (segment, share)
        sums[segment] += share
    if not 0 < len(found) <= MOST_GROUNDS:
        raise InputError(f"{path} has {len(found)} grounds; it takes 1 to {MOST_GROUNDS}")
    for whole in (1.0, 100.0):  # shares or per cent
        off = {s: total for s, total in sums.items() if abs(total - whole) > 1e-3 * whole}
        if not off:
            return {name: (s, share / sums[s]) for name, (s, share) in found.items()}
    segment, total = next(iter(off.items()))
    raise InputError(
        f"{path}: the probabilities of segment '{segment}' add up to {total:g}, not 100"
    )


def _rank(grounds: Sequence[Ground]) -> "_Rank":
    own: dict[str, list[Ground]] = defaultdict(list)
    for ground in grounds:
        own[ground.segment].append(ground)
    place = {}
    for members in own.values():
        for rank, ground in enumerate(sorted(members, key=lambda g: -g.probability)):
            place[ground.name] = rank
    return _Rank(place)


@dataclass(frozen=True)
class _Rank:
    """Key that sorts grounds by their rank within their segment; a segment keeps its place."""

    place: Mapping[str, int]

    def __call__(self, ground: Ground) -> int:
        return self.place[ground.name]


def _rows(
    path: Path, columns: Columns, needed: Sequence[str]
) -> Iterator[tuple[int, dict[str, str]]]:
    try:
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(f"{path} has {size} bytes; at most {LARGEST_FILE}")
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    reader = csv.DictReader(io.StringIO(text), delimiter=columns.separator)
    try:
        lacking = [name for name in needed if name not in (reader.fieldnames or [])]
        if lacking:
            raise InputError(
                f"{path} has no column {', '.join(lacking)}; it has "
                f"{', '.join(map(str, reader.fieldnames or []))[:300]}"
            )
        for line, row in enumerate(reader, 2):
            yield line, {name: (row[name] or "").strip() for name in needed}
    except csv.Error as error:
        raise InputError(f"{path} is no table: {error}") from None


def _number(path: Path, line: int, column: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{path}, line {line}: {column} is '{text[:40]}'; it must be a number")
    return value
