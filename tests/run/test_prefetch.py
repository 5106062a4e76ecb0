"""Step A of the sets to come in processes of their own: same rows, all from the cache folder."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from toy import COST, LOAD, SPRING, everything, uncertain

from mcsettle.errors import NumericalError
from mcsettle.railway.track import BeamTrack
from mcsettle.run import prefetch
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.run.prefetch import Prefetch
from mcsettle.step_a import transfer_cache, transfers
from mcsettle.step_a.fem25d.equivalent_linear import softening_file
from mcsettle.step_a.interaction import transfer_digest
from mcsettle.step_a.transfers import TransferStore, needs
from mcsettle.storage.files import cache_folder
from mcsettle.study.parameter_sets import all_sets
from mcsettle.study.study import load_study
from mcsettle.study.transfer_store import transfer_store
from mcsettle.types import silent

STUDIES = Path(__file__).resolve().parents[2] / "studies"
pytestmark = pytest.mark.usefixtures("fresh_cache", "few_resamples")
PROCESSES = True  # others go on with what is computed here


@pytest.fixture
def beams_too(monkeypatch):
    monkeypatch.setattr(prefetch, "WORTHWHILE", BeamTrack)


def test_sets_that_differ_in_loads_or_money_need_nothing_of_their_own():
    study = uncertain(LOAD, COST)
    shared_transfers = transfer_store(study)
    own = needs(study.scenes, shared_transfers)
    assert all(needs(member.study.scenes, shared_transfers) == own for member in all_sets(study))
    assert (
        Prefetch({m.index: m.study.scenes for m in all_sets(study)}, shared_transfers, 2).total == 0
    )


@pytest.mark.usefixtures("beams_too")
def test_the_run_finds_what_was_computed_ahead(monkeypatch, tmp_path):
    waves = {"window_m": 70.0, "shortest_m": 15.0, "longest_m": 30.0}
    shallow = {"integration_depth_m": 1.0}
    study = uncertain(
        SPRING, profile=waves, settlement=shallow, run={"realisations": 3, "parameter_sets": 4}
    )
    members = all_sets(study)
    shared_transfers = transfer_store(study)
    with Prefetch({m.index: m.study.scenes for m in members}, shared_transfers, 2) as window:
        assert window.total == 4
        assert len(window.running) == 3  # no more than are soon wanted
        for member in members:
            window.wait(member.index)
    assert (window.done, window.running, window.left) == (4, {}, [])
    with monkeypatch.context() as patch:  # all of it is in the cache folder
        patch.setattr(transfer_cache, "precompute", None)
        for member in members:
            transfers.step_a(member.study.scenes, store=shared_transfers)
    run_study(study, tmp_path / "two", RunOptions(processes=2))
    run_study(study, tmp_path / "one", RunOptions(processes=1))
    assert everything(tmp_path / "two") == everything(tmp_path / "one")


def test_softened_grounds_that_are_at_hand_start_no_process(monkeypatch):
    """Both files of every ground are in the cache folder: its softening, its transfer functions."""
    study = load_study(STUDIES / "linespeed.toml")
    monkeypatch.setattr(
        transfers, "track_response", lambda *_, **__: SimpleNamespace(digest="made up")
    )
    monkeypatch.setattr(transfers, "process_pool", None)
    modes = study.wavenumbers
    folder = cache_folder()
    folder.mkdir(parents=True, exist_ok=True)
    scenes = study.scenes
    passages = [p for p in transfers.passages_of(scenes, TransferStore()) if p[2].softened]
    assert len({ground for *_, ground in passages}) == 4
    contact = study.track_table.hertz_stiffness_n_per_m
    for _, service, (track, depth, softened, settings) in passages:
        chosen = softened.settings
        file = softening_file(
            track, service.train, service.speed, depth, settings.mesh, chosen, folder
        )
        digest = transfer_digest(service.train, service.speed, modes, contact, "made up")
        file.touch()
        transfer_cache.transfer_file(digest).touch()
    transfers._soften_ahead(scenes, TransferStore(), silent, 2)
    file.unlink()
    # A single one has no company to share with.
    transfers._soften_ahead(scenes, TransferStore(), silent, 2)
    for path in folder.glob("transfer-*"):
        path.unlink()
    with pytest.raises(TypeError):
        transfers._soften_ahead(scenes, TransferStore(), silent, 2)


class _Failed:
    def __init__(self, error):
        self.error = error

    def result(self):
        raise self.error

    def cancel(self):
        return True


def test_a_set_that_fails_ahead_is_left_to_the_run():
    window = Prefetch({}, TransferStore(), 2)
    window.running = {k: _Failed(NumericalError("no softening")) for k in range(3)}
    window.wait(1)  # set 0 was passed: its rows were there
    assert list(window.running) == [2]
    assert window.done == 1
    window.running[2].error = ValueError("a mistake in the program")
    with pytest.raises(ValueError, match="mistake"):
        window.wait(2)
