"""Sensitivity of expensive runs: indices of a function fitted to a few runs."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import combinations_with_replacement

import numpy as np

from karamelo_py.app.studies.uncertainty import Interval
from karamelo_py.script.errors import ScriptError

GROUPS = 10  # groups of runs, each omitted once for the intervals of indices
SAMPLES, FEW = 16384, 1024  # samples of the fitted function for each index, and for its interval
WIDE = 1.96  # standard deviations of an interval of 95 %

Function = Callable[[np.ndarray], np.ndarray]  # (n, d) to (n,)
Fit = Callable[[np.ndarray, np.ndarray], Function]  # points (n, d) and values (n,)


def powers(x: np.ndarray, degree: int) -> np.ndarray:
    columns = [np.ones(len(x))]
    for number in range(1, degree + 1):
        for axes in combinations_with_replacement(range(x.shape[1]), number):
            columns.append(x[:, axes].prod(axis=1))
    return np.column_stack(columns)


def polynomial(x: np.ndarray, y: np.ndarray, degree: int) -> Function:
    coefficients = np.linalg.lstsq(powers(x, degree), y, rcond=None)[0]
    return lambda at: powers(at, degree) @ coefficients


def splines(x: np.ndarray, y: np.ndarray) -> Function:
    """Thin-plate splines through all values (Duchon 1977)."""
    from scipy.interpolate import RBFInterpolator

    return RBFInterpolator(x, y, kernel="thin_plate_spline", degree=1)


FITS: dict[str, Fit] = {
    "a linear function": partial(polynomial, degree=1),
    "a quadratic polynomial": partial(polynomial, degree=2),
    "a cubic polynomial": partial(polynomial, degree=3),
    "thin-plate splines": splines,
}


def error(fit: Fit, x: np.ndarray, y: np.ndarray) -> float:
    others = ~np.eye(len(x), dtype=bool)
    wrong = [fit(x[one], y[one])(x[[k]])[0] - y[k] for k, one in enumerate(others)]
    return float(np.sqrt(np.mean(np.square(wrong))) / (y.std() or 1.0))


def best(x: np.ndarray, y: np.ndarray) -> tuple[str, float]:
    """Return the name of the fit with the smallest error, and its error.

    A polynomial needs twice as many runs as coefficients.
    """
    enough = {
        name: fit
        for name, fit in FITS.items()
        if fit is splines or 2 * powers(x, fit.keywords["degree"]).shape[1] <= len(x)
    }
    errors = {name: error(fit, x, y) for name, fit in enough.items()}
    name = min(errors, key=errors.__getitem__)
    return name, errors[name]


def indices(
    laws: Sequence, results: Callable[[np.ndarray], np.ndarray], n: int, seed: int
) -> tuple[list[list[tuple[Interval, Interval]]], list[tuple[str, float]]]:
    """First and total Sobol' indices for each result and variable, and the fit of each result.

    Intervals are by leaving out 10 % of the runs (delete-group jackknife), and include the error
    of the sums over samples; they contain the error of the fit as far as it changes with the runs.
    """
    from scipy.stats import qmc, sobol_indices

    if n < 2 * (len(laws) + 1):
        expected = f"-n {2 * (len(laws) + 1)} or more for {len(laws)} variables"
        raise ScriptError(f"-n {n} runs are too few for a fit", expected=expected)
    fractions = qmc.LatinHypercube(len(laws), rng=np.random.default_rng(seed)).random(n)
    inputs = np.array([law.ppf(u) for law, u in zip(laws, fractions.T, strict=True)])
    middle, spread = inputs.mean(axis=1), inputs.std(axis=1)
    x = (inputs.T - middle) / spread

    def of(name: str, rows: np.ndarray, y: np.ndarray, samples: int = FEW) -> np.ndarray:
        function = FITS[name](x[rows], y[rows])
        rng = np.random.default_rng(seed)
        made = sobol_indices(
            func=lambda at: function((at.T - middle) / spread)[None], n=samples,
            dists=list(laws), rng=rng,
        )  # fmt: skip
        return np.array([np.ravel(made.first_order), np.ravel(made.total_order)])

    tables, fits = [], []
    group = np.arange(n) % min(GROUPS, n)
    for y in results(inputs):
        if not y.std():
            raise ScriptError("a result is the same in all runs: no variable matters for it")
        name, wrong = best(x, y)
        every = np.ones(n, bool)
        whole, rough = of(name, every, y, SAMPLES), of(name, every, y)
        parts = np.array([of(name, group != k, y) for k in range(group.max() + 1)])
        half = WIDE * np.sqrt((len(parts) - 1) * parts.var(axis=0)) + abs(whole - rough)
        tables.append(
            [
                tuple(Interval(m, m - h, m + h) for m, h in zip(*pair, strict=True))
                for pair in zip(whole.T.tolist(), half.T.tolist(), strict=True)
            ]
        )
        fits.append((name, wrong))
    return tables, fits
