"""The examples for larger installations hold together: what one part refers to is there, and its commands are ours."""

import hashlib
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import pytest
import typer
import yaml

from service.cli.main import app
from tests.architecture.source import ROOT

DOCKER = ROOT / "docker"
COMPOSE = sorted(DOCKER.glob("compose*.yaml"))
MANIFESTS = sorted((DOCKER / "kubernetes").glob("*.yaml"))
CREATED = re.compile(r"create (secret generic|configmap) (\S+)((?:\s+\\?\n?\s*--from-\S+)+)")


def documents() -> list[dict[str, Any]]:
    """All objects of the manifests."""
    return [each for path in MANIFESTS for each in yaml.safe_load_all(path.read_text(encoding="utf-8"))]


def pods() -> Iterator[tuple[str, dict[str, Any], dict[str, Any]]]:
    """The name, the object's and the pod's specification of everything that runs."""
    for each in documents():
        if each["kind"] in ("Deployment", "StatefulSet"):
            yield each["metadata"]["name"], each["spec"], each["spec"]["template"]["spec"]
        elif each["kind"] == "CronJob":
            inner = each["spec"]["jobTemplate"]["spec"]
            yield each["metadata"]["name"], each["spec"], inner["template"]["spec"]


def made_by_hand() -> dict[tuple[str, str], set[str]]:
    """(kind, name) -> keys of the secrets and maps that the README has its reader make."""
    text = (DOCKER / "kubernetes" / "README.md").read_text(encoding="utf-8")
    made = {}
    for kind, name, given in CREATED.findall(text):
        sources = [part.split("=")[0] for part in re.findall(r"--from-(?:literal|file)=(\S+)", given)]
        made[kind.split()[0], name] = {Path(source).name for source in sources}
    return made


def check_command(words: list[str]) -> None:
    """Raise where it is none of our commands, or has an option that the command has not."""
    program, *rest = map(str, words)
    if program == "dask":
        (command,) = (each.load() for each in entry_points(group="dask_cli", name=rest.pop(0)))
    else:
        command = typer.main.get_command(app)
        while inner := getattr(command, "commands", None):
            command = inner[rest.pop(0)]
    known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    assert {word for word in rest if word.startswith("--")} <= known, words


def commands() -> Iterator[list[str]]:
    """Everything that the examples have our image run."""
    for path in COMPOSE:
        for service in yaml.safe_load(path.read_text(encoding="utf-8"))["services"].values():
            if service["image"].startswith("clutchlife:") and "command" in service:
                yield service["command"]
    for _, _, pod in pods():
        yield from (each["command"] for each in pod["containers"] if each["image"].startswith("clutchlife:"))


def test_the_image_runs_commands_that_there_are() -> None:
    seen = set()
    for words in commands():
        if words[:2] == ["sh", "-c"]:
            words = re.findall(r"clutchlife [\w -]+", words[2])[0].split()
        check_command(words)
        seen.add(" ".join(words[:2]))
    assert seen == {"clutchlife serve", "clutchlife raw", "dask scheduler", "dask worker"}
    with pytest.raises(KeyError):
        check_command(["clutchlife", "server"])
    with pytest.raises(AssertionError):
        check_command(["clutchlife", "serve", "--raws"])


