"""Layered grounds with probabilities: many possible soil profiles of the segments of a line.

Two tables: ``layers`` has the layers of each ground from the top down (the level of a layer's top, its
material), ``weights`` the probability of each ground within its segment. The grounds are cut into
slabs of common depths, so that all of them share one mesh; a slab is made of what lies at its middle,
and a layer in which no middle lies is merged into it (``merged_layers``).
"""

import csv
import io
import math
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mcsettle.errors import InputError
from mcsettle.railway.text_files import SEPARATORS, decoded, refused, sniffed

LARGEST_FILE = 50_000_000  # bytes
MOST_GROUNDS = 100_000
MOST_LAYERS = 200  # of one ground
LEVEL_UNITS = {"m": 1.0, "dm": 0.1, "cm": 0.01, "mm": 1e-3, "ft": 0.3048}


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
class MergedLayer:
    """A layer that no slab is made of: ``top`` and ``height`` [m], and the materials of its slabs."""

    material: str
    top: float
    height: float
    into: tuple[str, ...]


@dataclass(frozen=True)
class Columns:
    """Names of the columns of both tables, what separates them, and how they are written."""

    separator: str = ";"
    ground: str = "soilprofile_id"
    top: str = "top_level"
    material: str = "soil_name"
    segment: str = "segment_id"
    probability: str = "probability"
    encoding: str | None = None
    decimal: str = "."
    level_unit: str = "m"


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
        A file that cannot be read, levels that do not fall, probabilities that do not add up; all
        faults of a file at once.
    """
    in_layers, in_weights = list[str](), list[str]()
    levels = _levels(layers, columns, in_layers)
    shares = _shares(weights, columns, in_weights)
    in_weights += [
        f"ground '{name}' has no layers in {layers.name}" for name in shares if name not in levels
    ]
    grounds = []
    for name, (segment, share) in shares.items():
        if name in levels:
            tops, materials = _column(name, levels[name], leave_out, in_layers)
            grounds.append(Ground(name, segment, share, tops, materials))
    for path, faults in ((layers, in_layers), (weights, in_weights)):
        if faults:
            raise refused(path, faults)
    ranks = _ranks(grounds)
    return tuple(sorted(grounds, key=lambda ground: ranks[ground.name]))


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
    return tuple(ground.at(float(depth)) for depth in _middles(heights))


def merged_layers(ground: Ground, heights: Sequence[float]) -> tuple[MergedLayer, ...]:
    """Layers of ``ground`` within the slabs that none of them is made of: no middle lies in them.

    Examples
    --------
    >>> ground = Ground("a", "s", 1.0, (0.0, 1.1, 1.4), ("fill", "peat", "sand"))
    >>> [(layer.material, layer.into) for layer in merged_layers(ground, (1.0, 1.0))]
    [('peat', ('sand',))]
    """
    middles = _middles(heights)
    edges = np.concatenate([[0.0], np.cumsum(heights)])
    bottoms = (*ground.tops[1:], np.inf)
    merged = []
    for material, top, bottom in zip(ground.materials, ground.tops, bottoms, strict=True):
        if top < edges[-1] and not np.any((middles >= top) & (middles < bottom)):
            slabs_there = middles[:-1][(edges[:-1] < bottom) & (edges[1:] > top)]
            into = dict.fromkeys(ground.at(float(middle)) for middle in slabs_there)
            merged.append(MergedLayer(material, top, bottom - top, tuple(into)))
    return tuple(merged)


def merging_remark(grounds: Sequence[Ground], heights: Sequence[float]) -> str:
    """How many of ``grounds`` have layers that the slabs do not show, in words; "" if none has."""
    thin = [merged_layers(ground, heights) for ground in grounds]
    lost = [layer.height for layers in thin for layer in layers]
    if not lost:
        return ""
    return (
        f"{sum(map(bool, thin))} of {len(grounds)} grounds have layers too thin for the slabs "
        f"({len(lost)} layers of {min(lost):.3g} to {max(lost):.3g} m): a slab is "
        "made of what lies at its middle, and they are merged into it. Finer slabs (fine_m, "
        "fine_depth_m, coarse_m) show them; 'mcsettle grounds' lists them"
    )


def _middles(heights: Sequence[float]) -> np.ndarray:
    """Depths [m] at which the material of each slab and of the half-space is taken."""
    edges = np.concatenate([[0.0], np.cumsum(heights)])
    return np.array([*(0.5 * (edges[:-1] + edges[1:])), edges[-1] + heights[-1]])


def _levels(path: Path, columns: Columns, faults: list[str]) -> dict[str, list[tuple[float, str]]]:
    """Level [m] of the top and material of each layer, by ground, in the order of the file."""
    levels: dict[str, list[tuple[float, str]]] = defaultdict(list)
    unit = LEVEL_UNITS[columns.level_unit]
    for line, row in _rows(path, columns, (columns.ground, columns.top, columns.material)):
        top = _number(line, columns.top, row[columns.top], columns.decimal, faults)
        levels[row[columns.ground]].append((top * unit, row[columns.material]))
    return levels


def _column(
    name: str, layers: list[tuple[float, str]], leave_out: Sequence[str], faults: list[str]
) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Depths and materials of one ground from its levels, top down; equal neighbours are one."""
    if len(layers) > MOST_LAYERS:
        faults.append(f"ground '{name}' has {len(layers)} layers; at most {MOST_LAYERS}")
    kept = [(top, material) for top, material in layers if material not in leave_out]
    if not kept:
        faults.append(f"nothing is left of ground '{name}'")
        return (0.0,), ("",)
    levels = [top for top, _ in kept]
    if any(lower >= upper for upper, lower in zip(levels, levels[1:], strict=False)):
        faults.append(
            f"the levels of ground '{name}' do not fall ({', '.join(f'{top:g}' for top in levels)}); "
            "layers go from the top down, by the level of their top"
        )
    tops, materials = [0.0], [kept[0][1]]
    for top, material in kept[1:]:
        if material != materials[-1]:
            tops.append(levels[0] - top)
            materials.append(material)
    return tuple(tops), tuple(materials)


