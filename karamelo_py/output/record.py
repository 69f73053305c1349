"""The record of a script's runs: run.json next to the log (fields: docs/run-record.md).

The banner and the closing table are printed from the record, and studies read it. Numbers that are
not finite are null.
"""

import hashlib
import json
import math
import os
import platform
import time
from collections.abc import Mapping
from contextlib import suppress
from datetime import datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

import karamelo_py
from karamelo_py.output.files import folder_of_discarded, write_whole
from karamelo_py.script.errors import Mark, ScriptError

SCHEMA = 1
NAME = "run.json"
Json = dict[str, Any]


@cache
def _machine() -> Json:
    versions = {"python": platform.python_version(), "karamelo-py": karamelo_py.__version__}
    versions |= {name: version(name) for name in ("numpy", "numba", "llvmlite")}
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "system": f"{platform.system()} {platform.release()}",
        "versions": versions,
    }


def surroundings() -> dict[str, Any]:
    return {"date": datetime.now().astimezone().isoformat(timespec="seconds"), **_machine()}


def processor() -> str:
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.lower().startswith("model name"):
                return line.partition(":")[2].strip()
    return platform.processor() or platform.machine()


class RunRecord:
    def __init__(self) -> None:
        self.path: Path | None = None
        self.is_asked_for = False  # written even if the script ends before its first run
        self.content: Json = {"schema": SCHEMA, "status": "running"}
        self.runs: list[Json] = []
        self.messages: list[Json] = []
        self._written: tuple[str, int] | None = None  # status and number of messages
        self._begun = time.perf_counter()

    def of_script(self, file: str | Path, variables: Mapping[str, str]) -> None:
        of_content = None
        with suppress(OSError):
            if Path(file).is_file():  # a pipe could be read only once
                of_content = hashlib.sha256(Path(file).read_bytes()).hexdigest()
        self.content["script"] = {
            "file": str(file),
            "sha256": of_content,
            "variables": dict(variables),
        }

    @property
    def script(self) -> str:
        return str(self.content.get("script", {}).get("file", "SCRIPT"))

    def begin(self, facts: Mapping[str, object]) -> None:
        self.content["status"] = "running"
        self.runs.append(dict(facts))
        self._write()

    def finish(self, facts: Mapping[str, object]) -> None:
        self.runs[-1].update(facts)
        self._write()

    def warn(
        self, text: str, hint: str | None, mark: Mark | None, code: str = "", cause: str = ""
    ) -> None:
        self._note("warning", text, mark, hint=hint, code=code, cause=cause)

    def end(self, status: str, error: BaseException | None = None) -> None:
        self.content["status"] = status
        if isinstance(error, ScriptError):
            fields = {"code": error.code, "cause": error.cause, "resume": error.resume}
            fields["rendered"] = error.render()
            self._note("error", error.sentence, error.mark, hint=error.hint, **fields)
        elif error is not None:
            self._note("error", f"{type(error).__name__}: {error}", None, code="internal")
        # Python programs call this method after every command; few commands change the record.
        if (self.runs or self.is_asked_for) and self._written != (status, len(self.messages)):
            self._write()

    def _note(self, kind: str, text: str, mark: Mark | None, **optional: str | None) -> None:
        note: Json = {"kind": kind, "text": text}
        if mark is not None:
            note["place"] = {"file": mark.file, "line": mark.line, "column": mark.column}
        self.messages.append(note | {name: of for name, of in optional.items() if of})

    def _write(self) -> None:
        if self.path is None or folder_of_discarded() is not None:
            return
        self._written = self.content["status"], len(self.messages)
        whole = {
            **self.content,
            "wall_s": time.perf_counter() - self._begun,
            "runs": self.runs,
            "messages": self.messages,
            **surroundings(),
        }
        with suppress(ScriptError):  # other output reports such errors, e.g. a full disk
            write_whole(self.path, json.dumps(_finite(whole), indent=1, ensure_ascii=False) + "\n")


def _finite(value: object) -> object:
    if isinstance(value, dict):
        return {name: _finite(of) for name, of in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(of) for of in value]
    if hasattr(value, "item"):
        value = value.item()
    return value if not isinstance(value, float) or math.isfinite(value) else None
