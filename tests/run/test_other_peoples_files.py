"""Nothing of anybody else's is touched by a run, whatever it is called and wherever a link leads."""

import contextlib
import shutil
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import tomli_w
import toy

from mcsettle.errors import InputError
from mcsettle.railway.irregularity import sample_profiles, to_space, wavenumbers
from mcsettle.railway.spectra import spectrum
from mcsettle.run.close import gather
from mcsettle.run.options import RunOptions
from mcsettle.run.pipeline import run_study, write_study
from mcsettle.run.shards import all_shards
from mcsettle.run.status import refuse_smaller, survey
from mcsettle.storage import store
from mcsettle.storage.location import place
from mcsettle.storage.manifest import visible
from mcsettle.study.extent import extent_of
from mcsettle.study.run_inputs import run_inputs
from mcsettle.study.study import Study, load_study, resolved_toml
from mcsettle.summary.results import read_results

pytestmark = pytest.mark.usefixtures("fresh_cache")
N = 4


def contents(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.fixture(scope="module")
def study():
    return toy.study(run={"realisations": N})


@pytest.fixture(scope="module")
def results(fresh_cache, study, tmp_path_factory):
    return run_study(study, tmp_path_factory.mktemp("own") / "out", RunOptions(shard_size=2)).folder


def test_a_folder_of_something_else_is_refused_before_anything_is_computed(
    study, tmp_path, monkeypatch
):
    from mcsettle.run import pipeline

    monkeypatch.setattr(pipeline, "step_a", None)
    for name in ("study.toml", "history/2023.csv", ".tmp/draft.doc", ".locks/db.json"):
        folder = tmp_path / name.replace("/", "-")
        (folder / name).parent.mkdir(parents=True)
        (folder / name).write_text("precious", encoding="utf-8")
        for out in (folder, str(folder)):
            with pytest.raises(InputError, match="is not empty and holds no results"):
                run_study(study, out)
        assert contents(folder) == {name: b"precious"}


def test_what_a_run_that_was_killed_at_once_has_left_is_gone_on_with(study, results, tmp_path):
    folder = tmp_path / "out"
    shutil.copytree(results / ".locks", folder / ".locks")
    shutil.copytree(results / ".log", folder / ".log")
    run_study(study, folder, RunOptions(shard_size=2))
    assert survey(folder).finished


def test_links_in_a_folder_from_elsewhere_are_refused(results, study, tmp_path):
    precious = tmp_path / "precious"
    precious.mkdir()
    for name in ("thesis.docx", "config.json", "a.part", "a.parquet"):
        (precious / name).write_text("precious", encoding="utf-8")
    before = contents(precious)
    for name in (".tmp", ".locks", ".shards", "effects", "history", "realisations", "summary"):
        folder = tmp_path / f"copy-{name}"
        shutil.copytree(results, folder)
        shutil.rmtree(folder / name, ignore_errors=True)
        (folder / name).symlink_to(precious)
        with contextlib.suppress(InputError):
            survey(folder)
        for use in (gather, lambda f: run_study(study, f)):
            with pytest.raises(InputError, match="is a link"):
                use(folder)
        assert contents(precious) == before


def test_realisations_behind_a_link_are_said_to_be(results, tmp_path):
    folder = tmp_path / "copy"
    shutil.copytree(results, folder)
    (folder / "realisations").rename(tmp_path / "moved")
    (folder / "realisations").symlink_to(tmp_path / "moved")
    with pytest.raises(InputError, match="realisations' is a link"):
        read_results(folder)


# --- inputs ---------------------------------------------------------------------------------------


def with_record(folder: Path, name: str) -> Study:
    """The toy study, in a file of ``folder``, on a measured record of this name."""
    k = wavenumbers(1000.0, 1.0, 100.0)
    x = np.arange(0.0, 1000.0, 0.25)
    level = to_space(sample_profiles(spectrum("fra", 6), k, 1000.0, 5, [0]), k, x)[0]
    frame = pd.DataFrame({"chainage_m": x, "level_mm": 1e3 * level})
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    if name.endswith(".parquet"):
        frame.to_parquet(folder / name)
    else:
        frame.to_csv(folder / name, index=False)
    data = tomllib.loads(resolved_toml(toy.study(run={"realisations": 2})))
    data["profile"] = {"file": name, "sd_mm": 1.03, "record": {"ensemble": "sections"}}
    path = folder / "my.toml"
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    return load_study(path)


NAMES = ["record.parquet", "manifest.json", "study.toml", "data_dictionary.csv", "history/rec.csv",
         "a/b/c/d/e/f/g/h/i/rec.csv", ".shards/rec.csv", "inputs/rec.csv"]  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_a_record_of_any_name_has_a_place_of_its_own(tmp_path, name):
    """Written and read back without the study's folder; what is computed does not matter here."""
    source, folder = tmp_path / "in", tmp_path / "out"
    study = with_record(source, name)
    write_study(place(folder), run_inputs(study), None)
    shutil.rmtree(source)
    assert visible(place(folder)) == [f"inputs/profile.file/{Path(name).name}", "study.toml"]
    again = load_study(folder / "study.toml")
    assert again.digest == study.digest
    assert again.record() is not None
    before = contents(folder)
    write_study(place(folder), run_inputs(again), None)  # `mcsettle run DIR/study.toml --out DIR`
    assert contents(folder) == before


def test_a_run_on_a_parquet_record_ends_and_goes_on_from_its_own_folder(tmp_path):
    study = with_record(tmp_path / "in", "record.parquet")
    folder = run_study(study, tmp_path / "out").folder
    shutil.rmtree(tmp_path / "in")
    before = contents(folder)
    run_study(load_study(folder / "study.toml"), folder)
    assert survey(folder).finished
    assert {k: v for k, v in contents(folder).items() if not k.startswith(".")} == {
        k: v for k, v in before.items() if not k.startswith(".")
    }
    other = run_study(load_study(folder / "study.toml"), tmp_path / "other").folder
    assert store.read(other, "realisations").equals(store.read(folder, "realisations"))


def test_a_file_outside_the_studys_folder_stays_there(tmp_path):
    with_record(tmp_path, "record.csv")
    (tmp_path / "in").mkdir()
    text = (tmp_path / "my.toml").read_text(encoding="utf-8")
    text = text.replace('"record.csv"', '"../record.csv"').replace("files_outside = false\n", "")
    path = tmp_path / "in" / "my.toml"
    path.write_text("files_outside = true\n" + text, encoding="utf-8")
    write_study(place(tmp_path / "out"), run_inputs(load_study(path)), None)
    assert visible(place(tmp_path / "out")) == ["study.toml"]


# --- names of scenarios ---------------------------------------------------------------------------


def renamed(*names: str, **changes) -> Study:
    """The toy study with its two scenarios called so."""
    data = tomllib.loads(resolved_toml(toy.study(run={"realisations": 2}, **changes)))
    data.pop("economics")
    for scenario, name in zip(data["scenarios"], names, strict=True):
        scenario["name"] = name
    return Study.from_mapping(data)


def test_scenarios_of_any_name_are_run_and_resumed(tmp_path):
    """set2 is not a parameter set; a--b and what its file was once called are two."""
    for names in (("set2", "v"), ("a--b", "a-b-90827a2e")):
        study = renamed(*names)
        folder = run_study(study, tmp_path / names[0]).folder
        assert run_study(study, folder, RunOptions(realisations=3)).n_computed == 2
        assert gather(folder).finished
        rows = read_results(folder).realisations
        assert rows.groupby("scenario").size().to_dict() == dict.fromkeys(names, 3)


def test_a_smaller_run_is_refused_by_what_names_say(tmp_path):
    study = renamed("set000009", "00000000-00000099")
    extent = extent_of(study)
    held = {shard.name for shard in all_shards(extent, 2)}
    refuse_smaller(place(tmp_path), held, extent)
    with pytest.raises(InputError, match="holds 2 realisations and 1 are asked for"):
        refuse_smaller(place(tmp_path), held, replace(extent, realisations=1))
