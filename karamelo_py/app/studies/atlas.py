"""karamelo-py atlas: regenerates the pictures and tables of a page."""

import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import time
import tomllib
from argparse import ArgumentParser, Namespace
from dataclasses import dataclass, field
from pathlib import Path

import karamelo_py
from karamelo_py.app.plot import read_text
from karamelo_py.app.studies import records
from karamelo_py.app.studies.case import PROGRAM, environment
from karamelo_py.app.studies.variables import names
from karamelo_py.output.console import duration
from karamelo_py.output.files import read_json, reported, write_whole
from karamelo_py.output.record import surroundings
from karamelo_py.script.errors import ScriptError, plural, unknown

DESCRIPTION = """\
Makes the pictures and tables of an atlas again: a file (TOML) that lists them with the commands of
karamelo-py that make each. Finished entries are not repeated: the same command continues an
interrupted atlas.

  karamelo-py atlas docs/atlas.toml -list
  karamelo-py atlas docs/atlas.toml -only failures
  karamelo-py atlas docs/atlas.toml -page docs/atlas.md

An entry has a name, a text, and commands that run in a separate folder; {inputs} is the folder
`inputs` of the atlas, and other words in braces are values of the entry, or its smaller values:

  [[entry]]
  name = "orders/bar"
  text = "How errors of the vibrating bar fall."
  commands = [
    "sweep {inputs}/in.vibrating_bar -var refine={sizes} -record err_history -o bar.csv",
    "chart bar.csv -accuracy err_history -x refine -o bar.png",
  ]
  whole = {sizes = "0.5,1,2,4"}
  small = {sizes = "0.2,0.4"}

Runs that do not end well are named, and the exit status is 1, unless the entry has ends_early =
true, to show runs that fail."""
RECORD = "entry.json"
TRANSCRIPT = "said.txt"
PICTURES = (".png", ".svg")


@dataclass
class Entry:
    name: str  # name of the folder; the part before a slash is the group
    text: str = ""
    commands: list[str] = field(default_factory=list)  # commands without the word karamelo-py
    whole: dict[str, str] = field(default_factory=dict)  # values of words in braces
    small: dict[str, str] = field(default_factory=dict)
    interpreted: bool = False  # True if its scenes are too small to be worth compiling
    page: bool = True
    ends_early: bool = False  # True if it shows runs that do not end well

    @property
    def group(self) -> str:
        return self.name.partition("/")[0]

    def lines(self, inputs: str, *, small: bool) -> list[str]:
        words = {"inputs": inputs, **self.whole, **(self.small if small else {})}
        try:
            return [command.format(**words) for command in self.commands]
        except (KeyError, IndexError, ValueError) as error:
            raise ScriptError(
                f"entry '{self.name}': no value for {error}",
                expected="whole = {" + str(error).strip("'") + ' = "..."}',
            ) from None


def read(path: Path) -> tuple[list[Entry], Path]:
    try:
        content = tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise ScriptError(f"{path} is not TOML: {error}") from None
    entries = []
    for table in content.get("entry", []):
        try:
            entries.append(Entry(**table))
        except TypeError as error:
            raise ScriptError(
                f"{path}: an entry with {str(error).split(') ')[-1]}",
                expected="name, text, commands, whole, small, interpreted, page, ends_early",
            ) from None
    if not entries:
        raise ScriptError(f"{path} has no entries", expected="[[entry]] with name and commands")
    return entries, (path.parent / content.get("inputs", "inputs")).resolve()


def add_options(parser: ArgumentParser) -> None:
    parser.add_argument("atlas", type=Path, help="the list of entries, such as docs/atlas.toml")
    parser.add_argument("-only", default="", metavar="NAMES", help="entries or groups: NAME,NAME")
    parser.add_argument("-small", action="store_true", help="use the smaller values of the entries")
    parser.add_argument("-again", action="store_true", help="repeat finished entries")
    parser.add_argument("-list", action="store_true", help="list the entries, run nothing")
    parser.add_argument(
        "-o", type=Path, default=Path("atlas"), metavar="FOLDER", help="folder for the runs (atlas)"
    )
    parser.add_argument(
        "-page", type=Path, help="page to write; its pictures go to _static/atlas next to it"
    )


