"""The command karamelo-py and its subcommands."""

from __future__ import annotations

import argparse
import gc
import os
import re
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from difflib import SequenceMatcher
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from karamelo_py import __version__
from karamelo_py.app import launch
from karamelo_py.app.leaving import SIGNALLED, leaving_at_once
from karamelo_py.app.options import (
    LIVE,
    VARIABLE,
    add_variables,
    make_folder,
    positive,
    threads_option,
)
from karamelo_py.output import record
from karamelo_py.run.mpi.comm import MpiComm, launched
from karamelo_py.scene.comm import ENDING, handled_signals
from karamelo_py.script.errors import ScriptError, meant, nearest, render_message, table

if TYPE_CHECKING:  # slow imports, only for type checking
    from karamelo_py.scene.hub import Hub

RUN = "The log goes to the terminal and to log.mpm; files are written to the current folder."
CHECK = """\
Prints what its first run needs: points and nodes, memory, the first time step and the stable one,
the stages of a step. Mistakes further down are found, too. Nothing runs, and nothing is written."""
HELP = """
karamelo-py help COMMAND         explain a command: karamelo-py help solid
karamelo-py help STYLE           explain a style: karamelo-py help body_force
karamelo-py help FAMILY STYLE    if a name has several meanings:
                                 karamelo-py help fix kinetic_energy
karamelo-py help WORD            find a style by a word: karamelo-py help contact
karamelo-py styles [FAMILY]      list commands and styles"""
USAGE = """\
karamelo-py SCRIPT [-var NAME VALUE] [--threads N] [--ranks N] [--gpu]
                          [-log FILE] [-record FILE] [-out FOLDER] [-restart FILE] [--live]
                          [--trust-geometries] [--quiet] [--debug]
       karamelo-py COMMAND ..."""
RESTART = ("-restart", "--restart")
RUN_COMMANDS = "add run(n), run_time(T), run_until(...) or run_while(...)"


def main(argv: Sequence[str] | None = None) -> int:
    arguments = list(sys.argv[1:] if argv is None else argv)
    launch.keep_to_oneself()
    # Batch systems send these signals. If there are several processes, mpiexec handles them.
    unhandled = [number for number in ENDING if signal.getsignal(number) == signal.SIG_DFL]
    with handled_signals(_end, () if launched()[0] > 1 else unhandled):
        status, text = launch.outcome_of(
            lambda: _dispatch(arguments), debugging="--debug" in arguments
        )
    if text:
        _complain(text)
    return status


def _end(number: int, _: object) -> NoReturn:
    os.write(2, f"error: ended by {signal.Signals(number).name}\n".encode())
    os._exit(SIGNALLED + number)


def _complain(text: str) -> None:
    sys.stdout.flush()
    print(text, file=sys.stderr, flush=True)


# Subcommands imported on demand; each has DESCRIPTION, add_options(parser) and run(options).
ELSEWHERE = {
    "bench": ("karamelo_py.app.bench.command", "Measure the speed of this machine."),
    "view": ("karamelo_py.app.view", "Draw pictures or a movie of dumps."),
    "plot": ("karamelo_py.app.plot", "Draw curves of a log."),
    "sweep": ("karamelo_py.app.studies.sweep", "Run a script with many values of its variables."),
    "chart": ("karamelo_py.app.studies.chart", "Draw the table of a sweep: error against cost."),
    "advise": ("karamelo_py.app.studies.advise", "Find the cheapest set-up within an error."),
    "fit": ("karamelo_py.app.studies.fit", "Find the values of variables that match measurements."),
    "find": ("karamelo_py.app.studies.find", "Find the value at which a condition changes."),
    "sensitivity": ("karamelo_py.app.studies.sensitivity", "Find which variables matter."),
    "stability": ("karamelo_py.app.studies.stability", "Map where a method is stable."),
    "atlas": ("karamelo_py.app.studies.atlas", "Make all charts of a list of studies."),
}
OPTIONS = ("gpu", "ranks", "live", "threads")
COMMANDS = ("run", "check", "styles", "help", *ELSEWHERE)


