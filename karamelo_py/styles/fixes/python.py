"""fix python."""

import inspect
import pickle
import sys
import zlib
from collections.abc import Callable
from importlib import import_module
from typing import Annotated, Any, Literal

import numpy as np

from karamelo_py.kernels.equations.internal_force import Force
from karamelo_py.kernels.hooks import ACTS_ON, STAGES
from karamelo_py.language.faults import KNOWN, cause_of, place_in, steps_to
from karamelo_py.language.registry import forget_other
from karamelo_py.language.signature import Argument
from karamelo_py.scene.group import AnyGroup, NodeGroup
from karamelo_py.scene.hub import Hub
from karamelo_py.scene.modify import Fix
from karamelo_py.scene.plugins import misfit
from karamelo_py.script.errors import FAILURES, ScriptError, meant

MOMENTS = tuple(STAGES)
DATA = (
    *(int, float, complex, str, bytes, bytearray, list, dict, set, tuple),
    *(np.ndarray, np.generic, np.random.Generator, np.random.RandomState),
)


class PythonFunction:
    """Script argument: a function of a module, or one passed from Python."""

    script_kind = "the name of a function: module.function"

    @classmethod
    def from_script(cls, hub: Hub, argument: Argument) -> Callable:
        """Import the function; modules next to the script take precedence."""
        name = argument.words()
        if name in hub.functions:
            return hub.functions[name]
        module, _, function = name.rpartition(".")
        no_file = (
            f"a function f of the file {module}.py is {module}.f" if function == "py" else None
        )
        folder = hub.interpreter.folder.absolute()
        if not module:
            message = f"'{name}' names no module"
            expected = "module.function, of a module next to the script or an installed one"
            raise ScriptError(message, mark=argument.mark, expected=expected)
        try:
            exists = forget_other(module.partition(".")[0])
            imported = import_module(module)
        except FAILURES as error:
            raise ScriptError(
                f"the module {module} cannot be imported: {cause_of(error)}",
                mark=argument.mark,
                hint=no_file
                or (None if exists else f"{module}.py is not in {folder}, nor installed"),
            ) from error
        if not callable(vars(imported).get(function)):
            functions = [key for key, value in vars(imported).items() if callable(value)]
            message = f"the module {module} has no function '{function}'"
            hint = no_file or meant(function, functions, f"{module}.{{}}")
            raise ScriptError(message, mark=argument.mark, hint=hint)
        return getattr(imported, function)


