"""python -m comparisons.defaults [CASE ...]: run scenes with defaults, write docs/defaults.md.

Cases that are not named keep what the page said about them before.
"""

import argparse
import tempfile
from math import log, nan
from pathlib import Path

from comparisons import defaults

PAGE = Path(__file__).parent.parent.parent / "docs" / "defaults.md"
HEAD = """# What the defaults do

This table compares scenes that have exact answers with the program's own choices of step, scheme
and averaging. `python -m comparisons.defaults` writes it. Materials and fixes are always the
script's.

| column | meaning |
|---|---|
| error | relative to the exact number; where that is 0, the number itself |
| order in h | how fast the error falls with smaller cells; "exact" means an error below 0.1 % |
| at half the step | the error with half the time step |
| auto | the error with [`method(auto)`](choose.md#chosen-by-the-program) |
| warnings | the warnings of the program; an error above 5 % needs one, or 1 % if easy |

| scene | quantity | exact | default | error | order in h | at half the step | auto | warnings |
|---|---|---|---|---|---|---|---|---|
"""


def order(case: defaults.Case, found: list[float]) -> str:
    """Order in h from the two finest runs."""
    errors = [abs(case.error(value)) for value in found[-2:]]
    if len(errors) < 2 or errors[-1] != errors[-1]:
        return ""
    if errors[-1] < 1e-3:
        return "exact"
    fine, coarse = case.refine[-1], case.refine[-2]
    return f"{log(max(errors[0], 1e-12) / errors[1]) / log(fine / coarse):.1f}"


def number(case: defaults.Case, result) -> float:
    """The number of a run; NaN where it failed."""
    try:
        return case.measure(result)
    except (OSError, IndexError, ValueError):
        return nan


def row(name: str, folder: Path) -> tuple[str, bool]:
    """The row of a case, and whether it is right or told."""
    case = defaults.case(name)
    results = [defaults.run(name, folder, refine) for refine in case.refine]
    found = [number(case, result) for result in results]
    half = ""
    if case.half_step:
        dt = defaults.step_of(results[-1]) / 2
        halved = defaults.run(name, folder, case.refine[-1], dt)
        half = f"{100 * case.error(number(case, halved)):+.2f} %"
    auto = 100 * case.error(number(case, defaults.run(name, folder, case.refine[-1], auto=True)))
    said = defaults.said(results[-1])
    error = case.error(found[-1])
    told = any(case.advice in line for line in said) if case.advice else False
    good = abs(error) <= case.within or told
    words = "; ".join(dict.fromkeys(said)).replace("|", "\\|") or ("" if good else "**nothing**")
    cells = (
        f"`in.{name}`",
        f"{case.quantity} ({case.source})",
        f"{case.exact:.4g}",
        f"{found[-1]:.4g}",
        f"{100 * error:+.2f} %",
        order(case, found),
        half,
        f"{auto:+.2f} %",
        words,
    )
    return f"| {' | '.join(cells)} |", good


def main() -> None:
    """Run cases, write the page; exit 1 where one is wrong and silent."""
    parser = argparse.ArgumentParser(prog="python -m comparisons.defaults", description=__doc__)
    parser.add_argument("cases", nargs="*", metavar="CASE", help="all, if none is named")
    options = parser.parse_args()
    if unknown := set(options.cases) - set(defaults.names()):
        parser.error(f"unknown case '{unknown.pop()}'; there are {', '.join(defaults.names())}")
    text = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    rows = {
        line.split("`")[1].removeprefix("in."): line
        for line in text.splitlines()
        if line.startswith("| `")
    }
    silent = []
    with tempfile.TemporaryDirectory() as folder:
        for name in options.cases or defaults.names():
            rows[name], good = row(name, Path(folder))
            print(rows[name], flush=True)
            silent += [] if good else [name]
            kept = [rows[key] for key in sorted(rows) if key in defaults.names()]
            PAGE.write_text(HEAD + "\n".join(kept) + "\n", encoding="utf-8")
    raise SystemExit(f"wrong and silent: {', '.join(silent)}" if silent else 0)


if __name__ == "__main__":
    main()
