"""The condition of run_until and run_while."""

from math import isnan
from typing import NamedTuple

from karamelo_py.scene.hub import Hub
from karamelo_py.script.errors import ScriptError
from karamelo_py.script.expressions import Expression


class RunCondition(NamedTuple):
    formula: Expression
    until: bool  # True: the run ends when the condition holds; False: when it no longer holds

    def allows(self, hub: Hub) -> bool:
        values = hub.values
        if self.formula.names - {"time", "timestep", "dt"}:
            hub.refresh_values()
        holds = self.formula.evaluate(values)
        if isnan(holds):
            lost = sorted(name for name in self.formula.names if isnan(values.get(name)))
            raise ScriptError(
                f"step {hub.update.step}: the run condition is not a number: "
                + (f"{lost[0]} is NaN" if lost else "a term of the condition is NaN"),
                expected="values that are numbers at every step",
            )
        return bool(holds) != self.until

    def warn_of_no_step(self, hub: Hub) -> None:
        holds = "holds" if self.until else "does not hold"
        hub.warn(
            f"the condition {holds} before the first step of this run, which has no steps",
            hint="run_until ends when its condition is not 0, run_while when it is 0; "
            "comparisons are 1 or 0",
        )
