"""The command karamelo-py and its subcommands."""

from __future__ import annotations

import argparse
import sys
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path

from karamelo_py import __version__
from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError, nearest, render_message

ERROR = 1
INTERRUPTED = 130  # as a shell reports a program that SIGINT ended

USAGE = """\
karamelo-py SCRIPT [options]           run a script
karamelo-py check SCRIPT [options]     read and build a scene, print what it needs, run nothing
karamelo-py styles [FAMILY]            list commands and styles, and where they come from
karamelo-py help [FAMILY] STYLE        explain a command or style
karamelo-py bench [WORKLOAD ...]       measure the speed of this machine on known scenes
karamelo-py sweep SCRIPT -var A=1,2    run a family of variants, and put them into one table
karamelo-py chart TABLE                draw a table of runs: what accuracy costs
karamelo-py advise SCRIPT -target E    find the cheapest variant that is accurate enough
karamelo-py stability SCRIPT           map where a method is stable
"""
OPTIONS = """
options:
  -var NAME VALUE    (or -v) set a variable; the script's own assignment of it then yields
  --threads N        threads to use (default: all cores where the scene is large enough)
  --quiet            write warnings and errors only
  --debug            show the traceback of an error
"""
RUN = f"""\
karamelo-py SCRIPT [options]
karamelo-py run SCRIPT [options]       where a script is called check, styles, help or bench

Runs a script. The log goes to the terminal and to log.mpm; files are written to the current folder.
{OPTIONS}"""
CHECK = f"""\
karamelo-py check SCRIPT [options]

Reads a script, builds its scene, and prints what its first run needs: points and nodes, memory,
the first time step and the stable one, the stages of a step. Mistakes further down are found, too.
Nothing runs, and nothing is written.
{OPTIONS}"""
STYLES = """\
karamelo-py styles [FAMILY]

Lists commands and styles, all or those of a family (fix, compute, region, ...), with the packages
they come from.
"""

STUDIES = ("sweep", "chart", "advise", "stability")
RUN_COMMANDS = "add run(n), run_time(T), run_until(...) or run_while(...)"


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    arguments = list(sys.argv[1:] if argv is None else argv)
    debug = "--debug" in arguments
    try:
        return _dispatch(arguments)
    except ScriptError as error:
        if debug:
            traceback.print_exc()
        _complain(error.render())
    except KeyboardInterrupt:
        _complain(render_message("error", "interrupted"))
        return INTERRUPTED
    except MemoryError:
        if debug:
            traceback.print_exc()
        hint = "a coarser grid, fewer points per cell, or precision(single)"
        _complain(render_message("error", "the scene does not fit into memory", hint=hint))
    except BrokenPipeError:
        # Whoever read our output has gone; what was written stays.
        sys.stderr.close()
        return ERROR
    except Exception as error:  # A fault of ours or of a plug-in: no traceback unless asked for.
        if debug:
            traceback.print_exc()
        _complain(
            render_message(
                "error",
                f"internal error: {type(error).__name__}: {error}",
                hint="run again with --debug to see where, and please report it",
            )
        )
    return ERROR


def _complain(text: str) -> None:
    sys.stdout.flush()
    print(text, file=sys.stderr, flush=True)


def _dispatch(arguments: list[str]) -> int:
    if not arguments or arguments[0] in ("-h", "--help"):
        version = "  --version          print the version\n"
        title = f"karamelo-py {__version__}: the material point method"
        print(f"{title}\n\n{USAGE}{OPTIONS}{version}", end="")
        return 0
    if arguments[0] == "--version":
        print(f"karamelo-py {__version__}")
        return 0
    if arguments[0] in STUDIES:
        return _study(arguments)
    commands: dict[str, Callable[[list[str]], int]] = {
        "run": _run,
        "check": _check,
        "styles": _styles,
        "help": _help,
        "bench": _bench,
    }
    if arguments[0] in commands:
        if any(word in ("-h", "--help") for word in arguments[1:]):
            print(_explanation(arguments[0]), end="")
            return 0
        return commands[arguments[0]](arguments[1:])
    close = nearest(arguments[0], [*commands, *STUDIES])
    if close and len(arguments) > 1 and not Path(arguments[0]).exists():
        raise ScriptError(
            f"there is no file {arguments[0]} and no such subcommand",
            expected="a script, or one of " + ", ".join([*commands, *STUDIES]),
            hint=f"did you mean 'karamelo-py {close}'?",
        )
    return _run(arguments)


