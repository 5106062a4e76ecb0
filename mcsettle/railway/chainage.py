"""Positions along a line as their owners write them, and metres.

Besides plain numbers in a unit there are positional notations, whose digits behind the sign are a
second unit and no fraction: "12.0440" is 12 miles and 440 yards, "752+147" is km 752 and 147 m.
"""

from typing import Any

import numpy as np

CHAINAGE_UNITS = {"m": 1.0, "km": 1e3, "ft": 0.3048, "yd": 0.9144, "mi": 1609.344}
# Notation: (major unit, minor unit) [m], how many minor ones a major one has, digits after the point.
NOTATIONS = {
    "mi.yd": (1609.344, 0.9144, 1760, 4),
    "mi.ch": (1609.344, 20.1168, 80, 2),
    "km.m": (1e3, 1.0, None, 0),
    "km+m": (1e3, 1.0, None, 0),
}
NOTATION_OR_UNIT = (*CHAINAGE_UNITS, *NOTATIONS)
_WORDS = {"mi.yd": ("miles", "yards"), "mi.ch": ("miles", "chains")}
_PATTERNS = {
    "mi.yd": r"^(?P<major>\d+)\s*(?:m|mi|miles?)\.?\s*(?P<minor>\d+(?:\.\d+)?)\s*(?:y|yd|yards?)\.?$",
    "mi.ch": r"^(?P<major>\d+)\s*(?:m|mi|miles?)\.?\s*(?P<minor>\d+(?:\.\d+)?)\s*(?:c|ch|chains?)\.?$",
    "km.m": r"^(?P<major>\d+)\.(?P<minor>\d+)$",
    "km+m": r"^(?P<major>\d+)\s*\+\s*(?P<minor>\d+(?:[.,]\d+)?)$",
}


def positions(texts: Any, notation: str) -> tuple[np.ndarray, np.ndarray]:
    """Positions [N] m of an Arrow column of texts in a positional ``notation``; which are wrong [N].

    NaN where a cell is empty. ``mi.yd`` and ``mi.ch`` are read as one number (four and two digits
    after the point, trailing zeros may be lost) or in words ("12m 34ch").
    """
    import pyarrow as pa
    import pyarrow.compute as pc

    major, minor, most, digits = NOTATIONS[notation]
    texts = pc.fill_null(pc.utf8_trim_whitespace(texts), "")
    empty = np.asarray(pc.equal(texts, "").to_numpy(zero_copy_only=False), dtype=bool)
    parts = pc.extract_regex(texts, "(?i)" + _PATTERNS[notation])
    matched = np.asarray(pc.is_valid(parts).to_numpy(zero_copy_only=False), dtype=bool)
    first = _part(parts, "major")
    second = _part(parts, "minor")
    if digits:  # one number: what is behind the point counts the minor unit
        plain = pc.match_substring_regex(texts, r"^\d+(\.\d*)?$")
        values = pc.cast(pc.if_else(plain, texts, pa.scalar(None, pa.string())), pa.float64())
        number = np.array(pc.fill_null(values, np.nan).to_numpy(), dtype=float)
        whole = np.floor(number + 1e-9)
        single = np.isfinite(number)
        first = np.where(single, whole, first)
        second = np.where(single, np.round((number - whole) * 10.0**digits, 6), second)
        matched |= single
    with np.errstate(invalid="ignore"):
        wrong = ~matched & ~empty
        if most is not None:
            wrong |= second >= most
    return first * major + second * minor, wrong


def with_minor(major: np.ndarray, minor: np.ndarray, notation: str) -> np.ndarray:
    """Positions [N] m from two columns of numbers: kilometres and metres, miles and yards or chains."""
    whole, part, _, _ = NOTATIONS.get(notation, NOTATIONS["km+m"])
    return major * whole + minor * part


def notation_fault(name: str, texts: list[str], lines: list[int], notation: str) -> str:
    """What to say of cells that are no positions in ``notation``, the first in line ``lines[0]``."""
    words = _WORDS.get(notation)
    count = f"{len(lines)} cells are" if len(lines) > 1 else "one cell is"
    quoted = ", ".join(f"'{text[:40]}'" for text in texts[:3])
    said = (
        f"column '{name}': {count} no position in '{notation}', first in line {lines[0]}: {quoted}"
    )
    if words is not None:
        most = NOTATIONS[notation][2]
        return f'{said}; a mile has {most} {words[1]}: decimal miles are chainage_unit = "mi"'
    example = "752+147.25" if notation == "km+m" else "12.345, the metres behind the point"
    return f"{said}; it reads such as {example}"


def looks_positional(chainage: np.ndarray, unit: str, texts: Any = None) -> str | None:
    """Why plain numbers [N] in ``unit``, in the order of the file, look like a positional notation.

    Miles whose fraction never passes .1760 and that stand on multiples of 0.0001 are miles and yards.
    Kilometres that run back, and rise when the digits behind the point are counted as metres, are
    kilometres and metres without padding (``texts`` as they stand in the file).
    """
    read = chainage[np.isfinite(chainage)]
    if len(read) < 10:
        return None
    fraction = read - np.floor(read + 1e-9)
    parts = fraction * 1e4
    if (
        unit == "mi"
        and np.max(fraction) < 0.17605
        and np.allclose(parts, np.round(parts), atol=1e-4)
    ):
        return (
            "no fraction of a mile passes .1760 and all are multiples of .0001: these are miles and "
            f"yards ({read[0]:.4f} is {int(read[0])} miles {round(parts[0])} yards); say "
            'chainage_unit = "mi.yd"'
        )
    if unit == "km" and texts is not None and np.any(np.diff(read) < 0.0):
        metres, wrong = positions(texts, "km.m")
        steps = np.diff(metres[np.isfinite(metres)])
        if not np.any(wrong) and (np.all(steps >= 0.0) or np.all(steps <= 0.0)):
            return (
                "the numbers run back, and do not when the digits behind the point are metres: these "
                'are kilometres and metres without zeros before them; say chainage_unit = "km.m"'
            )
    return None


def _part(parts: Any, name: str) -> np.ndarray:
    import pyarrow as pa
    import pyarrow.compute as pc

    text = pc.replace_substring(pc.struct_field(parts, name), ",", ".")
    text = pc.if_else(pc.equal(text, ""), pa.scalar(None, pa.string()), text)
    return np.array(pc.fill_null(pc.cast(text, pa.float64()), np.nan).to_numpy(), dtype=float)
