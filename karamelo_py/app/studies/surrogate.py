"""Sensitivity of expensive runs: indices of a function fitted to a few runs."""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import combinations_with_replacement

import numpy as np

from karamelo_py.app.studies.uncertainty import Interval
from karamelo_py.script.errors import ScriptError

GROUPS = 10  # groups of runs, each omitted once for the intervals of the indices
SAMPLES, FEW = 16384, 1024  # evaluations of the fit for an index, and for its interval
WIDE = 1.96  # standard deviations of an interval of 95 %

Function = Callable[[np.ndarray], np.ndarray]  # maps (n, d) to (n,)
Fit = Callable[[np.ndarray, np.ndarray], Function]  # fits points (n, d) and values (n,)


def powers(x: np.ndarray, degree: int) -> np.ndarray:
    columns = [np.ones(len(x))]
    for number in range(1, degree + 1):
        for axes in combinations_with_replacement(range(x.shape[1]), number):
            columns.append(x[:, axes].prod(axis=1))
    return np.column_stack(columns)


def polynomial(x: np.ndarray, y: np.ndarray, degree: int) -> Function:
    coefficients = np.linalg.lstsq(powers(x, degree), y, rcond=None)[0]
    return lambda at: powers(at, degree) @ coefficients


def likely(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the most likely parameters of a Gaussian process, as logarithms.

    The parameters are the correlation length of each variable, and the noise.
    """
    from scipy.linalg import LinAlgError, cho_factor, cho_solve
    from scipy.optimize import minimize

    def loss(logs: np.ndarray) -> float:
        try:
            factor, lower = cho_factor(_covariance(x, logs))
        except LinAlgError:
            return 1e10
        variance = y @ cho_solve((factor, lower), y) / len(y)
        return 0.5 * len(y) * np.log(variance) + np.log(np.diag(factor)).sum()

    y, count = y - y.mean(), x.shape[1]
    bounds = [(-2.0, 4.0)] * count + [(-18.0, 0.0)]
    ends = [
        minimize(loss, [start] * count + [-9.0], method="L-BFGS-B", bounds=bounds)
        for start in (0.0, 1.5)
    ]
    return min(ends, key=lambda end: end.fun).x


def _correlation(x: np.ndarray, y: np.ndarray, logs: np.ndarray) -> np.ndarray:
    from scipy.spatial.distance import cdist

    lengths = np.exp(logs[:-1])
    return np.exp(-0.5 * cdist(x / lengths, y / lengths, "sqeuclidean"))


def _covariance(x: np.ndarray, logs: np.ndarray) -> np.ndarray:
    return _correlation(x, x, logs) + np.exp(logs[-1]) * np.eye(len(x))


def gaussian_process(x: np.ndarray, y: np.ndarray, logs: np.ndarray) -> Function:
    """Return the mean of a Gaussian process with squared exponential correlations (Rasmussen &
    Williams 2006, section 2.2). `logs` are as returned by `likely`.
    """
    weights = np.linalg.solve(_covariance(x, logs), y - y.mean())
    return lambda at: y.mean() + _correlation(at, x, logs) @ weights


POLYNOMIALS = {"a linear function": 1, "a quadratic polynomial": 2, "a cubic polynomial": 3}


def left_out(fit: Fit, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the errors (n,) of each value predicted from all other values."""
    others = ~np.eye(len(x), dtype=bool)
    return np.array([fit(x[one], y[one])(x[[k]])[0] - y[k] for k, one in enumerate(others)])


def best(x: np.ndarray, y: np.ndarray) -> tuple[str, Fit, float]:
    """Return the fit with the smallest leave-one-out error, its name and its error.

    A polynomial needs twice as many runs as coefficients. Leave-one-out predictions of the Gaussian
    process use the lengths that fit all runs (Rasmussen & Williams 2006, eq. 5.12).
    """
    fits: dict[str, Fit] = {
        name: partial(polynomial, degree=degree)
        for name, degree in POLYNOMIALS.items()
        if 2 * powers(x, degree).shape[1] <= len(x)
    }
    wrong = {name: left_out(fit, x, y) for name, fit in fits.items()}
    logs, name = likely(x, y), "a Gaussian process"
    inverse = np.linalg.inv(_covariance(x, logs))
    fits[name] = partial(gaussian_process, logs=logs)
    wrong[name] = inverse @ (y - y.mean()) / np.diag(inverse)
    errors = {one: float(np.sqrt(np.mean(np.square(of)))) for one, of in wrong.items()}
    name = min(errors, key=errors.__getitem__)
    return name, fits[name], float(errors[name] / (y.std() or 1.0))


def indices(
    laws: Sequence, results: Callable[[np.ndarray], np.ndarray], n: int, seed: int
) -> tuple[list[list[tuple[Interval, Interval]]], list[tuple[str, float]]]:
    """Return first and total Sobol' indices by result and variable, and the fit of each result.

    Intervals follow from a delete-group jackknife (10 % of the runs). The intervals include the
    error of sums over samples, and the error of the fit as far as the fit changes with the runs.
    """
    from scipy.stats import qmc, sobol_indices

    if n < 2 * (len(laws) + 1):
        expected = f"-n {2 * (len(laws) + 1)} or more for {len(laws)} variables"
        raise ScriptError(f"-n {n} runs are too few for a fit", expected=expected)
    fractions = qmc.LatinHypercube(len(laws), rng=np.random.default_rng(seed)).random(n)
    inputs = np.array([law.ppf(u) for law, u in zip(laws, fractions.T, strict=True)])
    middle, spread = inputs.mean(axis=1), inputs.std(axis=1)
    x = (inputs.T - middle) / spread

    def of(fit: Fit, rows: np.ndarray, y: np.ndarray, samples: int = FEW) -> np.ndarray:
        function = fit(x[rows], y[rows])
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
        name, fit, wrong = best(x, y)
        every = np.ones(n, bool)
        whole, rough = of(fit, every, y, SAMPLES), of(fit, every, y)
        parts = np.array([of(fit, group != k, y) for k in range(group.max() + 1)])
        half = WIDE * np.sqrt((len(parts) - 1) * parts.var(axis=0)) + abs(whole - rough)
        tables.append(
            [
                tuple(Interval(m, m - h, m + h) for m, h in zip(*pair, strict=True))
                for pair in zip(whole.T.tolist(), half.T.tolist(), strict=True)
            ]
        )
        fits.append((name, wrong))
    return tables, fits
