"""Entry to Step A: the reduced bases of a track, read or computed, as a ``SectionResponse``."""

from concurrent.futures import as_completed
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from mcsettle.railway.track import SectionTrack, rayleigh_speed, without_laws
from mcsettle.step_a.fem25d.cache import FORMAT, digest_of, read_bases, write_bases
from mcsettle.step_a.fem25d.moving_load import SectionResponse
from mcsettle.step_a.fem25d.reduced_basis import Band, Bases, grow_band, output_error, training_set
from mcsettle.step_a.fem25d.section import Section
from mcsettle.step_a.fem25d.settings import Settings
from mcsettle.step_a.fem25d.solve import outputs, solve
from mcsettle.step_a.fem25d.stress_outputs import centreline
from mcsettle.step_a.fem25d.track_section import ElementProperties, track_section
from mcsettle.step_a.processes import keep_freed_memory, process_pool
from mcsettle.storage.files import cache_folder
from mcsettle.types import Progress, silent

HELD_OUT_SEED = 8_230_451


def section_response(
    track: SectionTrack,
    integration_depth: float = 5.5,
    settings: Settings | None = None,
    cache: Path | None = None,
    progress: Progress = silent,
    workers: int = 1,
    use_cache: bool = True,
    properties: ElementProperties | None = None,
    deferred: bool = False,
) -> SectionResponse:
    """Response of a ballasted track to moving loads (Step A), computed once and stored on disk.

    Parameters
    ----------
    track : SectionTrack
        Track and ground.
    integration_depth : float
        Depth [m] below the subgrade surface to which stresses are given.
    settings : Settings, optional
        Numerical settings.
    cache : Path, optional
        Folder of stored bases; default ``MCSETTLE_CACHE`` or the user's cache folder.
    progress : callable, optional
        Called as ``progress(stage, done, total)`` when a band of wavenumbers is finished.
    workers : int
        Processes (spawned, and closed before return); 1 computes in this process.
    use_cache : bool
        False neither reads nor writes stored bases.
    properties : ElementProperties, optional
        Moduli and damping element by element (``soften``); default those of the layers.
    deferred : bool
        True computes the bases when they are first needed: often the digest alone is.

    Raises
    ------
    ValueError
        For a depth, setting or number of workers out of range.
    NumericalError
        If a reduced basis misses its tolerance.
    """
    settings = Settings() if settings is None else settings
    if workers < 1:
        raise ValueError(f"workers is {workers}; at least one is needed")
    model = _Model(track, integration_depth, settings, properties)
    folder = cache_folder() if cache is None else Path(cache)
    load = partial(_bases, model, folder if use_cache else None, progress, workers)
    response = SectionResponse(
        track, integration_depth, settings, load, digest_of(model.description), properties
    )
    if not deferred:
        _ = response.bases
    return response


@dataclass(frozen=True, eq=False)
class _Model:
    """All that a response depends on."""

    track: SectionTrack
    integration_depth: float
    settings: Settings
    properties: ElementProperties | None

    def section(self) -> Section:
        """The full operator."""
        return track_section(
            self.track, self.integration_depth, self.settings.mesh, self.properties
        )

    @property
    def description(self) -> dict[str, Any]:
        """Everything a response depends on (the settlement laws are not part of it)."""
        description = {
            "format": FORMAT,
            "track": asdict(without_laws(self.track)),
            "integration_depth": self.integration_depth,
            "settings": self.settings.description,
        }
        if self.properties is not None:
            description["properties"] = self.properties.digest
        return description

    @property
    def basis_digest(self) -> str:
        """Digest of what the bases depend on: not rail, pad, settlement laws, K0 or quadrature."""
        description = replace(self, settings=self.settings.of_bases).description
        del description["track"]["pad"]
        rail = description["track"]["rail"]
        description["track"]["rail"] = [rail["offset"], rail["foot_width"]]
        for layer in description["track"]["layers"]:
            del layer["k0"], layer["name"]
        return digest_of(description)


def _bases(model: _Model, folder: Path | None, progress: Progress, workers: int) -> Bases:
    """Bases read from a folder, or computed and stored there; only computed without a folder."""
    if folder is None:
        return _compute(model, progress, workers)
    path = folder / f"section-{model.basis_digest[:32]}.npz"
    bases = read_bases(path)
    if bases is None:
        bases = _compute(model, progress, workers)
        write_bases(path, bases)
    return bases


def _compute(model: _Model, progress: Progress, workers: int) -> Bases:
    """Grow every band, here or in spawned processes; the result does not depend on which."""
    count = len(model.settings.bands)
    done: dict[int, tuple[Band, np.ndarray, np.ndarray]] = {}

    def report(index: int) -> None:
        progress("Track response", len(done), count)

    if workers == 1:
        keep_freed_memory()
        section = model.section()
        for i in range(count):
            done[i] = _grow(section, model, i)
            report(i)
    else:
        with process_pool(min(workers, count)) as pool:
            jobs = {pool.submit(_task, model, i): i for i in range(count)}
            for job in as_completed(jobs):
                done[jobs[job]] = job.result()
                report(jobs[job])
    bands, errors, heights = zip(*(done[i] for i in range(count)), strict=True)
    return Bases(bands, np.concatenate(errors), heights[0])


_sections: dict[str, Section] = {}  # of a worker process: the bands of one track share it


def _task(model: _Model, index: int) -> tuple[Band, np.ndarray, np.ndarray]:
    key = model.basis_digest
    if key not in _sections:
        _sections.clear()
        _sections[key] = model.section()
    return _grow(_sections[key], model, index)


def _grow(section: Section, model: _Model, index: int) -> tuple[Band, np.ndarray, np.ndarray]:
    """One band, its errors at random points outside its training set, and its centreline heights."""
    track, settings = model.track, model.settings
    lower = 0.0 if index == 0 else settings.bands[index - 1]
    upper = settings.bands[index]
    section = section.for_wavenumbers(lower, settings.mesh.border)
    speeds = {rayleigh_speed(layer.material) for layer in track.ground}
    training = training_set(lower, upper, settings.max_omega, settings.max_speed, sorted(speeds))
    rows, heights = centreline(section.basis, section.free, -model.integration_depth)
    growth = settings.tolerance, settings.least_solves, settings.max_solves
    band = grow_band(section, lower, upper, training, *growth, rows=rows)
    rng = np.random.Generator(np.random.Philox(key=[HELD_OUT_SEED, index]))
    errors = []
    for i, (at, share) in enumerate(rng.random((settings.held_out, 2)), start=index):
        # Anywhere; on the line of a constant moving load; among the slow waves.
        k = lower + (upper - lower) * at
        highest = settings.max_omega + k * settings.max_speed
        omega = (share * highest, share * k * settings.max_speed, highest * 1e-3**share)[i % 3]
        exact = outputs(section, k, solve(section, k, omega))
        errors.append(output_error(band.outputs(k, np.array([omega]))[0], exact))
    return band, np.array(errors), heights
