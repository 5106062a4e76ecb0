"""A cache is a courtesy: what cannot be kept or read there is computed, and said."""

import os
from dataclasses import replace

import numpy as np
import pytest
import toy

from mcsettle.errors import InputError
from mcsettle.railway.traffic import Service
from mcsettle.step_a import transfer_cache
from mcsettle.step_a.fem25d.cache import read_arrays, write_arrays
from mcsettle.step_a.transfer_file import load, save
from mcsettle.storage import files, npz
from mcsettle.storage.shared_cache import kept


def test_files_of_a_cache_follow_the_umask(tmp_path):
    old = os.umask(0o022)
    try:
        save(toy.transfer(), tmp_path / "transfer.npz")
        write_arrays(tmp_path / "section-1.npz", {"x": np.ones(3)})
    finally:
        os.umask(old)
    assert {p.stat().st_mode & 0o777 for p in tmp_path.iterdir()} == {0o644}


@pytest.mark.parametrize("number", [13, 28, 30])
def test_a_cache_that_cannot_be_written_loses_a_courtesy(tmp_path, monkeypatch, number):
    def refuse(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(files.os, "replace", refuse)
    path = tmp_path / "section-1.npz"
    with pytest.warns(
        RuntimeWarning, match=rf"section-1\.npz' cannot be kept \({os.strerror(number)}"
    ):
        write_arrays(path, {"x": np.ones(3)})
    with pytest.warns(RuntimeWarning, match="cannot be kept"):
        assert not kept(path, lambda: save(toy.transfer(), path))
    assert list(tmp_path.iterdir()) == []


def test_a_good_file_of_somebody_else_is_used(tmp_path, monkeypatch):
    """Touching it fails, and that is all."""
    monkeypatch.setenv("MCSETTLE_CACHE", str(tmp_path))
    service = Service(toy.TRAINS["passenger"], toy.SPEEDS["passenger"], 1)
    given = toy.response(), service, toy.transfer().wavenumbers, 1.4e9
    first = transfer_cache.cached_transfer(*given)
    monkeypatch.setattr(transfer_cache, "precompute", None)

    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(transfer_cache.os, "utime", refuse)
    again = transfer_cache.cached_transfer(*given)
    assert again.digest == first.digest


def test_a_link_in_a_cache_is_not_followed(tmp_path):
    save(toy.transfer(), tmp_path / "there.npz")
    write_arrays(tmp_path / "section-1.npz", {"x": np.ones(3)})
    before = (tmp_path / "there.npz").read_bytes()
    (tmp_path / "transfer.npz").symlink_to(tmp_path / "there.npz")
    (tmp_path / "section-2.npz").symlink_to(tmp_path / "section-1.npz")
    with pytest.raises(InputError, match="is a link"):
        load(tmp_path / "transfer.npz")
    with pytest.warns(RuntimeWarning, match="is a link"):
        assert read_arrays(tmp_path / "section-2.npz", "thing", dict) is None
    save(replace(toy.transfer(), digest="other"), tmp_path / "transfer.npz")  # replaces the link
    assert (tmp_path / "there.npz").read_bytes() == before


def test_a_cache_file_under_another_name_is_not_used(tmp_path):
    write_arrays(tmp_path / "section-1.npz", {"x": np.ones(3)})
    (tmp_path / "section-2.npz").write_bytes((tmp_path / "section-1.npz").read_bytes())
    with pytest.warns(RuntimeWarning, match="it is another file under this name"):
        assert read_arrays(tmp_path / "section-2.npz", "thing", dict) is None


@pytest.mark.parametrize(
    "name",
    ["wavenumbers", "quasi_static", "dynamic", "force", "track_compliance", "geostatic"],
)
def test_arrays_of_other_shapes_are_noticed(tmp_path, name):
    """With a right checksum, as another version would write it."""
    transfer = toy.transfer()
    wrong = replace(transfer, **{name: getattr(transfer, name)[..., :-1]})
    save(wrong, tmp_path / "transfer.npz")
    with pytest.raises(InputError, match=r"is damaged \('.*has the shape"):
        load(tmp_path / "transfer.npz")


def test_an_archive_that_unpacks_to_too_much_is_refused_by_its_size(tmp_path, monkeypatch):
    """Before NumPy makes an array of it."""
    path = tmp_path / "section-1.npz"
    write_arrays(path, {"x": np.zeros(1000)})
    npz.refuse_large(path)
    monkeypatch.setattr(npz, "LARGEST", 5000)
    with pytest.raises(ValueError, match="more than any of ours"):
        npz.refuse_large(path)
    with pytest.warns(RuntimeWarning, match="more than any of ours"):
        assert read_arrays(path, "thing", dict) is None
    monkeypatch.setattr(npz, "LARGEST", 10**9)
    monkeypatch.setattr(npz, "MOST_MEMBERS", 2)
    with pytest.raises(ValueError, match="3 arrays"):
        npz.refuse_large(path)
