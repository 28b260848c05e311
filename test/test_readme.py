"""The READMEs say what the code does."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest
from rclpy.context import Context
from test_layers import FOLDERS

from cassie_bags.studies.sweep.table import all_rows
from cassie_control.config import ControllerConfig
from cassie_msgs.tunables import names
from cassie_sim.camera import PACKAGES

ROOT = Path(__file__).resolve().parents[1]
READMES = [ROOT / "README.md", *sorted(ROOT.glob("[!.]*/README.md")), ROOT / "bags/RESULTS.md"]


LONGEST_SENTENCE = 25
"""Words in a sentence of the first page."""


def commands() -> Iterator[tuple[str, str, str]]:
    """Package, executable and the rest of each command in any README."""
    for readme in READMES:
        yield from commands_in(readme.read_text(encoding="utf-8"))


def commands_in(text: str) -> list[tuple[str, str, str]]:
    """Package, executable and the rest of each command, with the lines that go on with it."""
    text = re.sub(r"\n +(?=\[-)", " ", joined(text))
    return re.findall(r"ros2 run ([a-z]\w+) (\w+)([^\n`#]*)", text)


def joined(text: str) -> str:
    """A text whose lines that end with a backslash are one with the next."""
    return re.sub(r"\s*\\\n\s*", " ", text)


def source_of(package: str, executable: str) -> str:
    """The sources of an executable, with those of modules of its package that it hands over to.

    Methods of the parser, with which commands share options, come along.

    The test fails if the package has none.
    """
    assert package in FOLDERS, f"there is no package {package}"
    listed = (FOLDERS[package] / "executables.py").read_text(encoding="utf-8")
    module = re.search(rf'^{executable} = entry_point\("([\w.]+)"\)', listed, re.MULTILINE)
    assert module, f"{package} has no {executable}"
    folder = FOLDERS[package].parent
    source = (folder / f"{module[1].replace('.', '/')}.py").read_text(encoding="utf-8")
    for parent, name in re.findall(rf"^from ({package}[\w.]*) import (\w+)$", source, re.MULTILINE):
        path = folder / parent.replace(".", "/") / f"{name}.py"
        source += path.read_text(encoding="utf-8") if path.is_file() else ""
    shared = folder / package / "cli" / "arguments.py"
    text = shared.read_text(encoding="utf-8") if shared.is_file() else ""
    for name in set(re.findall(r"parser\.(\w+)\(", source)):
        source += text.partition(f"def {name}(")[2].partition("\n\n")[0]
    return source


def missing_targets(text: str, folder: Path) -> list[str]:
    """Relative links and images of a README in a folder that lead nowhere, headings included."""
    found = re.findall(r"\]\((?!https?:)([^)\s]+)\)", text)
    found += re.findall(r"<img src=\"(?!https?:)([^\"]+)\"", text)
    missing = []
    for target in found:
        name, _, heading = target.partition("#")
        path = folder / name
        if name and heading and path.is_file():
            known = headings(path.read_text(encoding="utf-8"))
        else:
            known = headings(text)
        if not path.exists() or (heading and heading not in known):
            missing.append(target)
    return missing


def headings(text: str) -> list[str]:
    """Names of a README's headings in links, as GitHub makes them."""
    lines = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return [re.sub(r"[^\w -]", "", line.lower()).replace(" ", "-") for line in lines]