def _shares(path: Path, columns: Columns, faults: list[str]) -> dict[str, tuple[str, float]]:
    """Segment and share of each ground; the shares of a segment add up to 1."""
    shares: dict[str, tuple[str, float]] = {}
    sums: dict[str, float] = defaultdict(float)
    needed = (columns.segment, columns.ground, columns.probability)
    before = len(faults)
    for line, row in _rows(path, columns, needed):
        name, segment = row[columns.ground], row[columns.segment]
        text = row[columns.probability]
        share = _number(line, columns.probability, text, columns.decimal, faults)
        if name in shares:
            faults.append(f"line {line}: ground '{name}' comes a second time")
        if share <= 0.0:
            faults.append(f"line {line}: probability {share:g}; it must be positive")
        shares[name] = (segment, share)
        sums[segment] += share
    if not 0 < len(shares) <= MOST_GROUNDS:
        faults.append(f"has {len(shares)} grounds; it takes 1 to {MOST_GROUNDS}")
    if len(faults) > before:
        return shares
    whole = 1.0 if all(abs(total - 1.0) <= 1e-3 for total in sums.values()) else 100.0
    faults += [
        f"the probabilities of segment '{segment}' add up to {total:g}, not {whole:g}"
        for segment, total in sums.items()
        if abs(total - whole) > 1e-3 * whole
    ]
    return {name: (s, share / sums[s]) for name, (s, share) in shares.items()}


def _ranks(grounds: Sequence[Ground]) -> dict[str, int]:
    """Rank of each ground within its segment, the likeliest first."""
    ranks, before = {}, Counter[str]()
    for ground in sorted(grounds, key=lambda ground: -ground.probability):
        ranks[ground.name] = before[ground.segment]
        before[ground.segment] += 1
    return ranks


def _rows(
    path: Path, columns: Columns, needed: Sequence[str]
) -> Iterator[tuple[int, dict[str, str]]]:
    """Line and needed cells of each row of a table.

    Raises
    ------
    InputError
        The file cannot be read, is of another encoding, or lacks a column.
    """
    try:
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise InputError(f"{path} has {size} bytes; at most {LARGEST_FILE}")
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    try:
        text = decoded(data, columns.encoding)
    except InputError as error:
        raise refused(path, [str(error)]) from None
    reader = csv.DictReader(io.StringIO(text), delimiter=columns.separator)
    try:
        names = [name.strip() for name in reader.fieldnames or []]
        reader.fieldnames = names
        lacking = [name for name in needed if name not in names]
        if lacking:
            raise refused(path, _lacking(lacking, names, text, columns.separator))
        for row in reader:
            yield reader.line_num, {name: (row[name] or "").strip() for name in needed}
    except csv.Error:
        raise refused(
            path, ["its lines cannot be told apart: a quotation mark is opened and never closed"]
        ) from None


def _lacking(lacking: list[str], names: list[str], text: str, separator: str) -> list[str]:
    guess = sniffed(text.splitlines()[:20])
    faults = [f"has no column {', '.join(lacking)}; it has {', '.join(names)[:300]}"]
    if guess is not None and SEPARATORS[guess[0]] != separator:
        faults.insert(0, f'the cells are separated by a {guess[0]}: separator = "{guess[0]}"')
    return faults


def _number(line: int, column: str, text: str, decimal: str, faults: list[str]) -> float:
    """The number of a cell; 1 where it is none, which ``faults`` then says."""
    try:
        value = float(text.replace(decimal, ".") if decimal == "," else text)
    except ValueError:
        value = math.nan
    if math.isfinite(value):
        return value
    comma = "," in text and decimal == "."
    advice = ' (the decimal sign is a comma: decimal = ",")' if comma else ""
    faults.append(f"line {line}: {column} is '{text[:40]}'; it must be a number{advice}")
    return 1.0
