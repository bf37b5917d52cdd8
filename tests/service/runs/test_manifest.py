"""The manifest of a folder: what `push` sends, in which order, with which parameters; wrong manifests are refused."""

import json
from pathlib import Path

import pytest

from models.rig.simulated_runs import RunKind
from service.runs import manifest


class TestManifest:
    def entry(self, **more: object) -> dict[str, object]:
        return {"file": "a.csv", "kind": RunKind.STATIONARY_STRIBECK.value, "cycles": 500} | more

    def write(self, folder: Path, content: object) -> None:
        (folder / "a.csv").write_text("torque_nm\n1\n", encoding="utf-8")
        (folder / manifest.MANIFEST).write_text(json.dumps(content), encoding="utf-8")

    def test_says_beside_a_record_what_its_channels_do_not(self, tmp_path: Path) -> None:
        self.write(tmp_path, [self.entry(run_id="r1", map="torque_nm:Mz")])
        (tmp_path / "b.json").write_text('{"cycles": 100}', encoding="utf-8")
        (tmp_path / "c.TDMS").write_bytes(b"TDSm")
        runs = manifest.find([tmp_path])
        parameters = {"kind": "stationary_stribeck", "cycles": "500.0", "run_id": "r1", "map": "torque_nm:Mz"}
        assert [(run.path.name, run.parameters) for run in runs] == [
            ("b.json", None),
            ("a.csv", parameters | {"filename": "a.csv"}),
        ]
        assert manifest.find([tmp_path / "a.csv"]) == [runs[1]]
        assert manifest.find([tmp_path / "c.TDMS"])[0].parameters is None
        assert [path.name for path in manifest.unlisted([tmp_path])] == ["c.TDMS"]

    def test_finds_inspections_in_their_folder_among_the_runs_by_cycles(self, tmp_path: Path) -> None:
        (tmp_path / "inspections").mkdir()
        for name, cycles in (("a.json", 0), ("b.json", 200), ("inspections/c.json", 100)):
            (tmp_path / name).write_text(f'{{"cycles": {cycles}}}', encoding="utf-8")
        found = [(file.path.name, file.is_inspection) for file in manifest.find([tmp_path])]
        assert found == [("a.json", False), ("c.json", True), ("b.json", False)]
        for alone in (tmp_path / "inspections", tmp_path / "inspections" / "c.json"):
            assert [(file.path.name, file.is_inspection) for file in manifest.find([alone])] == [("c.json", True)]
        (tmp_path / "inspections" / "link.json").symlink_to(Path(__file__))
        with pytest.raises(ValueError, match="lies outside the folder"):
            manifest.find([tmp_path])

    @pytest.mark.parametrize(
        ("content", "rule"),
        [
            ({"file": "a.csv"}, "must hold a list"),
            (["a.csv"], "must have the fields file, kind, cycles"),
            ([{"file": "a.csv", "kind": "x"}], "must have the fields file, kind, cycles"),
            ([{"file": "a.csv", "kind": "x", "cycles": 0, "speed": 1}], "may have run_id"),
            ([{"file": "a.csv", "kind": "x", "cycles": -1}], "cycles must be a number of 0 or more, got -1"),
            ([{"file": "a.csv", "kind": "x", "cycles": True}], "cycles must be a number"),
            ([{"file": "a.csv", "kind": "x", "cycles": float("nan")}], "cycles must be a number"),
            ([{"file": "a.csv", "kind": 7, "cycles": 0}], "kind must be a text, got 7"),
        ],
    )
    def test_refuses_what_is_none(self, tmp_path: Path, content: object, rule: str) -> None:
        self.write(tmp_path, content)
        with pytest.raises(ValueError, match=rule):
            manifest.find([tmp_path])

    def test_refuses_a_file_that_is_not_there(self, tmp_path: Path) -> None:
        self.write(tmp_path, [self.entry(file="other.csv")])
        with pytest.raises(FileNotFoundError, match=r"runs\.json\[0\]: .*other\.csv does not exist"):
            manifest.find([tmp_path])

    @pytest.mark.parametrize("name", ["../secret.csv", "{outside}/secret.csv", "link.csv", "linked/secret.csv"])
    def test_names_no_file_outside_its_folder(self, tmp_path: Path, name: str) -> None:
        folder, outside = tmp_path / "recordings", tmp_path / "outside"
        for path in (folder, outside):
            path.mkdir()
        for path in (outside / "secret.csv", tmp_path / "secret.csv"):
            path.write_text("torque_nm\n1\n", encoding="utf-8")
        (folder / "link.csv").symlink_to(outside / "secret.csv")
        (folder / "linked").symlink_to(outside)
        self.write(folder, [self.entry(file=name.format(outside=outside))])
        for pushed in (folder, folder / "a.csv"):
            with pytest.raises(ValueError, match=r"runs\.json\[0\]: .* lies outside the folder"):
                manifest.find([pushed])

    @pytest.mark.parametrize("name", ["b.json", "clutch.json"])
    def test_no_body_is_a_link_out_of_the_folder(self, tmp_path: Path, name: str) -> None:
        folder = tmp_path / "recordings"
        folder.mkdir()
        (tmp_path / "secret.json").write_text("{}", encoding="utf-8")
        (folder / name).symlink_to(tmp_path / "secret.json")
        with pytest.raises(ValueError, match="lies outside the folder"):
            manifest.find([folder])

    def test_files_and_links_below_the_folder_are_sent(self, tmp_path: Path) -> None:
        folder = tmp_path / "recordings"
        (folder / "day-1").mkdir(parents=True)
        (folder / "day-1" / "b.csv").write_text("torque_nm\n1\n", encoding="utf-8")
        (folder / "c.csv").symlink_to(folder / "day-1" / "b.csv")
        (tmp_path / "by-another-name").symlink_to(folder)
        entries = [self.entry(), self.entry(file="day-1/b.csv"), self.entry(file="c.csv")]
        self.write(folder, entries)
        for pushed in (folder, tmp_path / "by-another-name"):
            assert [run.path.name for run in manifest.find([pushed])] == ["a.csv", "b.csv", "c.csv"]

    def test_records_that_no_manifest_lists_come_by_the_numbers_in_their_names(self, tmp_path: Path) -> None:
        for name in ("run-10000.csv", "run-2000.csv", "run-0.csv"):
            (tmp_path / name).write_text("torque_nm\n1\n", encoding="utf-8")
        assert [path.name for path in manifest.unlisted([tmp_path])] == ["run-0.csv", "run-2000.csv", "run-10000.csv"]