def _dispatch(arguments: list[str]) -> int:
    try:
        os.getcwd()
    except FileNotFoundError:
        raise ScriptError(
            "the current folder no longer exists", hint="cd into a folder that exists"
        ) from None
    arguments = arguments or ["-h"]
    first = arguments[0]
    if first not in (*COMMANDS, "-h", "--help", "--version"):
        close = meant(first, COMMANDS, "karamelo-py {}")
        alone = len(arguments) == 1 and "." in first
        if (close or first in OPTIONS) and not alone and not Path(first).exists():
            raise ScriptError(
                f"there is no file {first} and no such subcommand",
                expected="a script, or one of " + ", ".join(COMMANDS),
                hint=close or f"did you mean 'karamelo-py SCRIPT --{first}'?",
            )
        arguments = ["run", *arguments]
    if first == "help" and len(arguments) == 2 and arguments[1] in COMMANDS[1:]:
        arguments = [arguments[1], "-h"]
    elif first == "help" and len(arguments) == 2 and arguments[1].lstrip("-").lower() in OPTIONS:
        arguments = ["run", "-h"]
    elif arguments == ["help"]:
        arguments = ["help", "-h"]
    if arguments[0] in ("run", "check"):
        arguments = _one_file(arguments)
    parser, commands = _parser(arguments[0])
    choice = commands.choices.get(arguments[0])
    options_of = choice.options() if choice else []
    arguments = _values_below_zero(arguments, options_of)
    begins = [
        w for w in arguments if w[:1] == "-" != w[1:2] and w[1:].isalpha() and w not in options_of
    ]
    for word in begins:
        if any(o.startswith(word) or (len(o) > 2 and word.startswith(o)) for o in options_of):
            raise _surplus(arguments, [word], choice)
    try:
        options, surplus = parser.parse_known_args(arguments)
    except SystemExit:
        return 0
    except ScriptError as error:
        # A missing option may be misspelt.
        options_of = commands.choices[arguments[0]].options()
        odd = [word for word in arguments if word[:1] == "-" and word not in options_of]
        hints = (f"{word}: {near}" for word in odd if (near := meant(word, options_of)))
        error.hint = error.hint or next(hints, None)
        raise
    if surplus:
        raise _surplus(arguments, surplus, commands.choices.get(arguments[0], parser))
    size, rank = launched()
    pooled = "on" in options and options.on == "mpi"
    if size > 1 and not pooled and arguments[0] != "run" and (rank or arguments[0] != "check"):
        if rank == 0:
            raise ScriptError(
                f"karamelo-py {arguments[0]} runs in one process, but {size} were started",
                hint=f"without mpiexec: karamelo-py {arguments[0]} ...",
            )
        return launch.ERROR
    options.command_line = arguments
    if options.act is not _run:  # `_run` itself calls `begun`, after its imports
        begun()
    with ExitStack() as options.ends:
        return options.act(options)


def begun() -> None:
    if not gc.isenabled():
        gc.freeze()
        gc.enable()


def _one_file(arguments: list[str]) -> list[str]:
    """If a shell has expanded the name after -restart to several files, retain the last one."""
    chosen: list[str] = []
    for word in arguments:
        before = chosen[-1] if chosen else ""
        if before in VARIABLE and (assignment := re.fullmatch(r"([^\W\d]\w*)=(.+)", word)):
            raise ScriptError(
                f"-var takes a name and a value, with a blank between them, not {word}",
                hint=f"-var {assignment[1]} {assignment[2]}",
            )
        unnumbered = [re.sub(r"\d+", "#", name) for name in (word, before)]
        if chosen[-2:-1] and chosen[-2] in RESTART and unnumbered[0] == unnumbered[1]:
            chosen[-1] = max(word, before, key=lambda name: [*map(int, re.findall(r"\d+", name))])
        else:
            chosen.append(word)
    return chosen


