"""Which parameter sets have a Step A of their own, and which grounds are at hand."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from toy import COST, LOAD, SPRING, everything, uncertain

from mcsettle.railway.track import BeamTrack, SectionTrack
from mcsettle.run import together
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study
from mcsettle.run.together import own_step_a
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


def test_sets_that_differ_in_loads_or_money_need_nothing_of_their_own():
    study = uncertain(LOAD, COST)
    shared_transfers = transfer_store(study)
    own = needs(study.scenes, shared_transfers)
    assert all(needs(member.study.scenes, shared_transfers) == own for member in all_sets(study))
    assert not own_step_a(all_sets(study), shared_transfers)


@pytest.mark.parametrize(("sort", "own"), [(SectionTrack, False), (BeamTrack, True)])
def test_a_step_a_of_their_own_is_worth_processes_where_it_takes_long(monkeypatch, sort, own):
    monkeypatch.setattr(together, "SectionTrack", sort)
    study = uncertain(SPRING)
    members = all_sets(study)
    assert own_step_a(members, transfer_store(study)) is own
    assert not own_step_a(members[:1], transfer_store(study))
    assert not own_step_a(members, None)


def test_parameter_sets_by_two_processes_have_the_same_bytes(tmp_path, monkeypatch):
    """Each set has a Step A of its own in one study, and rows of its own in no set of the other."""
    waves = {"window_m": 70.0, "shortest_m": 15.0, "longest_m": 30.0}
    few = {"realisations": 3, "parameter_sets": 5}
    shallow = {"integration_depth_m": 1.0}
    told: list[tuple[str, int, int]] = []
    for entry, own in ((SPRING, 5), (COST, 1)):
        study = uncertain(entry, profile=waves, settlement=shallow, run=few)
        alone = run_study(study, tmp_path / f"{own} alone", RunOptions(processes=1))
        with monkeypatch.context() as patch:
            patch.setattr(together, "WORTHWHILE", 1)
            options = RunOptions(processes=2)
            both = run_study(
                study, tmp_path / f"{own} both", options, lambda *line: told.append(line)
            )
        assert everything(both.folder) == everything(alone.folder)
        assert both.remarks == alone.remarks
        assert ("Parameter sets", own, own) in told


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