def run(options: Namespace) -> int:
    entries, inputs = read(options.atlas)
    asked = names(options.only)
    names_of_all = [*{entry.group for entry in entries}, *(entry.name for entry in entries)]
    for name in asked:
        if name not in names_of_all:
            raise unknown(f"-only {name}: no such entry (-list shows all)", name, names_of_all)
    chosen = [e for e in entries if not asked or e.name in asked or e.group in asked]
    if options.list:
        for entry in chosen:
            first, *_ = re.split(r"(?<=[.:])\s", " ".join(entry.text.split()))
            print(f"{entry.name:<32} {first}".rstrip())
        return 0
    folder = options.o / "small" if options.small else options.o
    failed: dict[str, str] = {}
    for k, entry in enumerate(chosen, 1):
        label = f"{k} of {len(chosen)}: {entry.name}"
        begun = time.perf_counter()
        folder_of_entry = folder / entry.name
        state = make(entry, folder_of_entry, inputs, small=options.small, again=options.again)
        bad, count = ended(folder_of_entry)
        if state == "failed":
            failed[entry.name] = ""
        elif bad:
            state += f", {len(bad)} of {plural(count, 'run')} ended early"
            if not entry.ends_early:
                more = f" and {len(bad) - 3} more" if len(bad) > 3 else ""
                failed[entry.name] = f" ({', '.join(bad[:3])}{more})"
        print(f"{label} {state} ({duration(time.perf_counter() - begun)})", flush=True)
    if options.page and not options.small:
        write_page(options.page, entries, folder, inputs)
    if failed:
        named = ", ".join(name + runs for name, runs in failed.items())
        print(f"failed: {named}; see above and the tables, the other entries are done")
    return 1 if failed else 0


def ended(folder: Path) -> tuple[list[str], int]:
    """Return the names of runs that did not end well, and the number of all runs."""
    tables = [records.read(path) for path in sorted(folder.glob("*.csv"))]
    runs = [row for table in tables for row in table if "status" in row and "folder" in row]
    return [Path(row["folder"]).name for row in runs if row["status"] != "done"], len(runs)


def make(entry: Entry, folder: Path, inputs: Path, *, small: bool, again: bool) -> str:
    lines = entry.lines(str(inputs), small=small)
    key = key_of(lines)
    record = folder / RECORD
    stored = read_json(record)
    if not again and stored.get("key") == key and "printed" in stored:
        return "known"
    with reported(folder):
        folder.mkdir(parents=True, exist_ok=True)
    record.unlink(missing_ok=True)
    for path in [path for suffix in (*PICTURES, ".csv") for path in folder.glob(f"*{suffix}")]:
        path.unlink()
    more = {"NUMBA_DISABLE_JIT": "1"} if entry.interpreted else {}
    transcript, printed = [], ""
    for line in lines:
        done = subprocess.run(
            [*PROGRAM, *shlex.split(line)],
            cwd=folder, env={**environment(), **more}, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, text=True, encoding="utf-8", check=False,
        )  # fmt: skip
        printed = done.stdout
        transcript.append(f"$ karamelo-py {line}\n{printed}")
        write_whole(folder / TRANSCRIPT, "\n".join(transcript))
        if done.returncode and not (line.startswith("sweep") and ended(folder)[0]):
            print(printed, end="")
            return "failed"
    made = {"key": key, "commands": lines, "printed": printed, **surroundings()}
    write_whole(record, json.dumps(made, indent=1))
    return "done"


def key_of(lines: list[str]) -> str:
    parts = [karamelo_py.__version__, *lines]
    for word in {word for line in lines for word in shlex.split(line)}:
        if os.path.isabs(word) and Path(word).is_file():
            parts.append(Path(word).read_text(encoding="utf-8", errors="replace"))
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def write_page(page: Path, entries: list[Entry], folder: Path, inputs: Path) -> None:
    before = page.read_text(encoding="utf-8") if page.exists() else ""
    before_by_name = {
        section.partition("\n")[0]: section.rstrip()
        for section in re.split("^##+ ", before, flags=re.M)
    }
    shown = page.parent / "_static" / "atlas"
    parts = [
        "# Atlas of accuracy and stability",
        "Written by `karamelo-py atlas`, by the commands below pictures.",
    ]
    group = ""
    for entry in entries:
        done = (folder / entry.name / RECORD).exists()
        section = part_of_page(entry, folder / entry.name, shown, inputs) if done else None
        section = section or before_by_name.get(entry.name)
        if not section or not entry.page:
            continue
        if entry.group != group:
            group = entry.group
            parts.append(f"## {group.replace('_', ' ').capitalize()}")
        parts.append(f"### {section}")
    write_whole(page, "\n\n".join(parts) + "\n")
    print(f"written: {page}; pictures are in {shown}")


def part_of_page(entry: Entry, folder: Path, shown: Path, inputs: Path) -> str:
    parts = [entry.name, entry.text]
    title = re.split(r"[.:](?:\s|$)", " ".join(entry.text.split()))[0] or entry.name
    for path in sorted(path for path in folder.iterdir() if path.suffix in PICTURES):
        target = shown / entry.name / path.name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
        parts.append(f"![{title}](_static/atlas/{entry.name}/{path.name})")
    made = read_json(folder / RECORD)
    printed = [line.rstrip() for line in made["printed"].rstrip().splitlines()]
    text = "\n".join([*(f"$ karamelo-py {line}" for line in made["commands"]), *printed])
    version = made.get("versions", {}).get("karamelo-py", karamelo_py.__version__)
    with_what = [f"karamelo-py {version}", made.get("processor"), made.get("date", "")[:10]]
    made_with = "*" + ", ".join(filter(None, with_what)) + "*"
    return "\n\n".join([*parts, f"```text\n{text.replace(str(inputs), 'inputs')}\n```", made_with])
