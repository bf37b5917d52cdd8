"""Every store does the same: what is put is there, whole, under its name, until it is deleted."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from storage.blobs import stores
from storage.blobs.stores import BlobStore, fetched, name_of, normal_address, open_store
from storage.engine.errors import DamagedData, MissingBlob, RawStoreUnavailable

DATA = bytes(range(256)) * 3000


@pytest.fixture
def store(raw_address: str) -> BlobStore:
    opened = open_store(raw_address)
    assert opened.mark() is None
    opened.set_mark("ours")
    assert opened.mark() == "ours"
    return opened


def test_what_is_put_is_there_until_it_is_deleted(store: BlobStore) -> None:
    name = name_of(DATA)
    assert not store.exists(name)
    with pytest.raises(MissingBlob, match=name):
        store.get(name)
    before = time.time()
    for _ in range(2):
        store.put(name, DATA)
        assert store.exists(name)
        assert fetched(store, name) == DATA
        ((found, written),) = store.names()
        assert (found, before - 2 <= written <= time.time() + 2) == (name, True)
    store.put(name_of(b""), bytearray())
    assert store.get(name_of(b"")) == b""
    assert {found for found, _ in store.names()} == {name, name_of(b"")}
    for _ in range(2):
        store.delete(name)
        assert [found for found, _ in store.names()] == [name_of(b"")]
    assert store.mark() == "ours"


def test_a_second_put_mends_what_was_damaged_and_is_new(store: BlobStore) -> None:
    name = name_of(DATA)
    store.put(name, DATA[:-1] + b"x")
    with pytest.raises(DamagedData, match=f"the raw record {name} in {store.address} is damaged"):
        fetched(store, name)
    ((_, first),) = store.names()
    time.sleep(1.1)  # S3 counts whole seconds
    store.put(name, DATA)
    ((_, second),) = store.names()
    assert fetched(store, name) == DATA
    assert second > first


@pytest.mark.slow
def test_more_names_than_a_page_of_s3_holds_are_listed(in_bucket: str) -> None:
    store = open_store(in_bucket)
    store.set_mark("ours")
    names = {name_of(bytes([number % 256, number // 256])) for number in range(1001)}
    for name in names:
        store.put(name, b"x")
    assert {name for name, _ in store.names()} == names


def test_a_store_that_is_not_there_is_not_an_empty_one(raw_address: str) -> None:
    never_marked = open_store(raw_address)
    name = name_of(DATA)
    with pytest.raises(RawStoreUnavailable, match="is no store of raw records"):
        never_marked.get(name)
    with pytest.raises(RawStoreUnavailable, match="is no store of raw records"):
        never_marked.exists(name)


def test_a_folder_that_is_not_mounted_is_not_written_to(tmp_path: Path) -> None:
    unmounted = open_store(f"folder://{tmp_path}")
    for use in (lambda: unmounted.put(name_of(DATA), DATA), lambda: list(unmounted.names())):
        with pytest.raises(RawStoreUnavailable, match="Is its disk mounted"):
            use()
    assert list(tmp_path.iterdir()) == []


def test_files_are_their_owners_alone_and_what_was_cut_off_is_listed(in_folder: str) -> None:
    store, root = open_store(in_folder), Path(in_folder.removeprefix("folder://"))
    store.set_mark("ours")
    store.put(name_of(DATA), DATA)
    modes = {path.stat().st_mode & 0o777 for path in root.rglob("*") if path.is_file()}
    assert (modes, root.stat().st_mode & 0o777) == ({0o600}, 0o700)
    (root / "partial" / "tmpx").write_bytes(DATA[:100])
    assert {name for name, _ in store.names()} == {name_of(DATA), "partial/tmpx"}
    store.delete("partial/tmpx")
    assert {name for name, _ in store.names()} == {name_of(DATA)}


def test_a_full_or_read_only_folder_says_so_and_keeps_nothing_half(in_folder: str) -> None:
    store, root = open_store(in_folder), Path(in_folder.removeprefix("folder://"))
    store.set_mark("ours")
    script = (
        "import resource, signal, sys\n"
        "from storage.blobs.stores import open_store\n"
        "from storage.blobs.stores import name_of\n"
        "from storage.engine.errors import RawStoreUnavailable\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        "try:\n"
        "    open_store(sys.argv[1]).put(name_of(bytes(9000)), bytes(9000))\n"
        "except RawStoreUnavailable as error:\n"
        "    print(error)\n"
    )
    ended = subprocess.run([sys.executable, "-c", script, in_folder], capture_output=True, text=True, check=True)
    assert "cannot be used: File too large" in ended.stdout
    assert [path.name for path in root.rglob("*") if path.is_file()] == ["clutchlife-store"]


def test_a_server_that_is_away_is_told_in_a_line_without_secrets(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, in_bucket: str
) -> None:
    wrong = open_store("s3://no-such-bucket")
    for use in (lambda: wrong.put("a", b"x"), lambda: wrong.get("a"), lambda: list(wrong.names())):
        with pytest.raises(RawStoreUnavailable, match="s3://no-such-bucket"):
            use()
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://127.0.0.1:9")
    open_store.cache_clear()
    caplog.clear()
    with pytest.raises(RawStoreUnavailable) as caught:
        open_store(in_bucket).put("a", b"x")
    assert str(caught.value) == f"{in_bucket} cannot be used: it does not answer as a store does"
    assert f"after {stores._RETRIES} retries" in caplog.text, "and after no more"


def test_without_the_client_a_bucket_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stores, "find_spec", lambda _: None)
    open_store.cache_clear()
    with pytest.raises(RawStoreUnavailable, match=r"install clutchlife\[objects\]"):
        open_store("s3://bucket/prefix")


def test_addresses_have_one_form_and_no_secrets() -> None:
    assert normal_address("folder:///data/raw/") == "folder:///data/raw"
    assert normal_address("s3://bucket/") == "s3://bucket"
    assert normal_address("s3://bucket/a/b/") == "s3://bucket/a/b"
    assert normal_address("database") == "database"
    for wrong in ("folder://relative", "s3://id:secret@bucket", "s3://bucket?secret=1", "/data", "ftp://x/y", ""):
        with pytest.raises(ValueError, match="the place of raw records must be") as caught:
            normal_address(wrong)
        assert not wrong or wrong not in str(caught.value)