def _values_below_zero(arguments: list[str], options: list[str]) -> list[str]:
    """Put a blank before values such as -1e6, which argparse would read as options."""

    def is_value(k: int) -> bool:
        if re.match(r"-\.?\d", arguments[k]):
            return not re.fullmatch(r"-\d+|-\d*\.\d+", arguments[k])
        return (
            k > 1
            and arguments[k][:1] == "-" != arguments[k][1:2]
            and arguments[k - 2] in VARIABLE
            and "=" not in arguments[k - 1]
            and arguments[k].partition("=")[0] not in options
        )

    return [f" {word}" if is_value(k) else word for k, word in enumerate(arguments)]


def _surplus(arguments: list[str], words: list[str], parser: CommandLine) -> ScriptError:
    command = arguments[0]
    option = next((word.partition("=")[0] for word in words if word.startswith("-")), None)
    if option == "--ranks":
        return ScriptError(
            f"karamelo-py {command} runs in one process",
            expected="--ranks for a script (karamelo-py SCRIPT --ranks N), check or bench",
        )
    close = nearest(option, parser.options()) if option else None
    alias = table()["options"].get((option or "").rstrip("0123456789"))
    if alias in parser.options():
        close = alias + " N" * (alias != "--only")
    close = close or next(
        (word_ for word_ in parser.options() if word_.startswith(option or "?")), None
    )
    hint = f"did you mean {close}?" if close else None
    value = words[words.index(option) + 1 :] if option in words else []
    if (
        alias is None
        and not (close and SequenceMatcher(None, option, close).ratio() > 0.75)
        and option
        and option[1:].isidentifier()
        and value
        and re.fullmatch(r"[-+.\deE]+", value[0])
    ):
        hint = f"-var {option[1:]} {value[0]} sets a variable"
    elif not option and VARIABLE[0] in arguments and "-jobs" in parser.options():
        hint = f"-var NAME={words[0]}, in one word"
    return ScriptError(
        f"there is no option {option}" if option else f"unexpected word: {words[0]}",
        expected=USAGE if command == "run" else parser.plain_usage(),
        hint=hint,
    )


class CommandLine(argparse.ArgumentParser):
    def __init__(self, **options: Any):
        usual = {"formatter_class": argparse.RawDescriptionHelpFormatter, "allow_abbrev": False}
        super().__init__(**(usual | options))

    def options(self) -> list[str]:
        return [word for action in self._actions for word in action.option_strings]

    def plain_usage(self) -> str:
        return self.format_usage().removeprefix("usage: ").rstrip()

    def error(self, message: str) -> NoReturn:
        expected = self.plain_usage()
        if of := re.match(r"argument (-\S+): ", message):
            spelled = of[1].split("/")
            action = next(a for a in self._actions if spelled[0] in a.option_strings)
            values = action.metavar or action.dest.upper() if action.nargs != 0 else ()
            expected = " ".join([spelled[0], *([values] if isinstance(values, str) else values)])
            message = f"{spelled[0]}: {message[of.end() :]}"
        raise ScriptError(message, expected=expected)