def missing_inputs(text: str) -> list[str]:
    """Targets of make, and files of this workspace in command lines, that do not exist."""
    text = joined(text)
    lines = re.findall(r"^ {4}(?! )(.+?)(?:#.*)?$", text, re.MULTILINE)
    code = "\n".join([*lines, *re.findall(r"`(make [^`]+|ros2 run [^`]+)`", text)])
    targets = re.findall(r"^make ([a-z]+)", code, re.MULTILINE)
    known = re.findall(r"^([a-z]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    missing = [f"make {target}" for target in targets if target not in known]
    paths = re.findall(r"(?<![\w/.])((?:bags|\.workspace|test|cassie_\w+)/[\w./-]+)", code)
    made = ("cassie/", "cassie_msgs/srv/", "cassie_msgs/msg/")  # a virtual environment; types
    return missing + [p for p in paths if not p.startswith(made) and not (ROOT / p).exists()]


def sentences(text: str) -> list[str]:
    """Sentences of a README: of its paragraphs, items, headings and cells, without its code."""
    text = re.sub(r"^ {4}.*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)  # of a link its words
    text = re.sub(r"^#.*$", r"\g<0>\n", text, flags=re.MULTILINE)
    parts = re.split(r"\n\s*\n|\n(?=[-|>]|\d+\. )|\|", text)
    found = [re.split(r"(?<=[.!?])[*_]*\s+", " ".join(part.split())) for part in parts]
    return [sentence for part in found for sentence in part if sentence]


def words(sentence: str) -> int:
    """Number of words of a sentence; code in backticks counts as one."""
    return len(re.findall(r"\S*\w\S*", re.sub(r"`[^`]*`", "code", sentence)))


def test_parameter_tables_are_those_of_the_code() -> None:
    check = [sys.executable, ROOT / ".workspace" / "parameter_tables.py", "--check"]
    result = subprocess.run(check, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize("readme", READMES, ids=lambda path: path.parent.name)
def test_links_images_and_inputs_of_readmes_exist(readme: Path) -> None:
    text = readme.read_text(encoding="utf-8")
    assert missing_targets(text, readme.parent) == []
    assert missing_inputs(text) == []


def test_sources_that_the_first_page_names_exist() -> None:
    names = re.findall(r"`((cassie_\w+)/[\w./]+)`", READMES[0].read_text(encoding="utf-8"))
    assert len(names) > 15
    assert [name for name, package in names if not (ROOT / package / name).exists()] == []


def test_the_first_page_has_short_sentences_and_calls_the_robot_it() -> None:
    text = READMES[0].read_text(encoding="utf-8")
    assert [s for s in sentences(text) if words(s) > LONGEST_SENTENCE] == []
    assert re.findall(r"\b(?:she|her|he|his|him)\b", text, re.IGNORECASE) == []
    assert len(text.splitlines()) < 250


def test_the_robot_is_it_everywhere() -> None:
    folders = (*FOLDERS.values(), *(ROOT / name for name in ("test", ".workspace")))
    files = [path for folder in folders for path in folder.rglob("*.py")]
    files += [*READMES, *(ROOT / "bags" / "experiments").glob("*.yaml")]
    this = Path(__file__).resolve()
    wrong = [
        f"{path.relative_to(ROOT)}: {line.strip()}"
        for path in files
        if path.resolve() != this
        for line in path.read_text(encoding="utf-8").splitlines()
        if re.search(r"(?<![a-z])(?:she|her|hers|herself)(?![a-z])", line, re.IGNORECASE)
    ]
    assert len(files) > 300
    assert wrong == []


def test_the_first_page_installs_what_the_build_and_the_camera_ask_for() -> None:
    (line,) = re.findall(r"apt install (git .*)", READMES[0].read_text(encoding="utf-8"))
    asked = set(re.findall(r"python3-\w+", (ROOT / ".workspace/pick_python.sh").read_text()))
    asked |= {"gcc", "g++", "make", *re.findall(r"lib\w+1(?:-[\w-]+)?", PACKAGES)}
    assert asked <= set(line.split())


@pytest.mark.parametrize(
    "text",
    [
        "[there](nowhere.md)",
        "[there](README.md#no-such-heading)",
        "[here](#no-such-heading)",
        "![film](bags/images/nothing.gif)",
        '<img src="bags/images/nothing.png" height="42">',
    ],
)
def test_a_wrong_link_is_found(text: str) -> None:
    assert len(missing_targets(f"# A heading\n{text}", ROOT)) == 1
    right = "# A heading\n[a](#a-heading) ![b](bags/images/walk.gif) [c](README.md#stop) [d](test)"
    assert missing_targets(right, ROOT) == []


@pytest.mark.parametrize(
    "text",
    [
        "    make nothing",
        "try `make nothing`",
        "    ros2 run cassie_bags experiment bags/experiments/nothing.yaml",
        "`ros2 run cassie_bags experiment bags/experiments/nothing.yaml`",
        "    ros2 run cassie_bags experiment \\\n        --set @bags/nothing.yaml",
    ],
)
def test_a_wrong_target_or_file_of_a_command_is_found(text: str) -> None:
    assert len(missing_inputs(text)) == 1
    assert missing_inputs("    make demo    # builds\n    cat bags/experiments/demo.yaml") == []


def test_a_wrong_command_is_found() -> None:
    for text in ("ros2 run cassie_bags nothing", "ros2 run nothing record --all"):
        ((package, executable, _),) = commands_in(text)
        with pytest.raises(AssertionError):
            source_of(package, executable)


def test_a_long_sentence_is_found() -> None:
    text = "# Title\n\nShort: one.\n- an item\n    a b c d\n\n| cell | " + "word " * 26 + "|"
    assert [words(s) for s in sentences(text)] == [1, 2, 2, 1, 26]


def test_modules_that_readmes_name_exist() -> None:
    seen = 0
    for readme in READMES:
        for name in re.findall(r"`(cassie_\w+(?:\.\w+)+)`", readme.read_text(encoding="utf-8")):
            parent, _, last = name.rpartition(".")
            found = find_spec(parent) and (find_spec(name) or hasattr(import_module(parent), last))
            assert found, f"{readme} names {name}"
            seen += 1
    assert seen > 10


def test_commands_that_readmes_name_have_these_options() -> None:
    seen = 0
    for package, executable, rest in commands():
        source = source_of(package, executable)
        for option in re.findall(r"(?<=[ \[])--[a-z][a-z-]*", rest.partition("--ros-args")[0]):
            named = re.search(rf'"(-\w )?{option}( --[a-z-]+)?"', source)
            assert named, f"ros2 run {package} {executable} has no {option}"
            seen += 1
    assert seen > 40


@pytest.mark.parametrize(
    "words", [f"{e} {rest}" for _, e, rest in commands() if "--ros-args" in rest]
)
def test_ros_arguments_that_readmes_show_can_be_read(words: str) -> None:
    context = Context()
    context.init([word for word in shlex.split(words) if word != "&"])
    context.shutdown()


def test_parameters_that_readmes_name_exist() -> None:
    known = set(names(ControllerConfig))
    groups = "|".join({name.partition(".")[0] for name in known if "." in name})
    known |= {name.rpartition(".")[0] for name in known} | {row.name for row in all_rows()}
    for readme in READMES:
        text = readme.read_text(encoding="utf-8")
        for name in re.findall(rf"[` ]((?:{groups})\.[a-z_.]*[a-z])(?=[`:=])", text):
            assert name in known, f"{readme} names {name}"