@pytest.mark.parametrize("path", COMPOSE, ids=lambda path: path.name)
def test_compose_refers_to_what_is_there(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    whole = yaml.safe_load(text)
    services = whole["services"]
    for name, service in services.items():
        for volume in service.get("volumes", ()):
            source = volume.split(":")[0]
            if source.startswith("."):
                assert (path.parent / source).exists(), (name, source)
            else:
                assert source in whole["volumes"], (name, source)
        assert set(service.get("secrets", ())) <= set(whole.get("secrets", {})), name
        assert set(service.get("depends_on", ())) <= set(services), name
        assert ":" in service["image"], f"{name} names no version"
        if "build" in service:
            build = service["build"]
            assert (path.parent / build["context"] / build["dockerfile"]).is_file()
            requirements = build.get("args", {}).get("REQUIREMENTS", "docker/requirements.txt")
            assert (path.parent / build["context"] / requirements).is_file()
            allowed = (DOCKER / "Dockerfile.dockerignore").read_text(encoding="utf-8").splitlines()
            assert f"!{requirements}" in allowed
    hosts = {host for host in re.findall(r"(?:http|tcp)://([a-z][a-z-]+):\d+", text) if host != "localhost"}
    assert hosts <= set(services)


def test_manifests_refer_to_what_is_there() -> None:
    services = {each["metadata"]["name"]: each["spec"] for each in documents() if each["kind"] == "Service"}
    made = made_by_hand()
    labels = {}
    for name, spec, pod in pods():
        volumes = {each["name"] for each in pod.get("volumes", ())}
        volumes |= {each["metadata"]["name"] for each in spec.get("volumeClaimTemplates", ())}
        ports = set()
        for container in pod["containers"]:
            assert {each["name"] for each in container.get("volumeMounts", ())} <= volumes, name
            assert ":" in container["image"]
            ports |= {each["containerPort"] for each in container.get("ports", ())}
            for variable in container.get("env", ()):
                wanted = variable.get("valueFrom", {}).get("secretKeyRef")
                if wanted:
                    assert wanted["key"] in made["secret", wanted["name"]], (name, variable)
                for host in re.findall(r"://(?:[^@/]*@)?([a-z][a-z-]+):\d+", str(variable.get("value", ""))):
                    assert host in services, (name, host)
            for host in re.findall(r"tcp://([a-z-]+):", str(container.get("command", ""))):
                assert host in services, (name, host)
        for volume in pod.get("volumes", ()):
            if "configMap" in volume:
                assert ("configmap", volume["configMap"]["name"]) in made, (name, volume)
            if "secret" in volume:
                assert ("secret", volume["secret"]["secretName"]) in made, (name, volume)
        if "template" in spec:
            assert spec["selector"]["matchLabels"] == spec["template"]["metadata"]["labels"]
            labels[spec["template"]["metadata"]["labels"]["app"]] = ports
        if "serviceName" in spec:
            assert spec["serviceName"] in services
    for name, spec in services.items():
        assert {each["port"] for each in spec["ports"]} <= labels[spec["selector"]["app"]], name
    assert {each["metadata"]["namespace"] for each in documents()} == {"clutchlife"}


def test_files_that_are_read_by_hand_are_there() -> None:
    text = (DOCKER / "kubernetes" / "README.md").read_text(encoding="utf-8")
    paths = re.findall(r"--from-file=(?:\S+=)?(\S+)", text)
    assert len(paths) == 3
    assert all((DOCKER.parent / path).exists() for path in paths)


def test_services_are_told_of_the_database_the_store_and_how_to_reach_it() -> None:
    """By the settings' own names; and raw records go to the bucket that the store makes."""
    compose = yaml.safe_load((DOCKER / "compose.scale.yaml").read_text(encoding="utf-8"))["services"]
    clutch = next(pod["containers"][0] for name, _, pod in pods() if name == "clutchlife")
    assert {each["name"] for each in clutch["env"]} == set(compose["clutchlife"]["environment"])
    told = compose["clutchlife"]["environment"]
    assert told["CLUTCHLIFE_RAW"].split("/")[2] == compose["objects"]["environment"]["GARAGE_DEFAULT_BUCKET"]
    assert f'"{told["AWS_REGION"]}"' in (DOCKER / "scale" / "garage.toml").read_text()


# --- What filterpy declares for its plots, and no part of the product imports, is installed for the tests alone.

LOCKS = sorted(
    path
    for pattern in ("docker/requirements*.txt", "docs/*.txt", "tests/requirements-*.txt")
    for path in ROOT.glob(pattern)
)
UNUSED = ("matplotlib", "contourpy", "cycler", "fonttools", "kiwisolver", "pillow")


@pytest.mark.parametrize("lock", LOCKS, ids=lambda path: path.name)
def test_no_lock_installs_what_draws_plots(lock: Path) -> None:
    lines = lock.read_text(encoding="utf-8").splitlines()
    assert any("==" in line for line in lines), "nothing is locked"
    assert [line for line in lines if line.startswith(tuple(f"{name}==" for name in UNUSED))] == []


def test_the_oldest_releases_were_tried() -> None:
    """`make lowest` notes which lock it has passed on; another asks for another run of it."""
    tried = (ROOT / "tests" / "lowest.tried").read_text(encoding="utf-8").split()[0]
    lock = (ROOT / "tests" / "requirements-lowest.txt").read_bytes()
    assert tried == hashlib.sha256(lock).hexdigest(), "run make lowest"


def test_the_unscented_filter_is_imported_without_them() -> None:
    blocked = f"import sys; sys.modules.update(dict.fromkeys({(*UNUSED, 'PIL')!r})); import models.tracking.filters.ukf"
    subprocess.run([sys.executable, "-c", blocked], cwd=ROOT, check=True)
