"""The frame of the experiments: the table by hand, seeds measured once, what may go wrong, the command as typed."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.experiment import Experiment, Measured, Quantity, lines_of, markdown, measure_seeds
from topoloc import plugins
from topoloc.cli.main import run
from topoloc.errors import InputError


def measure(seed: int) -> Measured:
    """Two columns; the second knows one quantity of even seeds only."""
    return {
        "thesis": {"share": seed / 100.0, "metres": float(seed)},
        "ours": {"share": 0.5 if seed % 2 == 0 else float("nan")},
    }


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    figure.add_subplot().plot([one["thesis"]["metres"] for one in measured])


def never(seed: int) -> Measured:
    raise AssertionError(f"seed {seed} was measured again")


TOY = Experiment(
    name="toy",
    title="A toy",
    source="0.0",
    about="Nothing is done.",
    measure=measure,
    quantities=(
        Quantity("share", "a share", "12 %", "Table 0", 2, percent=True),
        Quantity("metres", "a length [m]", "-", "ours", 1),
    ),
    draw=draw,
    tell=lambda measured: f"{len(measured)} seeds told",
)


def test_table_by_hand() -> None:
    text = markdown(TOY, [measure(seed) for seed in (10, 11, 12)])
    assert text.splitlines() == [
        "| | published | where | thesis | ours |",
        "|---|---|---|---|---|",
        "| a share | 12 % | Table 0 | 11 % ± 1 % (10 % to 12 %) | 50 % ± 0 % (50 % to 50 %) |",
        "| a length [m] | - | ours | 11.0 ± 1.0 (10.0 to 12.0) | - |",
    ]


def test_one_seed_has_no_spread() -> None:
    assert "| 10 % (10 % to 10 %) |" in markdown(TOY, [measure(10)])


def test_missing_values_keep_the_place_of_their_seed() -> None:
    line = next(line for line in lines_of(TOY, [measure(s) for s in (10, 11)]) if line.column == "ours")
    np.testing.assert_array_equal(line.values, [0.5, np.nan])


def test_each_seed_is_measured_once_and_kept(tmp_path: Path) -> None:
    first = list(measure_seeds(TOY, [10, 11], tmp_path, 1))
    again = Experiment(**{**TOY.__dict__, "measure": never})
    second = list(measure_seeds(again, [10, 11], tmp_path, 1))
    assert str(first) == str(second)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["10.json", "11.json"]


def test_seeds_come_in_their_order_when_some_were_there(tmp_path: Path) -> None:
    list(measure_seeds(TOY, [11], tmp_path, 1))
    assert [one["thesis"]["metres"] for one in measure_seeds(TOY, [10, 11, 12], tmp_path, 1)] == [10.0, 11.0, 12.0]


@pytest.mark.parametrize("text", ["no json", "[]", "{}"])
def test_a_file_that_is_no_measurement(text: str, tmp_path: Path) -> None:
    (tmp_path / "10.json").write_text(text)
    with pytest.raises(InputError, match=r"10\.json.*no measurement.*delete it"):
        list(measure_seeds(TOY, [10], tmp_path, 1))


@pytest.mark.parametrize(("key", "value"), [("topoloc", "0.0"), ("seed", 9), ("experiment", "game"), ("code", "other")])
def test_a_measurement_of_something_else(key: str, value: str | int, tmp_path: Path) -> None:
    list(measure_seeds(TOY, [10], tmp_path, 1))
    path = tmp_path / "10.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), key: value}))
    with pytest.raises(InputError, match=rf"10\.json.*another {key} \({value}, not .*delete it"):
        list(measure_seeds(TOY, [10], tmp_path, 1))


class TestCommand:
    @pytest.fixture(autouse=True)
    def toy(self, monkeypatch: pytest.MonkeyPatch) -> None:
        load = plugins.load
        monkeypatch.setattr(
            plugins,
            "load",
            lambda group, name: TOY if (group, name) == (plugins.EXPERIMENTS, "toy") else load(group, name),
        )

    def test_writes_table_numbers_and_picture(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        out = tmp_path / "out"
        assert run(["reproduce", "toy", "--seeds", "2", "--jobs", "1", "--out", str(out)]) == 0
        told = capsys.readouterr().out
        assert "A toy" in told and "12 %" in told and "2 seeds told" in told
        table = (out / "toy" / "table.md").read_text()
        assert "| a length [m] | - | ours | 10.5 ± 0.7 (10.0 to 11.0) | - |" in table and "2 seeds told" in table
        header, *rows = (out / "toy" / "table.csv").read_text().splitlines()
        assert header == "key,column,published,seed 10,seed 11"
        assert rows[0] == "share,thesis,12 %,0.1,0.11"
        assert (out / "toy" / "figure.png").stat().st_size > 1000

    def test_goes_on_where_it_was(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        out = tmp_path / "out"
        words = ["reproduce", "toy", "--jobs", "1"]
        assert run([*words, "--seeds", "1", "--out", str(out)]) == 0
        before = (out / "toy" / "seeds" / "10.json").stat().st_mtime_ns
        assert run([*words, "--seeds", "2", "--resume", str(out)]) == 0
        assert (out / "toy" / "seeds" / "10.json").stat().st_mtime_ns == before
        assert "seed 11" in (out / "toy" / "table.csv").read_text()

    @pytest.mark.parametrize(
        ("words", "says"),
        [
            (["toy", "--out", "{0}"], "exists already.*--resume"),
            (["toy", "--resume", "{0}/none"], "no such folder"),
            (["toy", "--resume", "{0}"], "holds no experiment"),
            (["toy", "--jobs", "0", "--out", "{0}/a"], "--jobs is 0"),
            (["toy", "--out", "{0}/a", "--resume", "{0}"], "give one of them"),
            (["toys", "--out", "{0}/a"], "'toys'.*old-panoramas"),
        ],
    )
    def test_mistakes_are_one_line(
        self, words: list[str], says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        (tmp_path / "kept").write_text("kept")
        assert run(["reproduce", *(word.format(tmp_path) for word in words)]) == 2
        (line,) = capsys.readouterr().err.strip().splitlines()
        assert re.search(says, line)
        assert [path.name for path in tmp_path.iterdir()] == ["kept"]

    def test_without_a_name_it_lists_all(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["reproduce"]) == 0
        told = capsys.readouterr().out
        for name in plugins.names(plugins.EXPERIMENTS):
            assert name in told


def test_every_experiment_is_whole() -> None:
    for name in plugins.names(plugins.EXPERIMENTS):
        experiment: Experiment = plugins.load(plugins.EXPERIMENTS, name)
        assert experiment.name == name
        assert experiment.title and experiment.source and experiment.about.endswith(".")
        keys = [quantity.key for quantity in experiment.quantities]
        assert len(keys) == len(set(keys)) > 0
        assert all(quantity.published and quantity.where for quantity in experiment.quantities)