def _parser(command: str) -> tuple[CommandLine, Any]:
    parser = CommandLine(
        prog="karamelo-py",
        usage=USAGE,
        description=f"karamelo-py {__version__}: the material point method",
        epilog="karamelo-py COMMAND -h explains a command. karamelo-py SCRIPT is short for\n"
        "karamelo-py run SCRIPT.",
    )
    parser.add_argument("--version", action="version", version=f"karamelo-py {__version__}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", prog="karamelo-py")

    def add(name: str, act: Callable | None, summary: str, text: str = "") -> CommandLine:
        added = commands.add_parser(name, help=summary, description=f"{summary}\n{text}".strip())
        added.add_argument("--debug", action="store_true", help="show the traceback of an error")
        added.set_defaults(act=act)
        return added

    for name, summary, text in (
        ("run", "Run a script.", RUN), ("check", "Check a script: memory, step, mistakes.", CHECK)
    ):  # fmt: skip
        script = add(name, _run, summary, text)
        script.set_defaults(checking=name == "check", restart=None)
        script.add_argument("script", metavar="SCRIPT", nargs="?")
        script.add_argument("-i", "-in", dest="input", metavar="SCRIPT", help=argparse.SUPPRESS)
        add_variables(script, "set a variable, overriding the script")
        script.add_argument(
            "--threads", type=threads_option, metavar="N",
            help="threads to use (default: all cores where the scene is large enough)",
        )  # fmt: skip
        script.add_argument(
            "--ranks", type=positive, metavar="N", default=None,
            help="number of processes (MPI); --threads is per process",
        )  # fmt: skip
        script.add_argument(
            "--gpu", action="store_true",
            help="compute the steps on an NVIDIA GPU (pip install '.[gpu]')",
        )  # fmt: skip
        script.add_argument(
            "--trust-geometries", action="store_true",
            help="let .geo files run programs and write files",
        )  # fmt: skip
        script.add_argument(
            "-log", "--log", type=Path, metavar="FILE",
            help="file of the log (default: log.mpm); .csv separates columns by commas",
        )  # fmt: skip
        script.add_argument(
            "-record", "--record", type=Path, metavar="FILE",
            help="file of the facts of the runs (default: run.json)",
        )  # fmt: skip
        script.add_argument(
            "-out", "--out", type=Path, metavar="FOLDER",
            help="folder of all files, made if it is missing (default: the current one)",
        )  # fmt: skip
        if name == "run":
            script.add_argument(
                *RESTART, type=Path, metavar="FILE",
                help="continue from a file that restart(...) wrote",
            )  # fmt: skip
            script.add_argument(
                *LIVE, action="store_true",
                help="show points and curves on a page in a browser, while it runs",
            )  # fmt: skip
        script.add_argument("--quiet", action="store_true", help="write warnings and errors only")
    summary = "List commands and styles, and where they come from."
    styles = add("styles", lambda options: _catalogue().print_styles(options.family), summary)
    styles.add_argument("family", metavar="FAMILY", nargs="*", help="fix, compute, region, ...")
    summary = "Explain a command or a style."
    explain = add("help", _explain, summary, HELP)
    explain.add_argument("words", metavar="WORD", nargs="*")
    for name, (module, summary) in ELSEWHERE.items():
        command_module = import_module(module) if name == command else None
        added = add(name, command_module and command_module.run, summary)
        if command_module:
            added.description = command_module.DESCRIPTION
            command_module.add_options(added)
    return parser, commands


def _explain(options: argparse.Namespace) -> int:
    def manuals() -> dict[str, tuple[str, str]]:
        names = [name for name in ELSEWHERE if name != "bench"]
        texts = {name: _parser(name)[1].choices[name].format_help() for name in names}
        return {name: (ELSEWHERE[name][1], text) for name, text in texts.items()}

    return _catalogue().print_help(options.words, COMMANDS, manuals)


def _catalogue() -> Any:
    return import_module("karamelo_py.app.catalogue")


def _run(options: argparse.Namespace) -> int:
    script = options.input or options.script
    if script is None:
        command = "karamelo-py check" if options.checking else "karamelo-py"
        raise ScriptError("no script is named", expected=f"{command} SCRIPT")
    if options.input and options.script:
        raise ScriptError(f"two scripts: {options.script} and {script}", expected="one script")
    if launched()[0] > 1 and not options.checking:
        with leaving_at_once():  # set before MPI starts
            import_module("karamelo_py.scene.hub")
        return launch.together(
            options.ranks, lambda comm: _carry_out(options, script, comm), debugging=options.debug
        )
    if (options.ranks or 1) > 1 and not options.checking and not options.gpu:
        if options.live:
            raise ScriptError(
                f"a live page shows a run of one process, but this run has {options.ranks}",
                hint="--threads N instead of --ranks, or karamelo-py view --live FOLDER",
            )
        return launch.launch(options.ranks, options.command_line)
    return _carry_out(options, script)