def _explanation(subcommand: str) -> str:
    """What a subcommand does, and how it is called."""
    if subcommand == "help":
        from karamelo_py.app.catalogue import HELP

        return HELP
    if subcommand == "bench":
        from karamelo_py.app.bench.command import explanation

        return explanation()
    return {"run": RUN, "check": CHECK, "styles": STYLES}[subcommand]


class CommandLine(argparse.ArgumentParser):
    """A command line whose errors are messages in our own form."""

    def error(self, message: str):
        usage = self.format_usage().strip() if self.prog.split()[1:] else USAGE.rstrip()
        raise ScriptError(message, expected=usage)


def _script_parser() -> CommandLine:
    parser = CommandLine(prog="karamelo-py", add_help=False, allow_abbrev=False)
    parser.add_argument("script", nargs="?")
    parser.add_argument("-i", "-in", dest="input")
    parser.add_argument("-var", "--var", "-v", nargs=2, action="append", default=[])
    parser.add_argument("--threads", type=threads_option)
    parser.add_argument("--quiet", action="store_true")
    parser.add_argument("--debug", action="store_true")
    parser.add_argument("--version", action="store_true")
    parser.add_argument("-h", "--help", action="store_true")
    return parser


def threads_option(text: str) -> int | None:
    """The value of --threads: a number, or None for auto."""
    if text == "auto":
        return None
    if not text.isdigit() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of threads (1, 2, ... or auto)")
    return int(text)


def _run(arguments: list[str], *, checking: bool = False) -> int:
    options = _script_parser().parse_args(arguments)
    if options.help or options.version:
        return _dispatch(["--help" if options.help else "--version"])
    script = options.input or options.script
    if script is None:
        raise ScriptError("no script is named", expected="karamelo-py SCRIPT")
    from karamelo_py.language.interpreter import Interpreter
    from karamelo_py.output.console import Console
    from karamelo_py.run.runner import Interrupted
    from karamelo_py.scene.hub import Hub

    hub = Hub(Console(quiet=options.quiet))
    hub.settings.threads = options.threads
    hub.settings.debug = options.debug
    hub.checking = checking
    interpreter = Interpreter(hub, presets=dict(options.var))
    hub.interpreter = interpreter
    try:
        interpreter.run_file(script)
    except Interrupted:
        _complain("interrupted: the log and the dumps are complete up to here")
        return INTERRUPTED
    if not hub.rehearsed:
        _tell_of_no_run(hub, script)
    return 0


def _tell_of_no_run(hub: Hub, script: str) -> None:
    """A script of calculations needs no run; one that makes a scene may have forgotten it."""
    message = f"{script} runs nothing: there is no run command in it"
    if hub.checking:
        if hub.solids:
            from karamelo_py.run.report import report

            report(hub)
        hub.console.say(render_message("note", message, hint=RUN_COMMANDS))
    elif hub.domain is not None or not hub.interpreter.variables:
        hub.place = None
        hub.warn(message, hint=RUN_COMMANDS)


def _check(arguments: list[str]) -> int:
    return _run(arguments, checking=True)


def _styles(arguments: list[str]) -> int:
    from karamelo_py.app.catalogue import print_styles

    return print_styles(arguments)


def _help(arguments: list[str]) -> int:
    if len(arguments) == 1 and arguments[0] in STUDIES:
        return _study([*arguments, "--help"])
    if arguments in (["check"], ["styles"], ["help"], ["bench"]):
        print(_explanation(arguments[0]), end="")
        return 0
    from karamelo_py.app.catalogue import print_help

    return print_help(arguments)


def _bench(arguments: list[str]) -> int:
    from karamelo_py.app.bench.command import main as bench

    return bench(arguments)


def _study(arguments: list[str]) -> int:
    from karamelo_py.app.studies import add_parsers

    parser = CommandLine(prog="karamelo-py", allow_abbrev=False)
    add_parsers(parser.add_subparsers(parser_class=CommandLine))
    try:
        options = parser.parse_args(arguments)
    except SystemExit:  # Help is shown.
        return 0
    return options.act(options)


if __name__ == "__main__":
    sys.exit(main())
