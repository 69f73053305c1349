"""Random variables of a study, and samples of their values."""

import re
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from karamelo_py.app.options import positive
from karamelo_py.app.studies.variables import holds
from karamelo_py.scene.tables import read_table
from karamelo_py.script.errors import ScriptError, unknown
from karamelo_py.script.terms import number_of

KINDS = {
    "uniform": "uniform(low, high)", "loguniform": "loguniform(low, high)",
    "normal": "normal(mean, deviation)", "lognormal": "lognormal(mean, deviation)",
    "triangular": "triangular(low, mode, high)",
}  # fmt: skip
RULES = {
    "uniform": "low < high", "loguniform": "0 < low && low < high", "normal": "deviation > 0",
    "lognormal": "mean > 0 && deviation > 0",
    "triangular": "low <= mode && mode <= high && low < high",
}  # fmt: skip
SEQUENCES = ("latin", "sobol", "halton")
CALL = re.compile(r"([^\W\d]\w*)\((.*)\)")


class Random(NamedTuple):
    name: str
    text: str  # distribution as the user wrote it
    law: Any  # distribution of scipy.stats


def needs_scipy(word: str) -> None:
    if find_spec("scipy") is None:
        hint = "pip install '.[implicit]' in the folder of karamelo-py"
        raise ScriptError(f"karamelo-py {word} needs SciPy", hint=hint)


def require_power_of_2(option: str, count: int) -> None:
    if count & (count - 1):
        expected = f"a power of 2 with sobol, such as {2 ** round(np.log2(count))}"
        raise ScriptError(f"{option} {count}", expected=expected)


def random_variables(words: Sequence[str]) -> tuple[list[Random], list[str]]:
    variables, others = [], []
    for word in words:
        name, _, text = (piece.strip() for piece in word.partition("="))
        call = CALL.fullmatch(text)
        if call and name.isidentifier():
            variables.append(Random(name, text, _law(name, *call.groups())))
        else:
            others.append(word)
    if len({one.name for one in variables}) < len(variables):
        raise ScriptError("a random variable is given twice")
    return variables, others


def _law(name: str, kind: str, text: str) -> Any:
    from scipy import stats

    if kind not in KINDS:
        raise unknown(f"-var {name}: unknown distribution '{kind}'", kind, KINDS)
    pieces = [piece.strip() for piece in text.split(",")]
    names, numbers = re.findall(r"\w+", KINDS[kind])[1:], [number_of(word) for word in pieces]
    counted = len(pieces) == len(names) and None not in numbers and np.isfinite(numbers).all()
    if not counted or not holds(RULES[kind], dict(zip(names, pieces, strict=True))):
        expected = f"{KINDS[kind]} with numbers, {RULES[kind]}"
        raise ScriptError(f"-var {name}: {kind}({text})", expected=expected)
    a, b, c = [*numbers, 0.0][:3]
    if kind == "lognormal":
        variance = np.log1p((b / a) ** 2)
        return stats.lognorm(np.sqrt(variance), scale=a * np.exp(-variance / 2))
    if kind == "triangular":
        return stats.triang((b - a) / (c - a), a, c - a)
    law = {"uniform": stats.uniform, "loguniform": stats.loguniform, "normal": stats.norm}[kind]
    return law(a, b - a if kind == "uniform" else b)


def samples(
    laws: Sequence[Any], count: int, sequence: str, seed: int, factor: np.ndarray | None = None
) -> np.ndarray:
    """Draw (count, variables) numbers.

    `factor` is the Cholesky factor of the correlation of the normal scores.

    A longer Sobol' or Halton sequence begins with the shorter one.
    """
    from scipy.stats import norm, qmc

    engines = {"latin": qmc.LatinHypercube, "sobol": qmc.Sobol, "halton": qmc.Halton}
    if sequence == "sobol":
        require_power_of_2("-sample", count)
    parts = engines[sequence](len(laws), rng=np.random.default_rng(seed)).random(count)
    if factor is not None:
        parts = norm.cdf(norm.ppf(parts) @ factor.T)
    return np.column_stack([law.ppf(column) for law, column in zip(laws, parts.T, strict=True)])


def correlation(path: Path, names: Sequence[str]) -> np.ndarray:
    """Return the Cholesky factor of a correlation matrix in a file, ordered like `names`."""
    table = read_table(path)
    for name in names:
        if name not in table:
            raise unknown(f"{path}: no column '{name}'", name, table)
    matrix = np.column_stack([table[name] for name in names])
    square = matrix.shape == (len(names),) * 2
    if not (square and np.allclose(matrix, matrix.T) and np.allclose(np.diag(matrix), 1)):
        expected = f"{len(names)} rows of a symmetric matrix with a diagonal of 1"
        raise ScriptError(f"{path} is not a matrix of correlations", expected=expected)
    least = float(np.linalg.eigvalsh(matrix).min())
    if not least > 1e-9:
        raise ScriptError(
            f"{path}: these correlations contradict each other (an eigenvalue is {least:.3g})",
            expected="a positive definite matrix",
        )
    return np.linalg.cholesky(matrix)


def add_options(parser: ArgumentParser) -> None:
    parser.add_argument(
        "-sample", type=positive, metavar="N",
        help="N cases of random variables: -var 'E=normal(1e7, 1e6)', uniform(low, high), "
        "lognormal(mean, deviation), loguniform(low, high), triangular(low, mode, high)",
    )  # fmt: skip
    parser.add_argument(
        "-sequence", choices=SEQUENCES, default="latin",
        help="of -sample: Latin hypercube (latin), or one that more samples extend",
    )  # fmt: skip
    parser.add_argument("-seed", type=int, default=1, help="of -sample (1)")
    parser.add_argument(
        "-correlation", type=Path, metavar="FILE",
        help="correlation matrix of the random variables; its columns have their names",
    )  # fmt: skip
    parser.add_argument(
        "-fails", metavar="CONDITION", help="print the probability of an event: 'factor < 1'"
    )


def prepare(options: Namespace) -> dict[str, Any]:
    """Replace random variables by samples; return the facts to record."""
    calls = (CALL.fullmatch(word.partition("=")[2].strip()) for word in options.var)
    if not options.sample:
        if any(call and call[1] in KINDS for call in calls):
            raise ScriptError("random variables are sampled", expected="-sample N, such as 200")
        if options.correlation or options.fails:
            raise ScriptError("-correlation and -fails", expected="-sample N with them")
        return {}
    needs_scipy("sweep -sample")
    variables, others = random_variables(options.var)
    if not variables:
        expected = "at least one of " + ", ".join(KINDS.values())
        raise ScriptError("-sample: no variable is random", expected=expected)
    names = [one.name for one in variables]
    factor = correlation(options.correlation, names) if options.correlation else None
    laws = [one.law for one in variables]
    drawn = samples(laws, options.sample, options.sequence, options.seed, factor)
    lists = [
        f"{n}={','.join(f'{x:.10g}' for x in xs)}" for n, xs in zip(names, drawn.T, strict=True)
    ]
    options.var = [*lists, *others]
    options.zip = [*options.zip, ",".join(names)]
    return {"random": described(variables), "sequence": options.sequence, "seed": options.seed}


def described(variables: Sequence[Random]) -> Mapping[str, str]:
    return {one.name: one.text for one in variables}
