"""Writing a record file without the package that its format needs."""

from pathlib import Path

import numpy as np
import pytest

from service.readers import sandbox
from service.readers.detect import Format
from service.run_files.record_writer import RecordFormat, require_writer, write_record


@pytest.mark.parametrize(("form", "kind"), [(RecordFormat.TDMS, Format.TDMS), (RecordFormat.MDF4, Format.MDF4)])
def test_a_missing_package_is_named_with_its_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: RecordFormat, kind: Format
) -> None:
    module, _, extra = sandbox.READERS[kind]
    monkeypatch.setitem(sandbox.READERS, kind, (module, "no_such_package", extra))
    with pytest.raises(ValueError, match="pip install -e"):
        require_writer(form)
    with pytest.raises(ValueError, match="is not written here"):
        write_record(tmp_path / "a", form, {"torque_nm": np.ones(2)}, {})
    assert list(tmp_path.iterdir()) == []
    require_writer(RecordFormat.CSV)