def _carry_out(options: argparse.Namespace, script: str, comm: MpiComm | None = None) -> int:
    with leaving_at_once():
        import numpy as np

        from karamelo_py.language.interpreter import Interpreter
        from karamelo_py.output.console import Console
        from karamelo_py.run.loop import Interrupted
        from karamelo_py.run.lower.card import use_card
        from karamelo_py.scene.hub import Hub
    begun()
    np.seterr(over="ignore", invalid="ignore", divide="ignore")
    hub = Hub(Console(quiet=options.quiet, terminal=launch.has_terminal()))
    hub.settings.threads = options.threads
    hub.settings.ranks = options.ranks or launched()[0]
    if comm is not None:
        launch.share(hub, comm)
    hub.settings.debug = options.debug
    hub.settings.trusts = options.trust_geometries
    hub.checking = options.checking
    if options.gpu:
        use_card(hub)
    _direct(hub, options)
    page = None
    if not options.checking and options.live:
        from karamelo_py.app.live.run import RunPage

        page = RunPage(hub, script)
        hub.console.say(f"live: {page.server.address}")
    presets = dict(options.var)
    if options.restart is not None:
        from karamelo_py.run.checkpoint.restart_file import Restart

        hub.restart = Restart(options.restart, options.out)
        before, presets = presets, hub.restart.presets(presets)
        if taken := [f"{name} = {text}" for name, text in presets.items() if name not in before]:
            hub.console.say(f"{', '.join(taken)} taken from {hub.restart.path}, as -var had it")
    interpreter, restart, finished = Interpreter(hub, presets=presets), hub.restart, False
    interpreter.replay = restart and restart.replay()
    hub.record.of_script(script, presets)
    try:
        interpreter.run_file(script)
        finished = True
        hub.record.end("finished")
    except Interrupted as signal:
        hub.record.end("interrupted")
        _complain("interrupted: the log and the dumps are complete up to here")
        return SIGNALLED + signal.args[0]
    except Exception as error:
        hub.record.end("failed", error)
        raise
    finally:
        hub.output.log.close()
        if page is not None:
            page.end(waits=finished, stopped=not finished)
    if not hub.rehearsed:
        _tell_of_no_run(hub, script)
    elif restart is not None and restart.is_over(hub):
        message = f"{restart.path} holds the end of the last run of {script}: nothing is left to do"
        hint = f"another run command after it, or read_restart({restart.path}) in a separate script"
        hub.console.say(render_message("note", message, hint=hint))
    return 0


def _direct(hub: Hub, options: argparse.Namespace) -> None:
    if options.out is not None:
        if not hub.checking or options.out.exists():
            make_folder(options.out, "-out {}")
        hub.folder = options.out.absolute()
    if options.record is not None:
        hub.record.path = hub.folder / options.record
        hub.record.is_asked_for = True
    elif not hub.checking:
        of = f"{options.log.stem}." if options.log else ""
        hub.record.path = hub.folder / f"{of}{record.NAME}"
    if options.log is not None:
        hub.output.log.file = options.log
        hub.output.log.is_asked_for = True
        folder = hub.output.log.path.parent
        made = folder.is_dir() or (hub.checking and folder == hub.folder)
        if not made or hub.output.log.path.is_dir():
            raise ScriptError(
                f"the log cannot be written to {options.log}",
                expected="the name of a file in a folder that exists",
            )


def _tell_of_no_run(hub: Hub, script: str) -> None:
    message = f"{script} runs nothing: there is no run command in it"
    if hub.checking:
        if hub.solids:
            from karamelo_py.advice.report import report

            report(hub)
        hub.console.say(render_message("note", message, hint=RUN_COMMANDS))
    elif hub.solids and not hub.answered:
        raise ScriptError(message, hint=f"{RUN_COMMANDS}, or quit where it may end")
    elif hub.domain is not None or not hub.interpreter.variables:
        hub.mark = None
        hub.warn(message, hint=RUN_COMMANDS)


if __name__ == "__main__":
    sys.exit(import_module("karamelo_py.app.start").main())