class Python(Fix):
    """Call a Python function on points or nodes in every step: write your own fix.

    Parameters
    ----------
    group
        Group of points or of nodes, or ``all``.
    function
        ``module.function``, from a module next to the script or an installed one.
    moment
        When it is called in a step. Default for points: ``initial_integrate``, where
        ``points.force`` accepts forces; for nodes: ``post_update_grid_state``, where
        ``nodes.velocity_update`` accepts velocities.

    Notes
    -----
    The function gets a view of the group: dt, time, and arrays with a row per member (position,
    velocity, mass, force ...; see the page on plug-ins). The function may change these arrays. The
    return value of the function is published: a number as ID, up to three numbers as ID_x, ID_y,
    ID_z. A call costs about ten microseconds.

    With several processes, all points are gathered in each step, which is slow. If a function
    ``pull`` treats each point or node separately and moves no points, set ``pull.point_by_point =
    True``: each process then calls it for its own points, in any order. ``points.total(terms)``
    sums terms (n,) or (n, k) over all points.

    Restart files contain the values that the function stores between steps if its module, or the
    class of a callable object, names them: ``remembers = ("taken", "left")``. Such values are
    numbers, texts, arrays, NumPy generators, or lists, tuples, sets and dictionaries of these. When
    the first file is written, a warning names other values of the module or object that have
    changed; changes in defaults of arguments, in other objects and modules, and in ``np.random``
    are not detected.

    Example
    -------
    fix(spring, python, all, springs.pull)
    fix(wall, python, wall_nodes, walls.hold, post_update_grid_state)

    See Also
    --------
    body_force, force_nodes, velocity_nodes
    """

    published = ("x", "y", "z", "")
    remembers = ("state",)
    warned = False

    def __init__(
        self,
        hub: Hub,
        group: AnyGroup,
        function: PythonFunction,
        moment: Annotated[str, Literal[MOMENTS]] | None = None,
    ):
        on_nodes = isinstance(group, NodeGroup)
        if moment is None:
            moment = "post_update_grid_state" if on_nodes else "initial_integrate"
        if group.all and ACTS_ON[moment] == "nodes":
            group, on_nodes = NodeGroup(hub, everything=True), True
        fit = [m for m in MOMENTS if (ACTS_ON[m] == "nodes") == on_nodes]
        if moment not in fit:
            raise ScriptError(
                f"{moment} is a moment of {ACTS_ON[moment]}, and '{group.id}' is a group of "
                f"{group.kind}",
                argument="moment",
                expected=f"one of {', '.join(fit)}",
            )
        if wrong := misfit(function, 1):
            message = f"{called_as(function)} cannot be called with one argument: {wrong}"
            expected = "a function of one argument, the points or nodes of the group"
            raise ScriptError(message, argument="function", expected=expected)
        super().__init__(hub, group)
        self.function: Any = function
        self.keeper = Keeper(function)
        self.point_by_point = getattr(function, "point_by_point", False)
        self.point_fields = () if on_nodes else (Force,)
        setattr(self, moment, self._act)

    @property
    def state(self) -> dict[str, Any]:
        return {name: getattr(self.keeper.owner, name) for name in self.keeper.names}

    @state.setter
    def state(self, kept: dict[str, Any]) -> None:
        for name, value in kept.items():
            setattr(self.keeper.owner, name, value)

    def filed(self) -> None:
        """Warn once of values that restart files lack."""
        keeper = self.keeper
        forgotten = [] if self.warned else keeper.forgotten()
        if forgotten:
            self.warned = True
            self.hub.warn(
                f"fix python: {called_as(self.function)} has changed {', '.join(forgotten)}, and "
                "restart files do not contain that: a restarted run will differ",
                mark=self.mark,
                hint=f"remembers = {(*keeper.names, *forgotten)!r} in {keeper.title}, or in the "
                "class of an object that is called",
            )

    def _act(self, view: Any) -> None:
        try:
            result = self.function(view)
        except KNOWN:
            raise
        except FAILURES as error:
            message = f"{cause_of(error)}{place_in(self.function, error)}"
            failure = ScriptError(
                f"fix python: {called_as(self.function)}: {message}",
                mark=self.mark,
                hint="\n  ".join(["correct the function there:", *steps_to(error)]),
            )
            failure.complete = True
            raise failure from error
        if self.point_by_point:
            self._agree(result)
        if result is None:
            return
        numbers = np.asarray(result, float)
        if numbers.ndim == 0:
            self.publish("", numbers)
        else:
            self.publish_components(numbers)

    def _agree(self, result: Any) -> None:
        values = None if result is None else np.asarray(result, float).tolist()
        first, *others = map(repr, self.hub.simulation.comm.everyone("its end", values))
        other = next((one for one in others if one != first), None)
        if other is not None:
            raise ScriptError(
                f"fix python: {called_as(self.function)} returns {first} on one process and "
                f"{other} on another",
                mark=self.mark,
                hint="each process has a part of the points: sum with points.total(values) or "
                "nodes.total(values), or leave out point_by_point",
            )


class Keeper:
    """The object or module of a function, with the values that it stores.

    `names` are the names in ``remembers``; `title` names the object.
    """

    def __init__(self, function: Callable):
        owner = function.__self__ if inspect.ismethod(function) else function
        self.title = f"the class {type(owner).__name__}"
        self.data = vars(owner) if hasattr(owner, "__dict__") else {}
        if inspect.isfunction(owner):
            self.data, owner = owner.__globals__, sys.modules.get(owner.__module__)
            self.title = f"the module {function.__module__ or '__main__'}"
        names = getattr(owner, "remembers", ())
        self.names = (names,) if isinstance(names, str) else tuple(names)
        self.owner, self.function = owner, function
        for name in self.names:
            if not hasattr(owner, name):
                message = f"{self.title} lists '{name}' in remembers, but does not have it"
                expected = "a name with an initial value when the fix is defined"
                raise ScriptError(message, argument="function", expected=expected)
        self.seen = self._look()

    def forgotten(self) -> list[str]:
        before, self.seen = self.seen, self._look()
        return [name for name, seen in before.items() if self.seen.get(name, seen) != seen]

    def _look(self) -> dict[str, int]:
        data = dict(self.data)
        if inspect.isfunction(self.function):
            seen = inspect.getclosurevars(self.function)
            # The module of a notebook has many unrelated names.
            module = sys.modules.get(self.function.__module__)
            notebook = self.function.__module__ == "__main__" or module is None
            data = (dict(seen.globals) if notebook else data) | dict(seen.nonlocals)
        return {
            name: _sum_of(value)
            for name, value in data.items()
            if isinstance(value, DATA) and name not in self.names and not name.startswith("__")
        }


def _sum_of(value: Any) -> int:
    try:
        return zlib.crc32(pickle.dumps(value))
    except Exception:
        return 0


def called_as(function: Any) -> str:
    return getattr(function, "__name__", type(function).__name__)
