"""Files of layered grounds as people have them, and layers too thin for the slabs."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from toy_grounds import LAYERS, WEIGHTS

from mcsettle.errors import InputError
from mcsettle.railway.ground_profiles import (
    Columns,
    Ground,
    merged_layers,
    merging_remark,
    read_grounds,
    slab_materials,
    slabs,
)

ROOT = Path(__file__).resolve().parents[2]


def grounds(folder: Path, layers: str, weights: str, columns: Columns, encoding: str = "utf-8"):
    (folder / "layers.csv").write_bytes(layers.encode(encoding))
    (folder / "weights.csv").write_bytes(weights.encode(encoding))
    return read_grounds(folder / "layers.csv", folder / "weights.csv", columns, ("raise",))


def test_encodings_decimal_commas_and_units_of_the_levels(tmp_path: Path) -> None:
    plain = grounds(tmp_path, LAYERS, WEIGHTS, Columns())
    for encoding in ("utf-8-sig", "utf-16"):
        assert grounds(tmp_path, LAYERS, WEIGHTS, Columns(), encoding) == plain
    german = LAYERS.replace("clay", "Löß")
    with pytest.raises(InputError, match=r"layers.csv: line 4 .*'A1;1.0;Löß;'.*encoding = .cp1252"):
        grounds(tmp_path, german, WEIGHTS, Columns(), "cp1252")
    read = grounds(tmp_path, german, WEIGHTS, Columns(encoding="cp1252"), "cp1252")
    assert read[0].materials == ("fill", "Löß", "sand")
    commas = LAYERS.replace(".", ",")
    with pytest.raises(InputError, match=r"top_level is '3,0'; .*decimal = \","):
        grounds(tmp_path, commas, WEIGHTS, Columns())
    assert grounds(tmp_path, commas, WEIGHTS, Columns(decimal=",")) == plain
    in_dm = grounds(tmp_path, LAYERS, WEIGHTS, Columns(level_unit="dm"))
    np.testing.assert_allclose(in_dm[0].tops, 0.1 * np.array(plain[0].tops))
    with pytest.raises(InputError, match=r'separated by a semicolon: separator = "semicolon"'):
        grounds(tmp_path, LAYERS, WEIGHTS, Columns(separator=","))


def test_all_faults_of_a_file_are_listed_at_once(tmp_path: Path) -> None:
    wrong = LAYERS.replace("A1;1.0", "A1;x").replace("A2;0.5", "A2;9.5").replace("B1;0.5", "B1;nan")
    with pytest.raises(InputError) as caught:
        grounds(tmp_path, wrong, WEIGHTS, Columns())
    for said in ("line 4: top_level is 'x'", "line 12: top_level is 'nan'", "'A2' do not fall"):
        assert said in str(caught.value)
    with pytest.raises(
        InputError, match=r"(?s)2 faults.*'A' add up to 110, not 100.*'B' add up to 90"
    ):
        grounds(tmp_path, LAYERS, WEIGHTS.replace("70", "80").replace("100", "90"), Columns())


def test_a_layer_in_which_no_slab_has_its_middle_is_merged_and_counted() -> None:
    heights = slabs(0.5, 2.0, 1.0, 4.0)
    ground = Ground(
        "g", "s", 1.0, (0.0, 0.8, 1.2, 3.0, 3.3), ("fill", "peat", "clay", "silt", "sand")
    )
    materials = slab_materials(ground, heights)
    assert materials == ("fill", "fill", "clay", "clay", "clay", "sand", "sand")
    merged = merged_layers(ground, heights)
    into = [(m.material, m.into) for m in merged]
    assert into == [("peat", ("fill", "clay")), ("silt", ("sand",))]
    np.testing.assert_allclose([(m.top, m.height) for m in merged], [(0.8, 0.4), (3.0, 0.3)])
    # A layer is counted exactly where no slab is made of it.
    assert {m.material for m in merged} == set(ground.materials) - set(materials)
    deep = replace(ground, tops=(0.0, 9.0), materials=("fill", "rock"))
    assert merged_layers(deep, heights) == ()  # below the slabs the half-space goes on
    said = merging_remark([ground, deep], heights)
    assert said.startswith(
        "1 of 2 grounds have layers too thin for the slabs (2 layers of 0.3 to 0.4 m)"
    )
    assert merging_remark([deep], heights) == ""


def test_the_dutch_grounds_say_what_their_slabs_merge() -> None:
    from mcsettle.study.study import load_study

    study = load_study(ROOT / "studies" / "prorail.toml")
    (remark,) = [w for w in study.warnings if w.startswith("grounds:")]
    assert (
        "97 of 433 grounds have layers too thin for the slabs (106 layers of 0.25 to 1.5 m)"
        in remark
    )
    thin = [merged_layers(ground, slabs(0.5, 6.0, 2.0, 12.0)) for ground in study.grounds()]
    assert sum(any(m.height < 0.51 for m in layers) for layers in thin) == 57
